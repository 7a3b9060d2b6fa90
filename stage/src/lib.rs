//! Many robots, one beat: what goes over the network between the leader of a
//! stage and its followers, and how a follower knows when.
//!
//! ```text
//! leader:   frames -> Leader -> bytes ==================> network
//! follower: bytes -> Follower (clock, buffer) -> frames in order, and the
//!           moment of motion that is due now -> Playhead -> retargeter
//! ```
//!
//! Everything but `net` (feature `zenoh`) is values and arithmetic: time comes
//! in as nanoseconds of somebody's monotonic clock, bytes come in and go out,
//! nothing here waits, prints or opens a socket. Nothing that comes in makes it
//! panic or take memory without bound.

mod clock;
mod copies;
mod follower;
pub mod keys;
mod lateness;
mod leader;
#[cfg(feature = "zenoh")]
pub mod net;
mod playhead;
mod playout;
pub mod ros2;
pub mod wire;

pub use clock::{Estimate, StageClock};
pub use copies::once;
pub use follower::{Counters, Due, Figures, Follower, Released};
pub use leader::{Leader, Outgoing, Standing};
pub use playhead::Playhead;
