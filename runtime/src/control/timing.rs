//! How time passes in a dance: what the control loop is told of it beforehand.

use crate::control::idle::IdleStyle;
use crate::session::config::Speed;

/// How time passes in a dance.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// How fast it passes.
    pub speed: Speed,
    /// Whether audio comes in as it is played.
    pub live: bool,
    /// Whether a recording is danced to as if it came in live.
    pub as_live: bool,
    /// Whether the motion is steered onto the beat.
    pub compensation: bool,
    /// What to do while there is no music.
    pub idle: IdleStyle,
    /// Whether somebody else leads: motion comes with its time.
    pub staged: bool,
}
