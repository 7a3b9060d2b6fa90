//! What runs the networks a frame at a time: matrices packed once, products
//! with one vector by own kernels, rotating caches of keys and values, and
//! helper threads that share the rows.
//!
//! Promises: a step allocates nothing, takes the same time at every position,
//! and gives the same bits for any number of threads and on every processor.
//! For many frames at once (training, encoding) use candle: see `attention`.

mod avx2;
#[cfg(test)]
mod bits;
mod dtype;
mod input;
mod kernels;
mod lanes;
mod linear;
mod matrix;
mod ops;
mod pool;
mod ring;
mod slab;
#[cfg(test)]
mod tests;

pub use dtype::Dtype;
#[cfg(test)]
use kernels::Cpu;
pub use pool::{Pool, Team, default_threads};

pub(crate) use dtype::{
    BLOCK, CHUNK, CHUNK_WORDS, q4_block, q4_values, q6_chunk, q6_values, q8_block,
};
pub(crate) use input::Input;
pub(crate) use kernels::styled;
pub(crate) use linear::{After, Linear, Norm};
pub(crate) use matrix::{Matrix, gather};
pub(crate) use ops::{add_lane, add_positions};
pub(crate) use ring::{Clock, Heads, Ring, Scene};

use std::sync::Arc;

use crate::error::ModelError;
use crate::net::weights::Weights;

/// Most threads that a step is split over.
const THREADS_MAX: usize = 64;

/// How the steps of a model are to be computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EngineOptions {
    /// Number format of the packed weights; none is the file's own.
    pub dtype: Option<Dtype>,
    /// Threads a step uses, the caller's among them; none is
    /// [`default_threads`].
    pub threads: Option<usize>,
}

/// Number format and helper threads of the networks of one file.
#[derive(Clone, Debug)]
pub struct Engine {
    dtype: Dtype,
    pool: Arc<Pool>,
}

impl Engine {
    /// For a weights file. Refuses thread counts that make no sense.
    pub fn new(w: &Weights, options: EngineOptions) -> Result<Self, ModelError> {
        let threads = options.threads.unwrap_or_else(default_threads);
        if !(1..=THREADS_MAX).contains(&threads) {
            return Err(ModelError::Option {
                option: "threads",
                found: threads.to_string(),
                expected: "1 to 64",
            });
        }
        Ok(Self {
            dtype: options.dtype.unwrap_or_else(|| w.dtype()),
            pool: Arc::new(Pool::new(threads)),
        })
    }

    /// Number format of the packed weights.
    pub fn dtype(&self) -> Dtype {
        self.dtype
    }

    /// The threads.
    pub fn pool(&self) -> &Pool {
        &self.pool
    }
}
