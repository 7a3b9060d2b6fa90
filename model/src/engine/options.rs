//! Which engine computes a step, in which number format, on how many threads.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use servodance_types::named;

use super::pool::{Pool, default_threads};
use crate::error::ModelError;
use crate::weights::{Dtype, Weights};

/// Most threads that a step is split over.
const THREADS_MAX: usize = 64;

/// What computes the step of a dance; [the module](super) says why there are two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EngineKind {
    /// The kernels of this crate: the fast one.
    #[default]
    Own,
    /// The tensors of candle: the same codes up to rounding, several times the time.
    Candle,
}

named!(EngineKind, "engine" { Own "own", Candle "candle" });

/// How the steps of a model are to be computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EngineOptions {
    /// Which engine; the own one if nothing is asked for.
    pub kind: EngineKind,
    /// Number format of the packed weights; none is the file's own.
    pub dtype: Option<Dtype>,
    /// Threads of a step, the caller's among them; none is [`default_threads`].
    pub threads: Option<usize>,
}

/// Engine, number format and threads of the networks of one file.
#[derive(Clone, Debug)]
pub struct Engine {
    kind: EngineKind,
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
            kind: options.kind,
            dtype: options.dtype.unwrap_or_else(|| w.dtype()),
            pool: Arc::new(match options.kind {
                EngineKind::Own => Pool::new(threads),
                EngineKind::Candle => Pool::for_tensors(threads),
            }),
        })
    }

    /// Which engine the networks were loaded for.
    pub fn kind(&self) -> EngineKind {
        self.kind
    }

    /// Number format of the packed weights.
    pub fn dtype(&self) -> Dtype {
        self.dtype
    }

    /// The threads that a step is split over.
    pub fn pool(&self) -> &Pool {
        &self.pool
    }
}
