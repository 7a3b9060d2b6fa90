//! Beats: a causal tracker with phase for dancing, an offline one for scoring.
//!
//! ```text
//! band and note values -> network -> beat_evidence -> bar_pointer -> tracker -> Beat
//! onset strength -----------------------^
//! ```
//!
//! The `network` hears beats and downbeats, the `bar_pointer` holds the
//! probability of every tempo, phase, meter and place in the bar, the `tracker`
//! follows the likeliest smoothly and holds the lock.

mod bar_pointer;
mod beat_evidence;
mod history;
mod network;
mod network_input;
mod offline;
mod state_space;
mod tempo_range;
mod tracker;

pub use history::{BeatHistory, BeatTrack, LiveBeat};
pub use network_input::{INPUTS, inputs_of};
pub use offline::track_offline;
pub use tempo_range::{TempoRange, TempoRangeError};

pub(crate) use history::BeatCaller;
pub(crate) use network::{BeatNetwork, NetworkOutput};
pub(crate) use network_input::input;
pub(crate) use offline::offline_evidence;
pub(crate) use tracker::Tracker;
