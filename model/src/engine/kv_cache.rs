//! KV cache: keys and values of the last `window` frames, in slots that are
//! overwritten in rotation.
//!
//! Frame `t` is kept in slot `t % window`, so that memory and time stay constant.
//! The order of the slots does not matter: a slot's age gives its bias
//! ([`super::alibi`]). Slots that were never written are not read.

use super::kernels::{self, Cpu};
use crate::weights::Dtype;

/// Rotation of a cache: the slot that is written now, and how many are filled.
#[derive(Clone, Debug)]
pub(crate) struct CachePosition {
    window: usize,
    frame: u64,
}

impl CachePosition {
    pub fn new(window: usize) -> Self {
        Self { window, frame: 0 }
    }

    /// Frames before the one that is being processed.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// The slot of the frame that is being processed.
    pub fn slot(&self) -> usize {
        (self.frame % self.window as u64) as usize
    }

    /// Slots that hold something once it is written.
    pub fn filled(&self) -> usize {
        (self.frame + 1).min(self.window as u64) as usize
    }

    pub fn advance(&mut self) {
        self.frame += 1;
    }

    /// Goes to any frame, as if all before had been processed.
    pub fn jump(&mut self, frame: u64) {
        self.frame = frame;
    }
}

/// The shape of an attention: heads, their width, the slope of each.
#[derive(Clone, Debug)]
pub(crate) struct AttentionShape {
    pub window: usize,
    pub width: usize,
    pub slopes: Vec<f32>,
}

impl AttentionShape {
    pub fn wide(&self) -> usize {
        self.width * self.slopes.len()
    }

    /// Width of a head, filled up to whole eights.
    pub fn padded(&self) -> usize {
        self.width.next_multiple_of(8)
    }
}

/// Numbers of a cache: f32 beside f32 weights, else f16.
#[derive(Clone, Debug)]
pub(super) enum CacheNumbers {
    F32(Vec<f32>),
    F16(Vec<u16>),
}

impl CacheNumbers {
    fn new(length: usize, dtype: Dtype) -> Self {
        match dtype {
            Dtype::F32 => Self::F32(vec![0.0; length]),
            _ => Self::F16(vec![0; length]),
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Self::F32(all) => 4 * all.len(),
            Self::F16(all) => 2 * all.len(),
        }
    }

    pub fn write(&mut self, cpu: Cpu, at: usize, values: &[f32]) {
        match self {
            Self::F32(all) => all[at..at + values.len()].copy_from_slice(values),
            Self::F16(all) => kernels::to_half(cpu, &mut all[at..at + values.len()], values),
        }
    }
}

/// The cache of one layer and lane, [heads, window, width].
#[derive(Clone, Debug)]
pub(crate) struct KvCache {
    pub(super) keys: CacheNumbers,
    pub(super) values: CacheNumbers,
}

impl KvCache {
    pub fn new(shape: &AttentionShape, dtype: Dtype) -> Self {
        let length = shape.slopes.len() * shape.window * shape.padded();
        Self { keys: CacheNumbers::new(length, dtype), values: CacheNumbers::new(length, dtype) }
    }

    pub fn bytes(&self) -> usize {
        self.keys.bytes() + self.values.bytes()
    }
}
