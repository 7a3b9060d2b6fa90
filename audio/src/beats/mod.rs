//! Beats: a causal tracker with phase for dancing, an offline one for scoring.

pub(crate) mod belief;
pub(crate) mod history;
pub(crate) mod level;
mod offline;
pub(crate) mod tempo;
pub(crate) mod tracker;

pub use history::History;
pub use offline::{BeatTrack, track_offline};
