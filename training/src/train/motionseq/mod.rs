//! MotionSeq: the next codes from the codes before, the music and a style.

pub(crate) mod network;
pub(crate) mod nll;
mod start_codes;
pub(crate) mod tokens;
pub(crate) mod training;
