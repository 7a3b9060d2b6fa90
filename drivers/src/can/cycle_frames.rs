//! The frames of one control cycle, and how many bits they take on the wire.

use crate::can::transport::{flexible_bits, nominal_bits, worst_bits};

/// Sizes of the frames of one control cycle, in bytes of data.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CycleFrames {
    /// Whether ids have 29 bits.
    extended: bool,
    flexible: bool,
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
        Self { extended, flexible: false, once, each_motor }
    }

    /// The same of CAN FD frames with ids of 29 bits.
    pub const fn flexible(each_motor: &'static [usize]) -> Self {
        Self { extended: true, flexible: true, once: &[], each_motor }
    }

    pub fn bits(&self, motors: usize) -> CycleBits {
        let sum = |bits: fn(bool, usize) -> u32| {
            let total =
                |sizes: &[usize]| sizes.iter().map(|&size| bits(self.extended, size)).sum::<u32>();
            total(self.once) + total(self.each_motor) * motors as u32
        };
        match self.flexible {
            // Stuff bits of the data pass at the higher rate: they are few in bits of the lower.
            true => {
                let nominal = sum(flexible_bits);
                CycleBits { nominal, worst: nominal + nominal / 5 }
            }
            false => CycleBits { nominal: sum(nominal_bits), worst: sum(worst_bits) },
        }
    }
}
