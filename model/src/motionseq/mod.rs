//! MotionSeq: the next code of every body part from the codes before, the music
//! up to now and a style.
//!
//! Frame i reads the codes of frame i-1 and the music of frame i. There is no
//! start token: the codes before the first frame are given, so that dances
//! chain. Music is normalised by the caller. A state has one or more lanes:
//! the same dance with other music (or none), for classifier-free guidance; lanes
//! read the weights together.
//!
//! [`MotionSeq`] runs on the engine that was asked for: `own` or `candle`, the same
//! network twice. ALiBi and the KV cache are in [`crate::engine`], style
//! conditioning in [`crate::conditioning`].

#[cfg_attr(not(feature = "candle"), path = "no_candle.rs")]
mod candle;
mod embeddings;
mod network;
mod own;

pub use network::{MotionSeq, SeqState};

#[cfg(all(test, feature = "candle"))]
pub(crate) use candle::{CandleSeq, CandleSeqState};
