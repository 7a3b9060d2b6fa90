//! Beats: a causal tracker with phase for dancing, an offline one for scoring.

pub(crate) mod belief;
pub(crate) mod tempo;
pub(crate) mod tracker;

pub use tracker::BeatState;
