//! Beats: a causal tracker with phase for dancing, an offline one for scoring.
//!
//! ```text
//! band and note values -> network -> beat_evidence -> bar_pointer -> tracker -> Beat
//! onset strength -----------------------^
//!       `-------> onset_tracker --------'
//! ```
//!
//! The `network` hears beats and downbeats, the `onset_tracker` gives the beat of the
//! onsets alone, the `bar_pointer` holds the
//! probability of every tempo, phase, meter and place in the bar, the `tracker`
//! follows the likeliest smoothly and holds the lock.

mod bar_pointer;
mod beat_evidence;
mod history;
mod metrical_level;
mod network;
mod network_input;
mod offline;
mod onset_tracker;
mod state_space;
mod tempo;
mod tempo_range;
mod tempogram;
mod tracker;

pub use history::{BeatHistory, BeatTrack, LiveBeat};
pub use metrical_level::MetricalReading;
pub use network_input::{INPUTS, inputs_of};
pub use offline::track_offline;
pub use tempo_range::{TempoRange, TempoRangeError};

pub(crate) use beat_evidence::StepOnset;
pub(crate) use history::BeatCaller;
pub(crate) use network::{BeatNetwork, NetworkOutput};
pub(crate) use network_input::input;
pub(crate) use offline::offline_evidence;
pub(crate) use onset_tracker::OnsetTracker;
pub(crate) use tracker::Tracker;
