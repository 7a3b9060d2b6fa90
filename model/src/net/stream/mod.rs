//! Both networks a frame at a time, on the [engine](super::engine).
//!
//! A state holds everything of one stream: it can be cloned, begun anew without
//! allocating, and costs the same at every frame. The same networks for all
//! frames at once, in candle, are the check: `OneShotDecoder`, `OneShotSeq`.

mod decoder;
mod layer;
mod motionseq;

pub use decoder::{DecoderState, VqDecoder};
pub use motionseq::{MotionSeq, SeqState};
