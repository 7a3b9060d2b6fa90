//! Beats: a causal tracker with phase for dancing, an offline one for scoring.
//!
//! ```text
//! onset strength -> tempogram -> tempo (period and phase) -> tracker -> Beat
//! band values -> network -------> metrical_level, downbeat --^
//! ```
//!
//! `tempo` decides the beat period and phase from moment to moment, the
//! `tracker` follows them smoothly and holds the lock, `metrical_level` decides
//! whether the period is read as it is, halved or doubled.

mod downbeat;
mod history;
mod metrical_level;
mod network;
mod network_input;
mod offline;
mod state_space;
mod tempo;
mod tempogram;
mod tracker;

pub use history::{BeatHistory, BeatTrack};
pub use metrical_level::MetricalReading;
pub use network_input::{INPUTS, inputs_of};
pub use offline::track_offline;

pub(crate) use history::BeatCaller;
pub(crate) use network::{BeatNetwork, NetworkOutput};
pub(crate) use network_input::input;
pub(crate) use state_space::evidence;
pub(crate) use tracker::Tracker;
