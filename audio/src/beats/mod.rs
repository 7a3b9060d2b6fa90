//! Beats: a causal tracker with phase for dancing, an offline one for scoring.

mod bar;
pub(crate) mod belief;
pub(crate) mod hearing;
pub(crate) mod history;
pub(crate) mod level;
pub(crate) mod network;
mod offline;
pub(crate) mod tempo;
pub(crate) mod tracker;

pub use hearing::{INPUTS, inputs_of};
pub use history::History;
pub use level::LevelReading;
pub use offline::{BeatTrack, track_offline};
