//! Figures that say how good motion is, defined as the literature defines them.
//!
//! Offline: nothing here is made for the control loop.

pub(crate) mod distribution;
pub(crate) mod features;
pub(crate) mod music_answer;
pub mod quality;
pub(crate) mod repetition;
pub(crate) mod retrieval;
pub mod richness;
pub(crate) mod t2m;
