//! The frames of one control cycle, and how many bits they take on the wire.

use crate::can::transport::{nominal_bits, worst_bits};

/// Sizes of the frames of one control cycle, in bytes of data.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CycleFrames {
    /// Whether ids have 29 bits.
    extended: bool,
    once: &'static [usize],
    each_motor: &'static [usize],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CycleBits {
    pub nominal: u32,
    /// With as many stuff bits as there can be.
    pub worst: u32,
}

impl CycleFrames {
    pub const fn new(extended: bool, once: &'static [usize], each_motor: &'static [usize]) -> Self {
        Self { extended, once, each_motor }
    }

    pub fn bits(&self, motors: usize) -> CycleBits {
        let sum = |bits: fn(bool, usize) -> u32| {
            let total =
                |sizes: &[usize]| sizes.iter().map(|&size| bits(self.extended, size)).sum::<u32>();
            total(self.once) + total(self.each_motor) * motors as u32
        };
        CycleBits { nominal: sum(nominal_bits), worst: sum(worst_bits) }
    }
}
