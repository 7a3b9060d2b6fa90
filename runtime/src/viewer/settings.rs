//! What a viewer can change while the robot dances.

use crate::control::idle::IdleStyle;

/// What can be changed while the robot dances.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub struct ViewerSettings {
    /// Share of the movement around rest, 0 to 1.
    pub amplitude: f64,
    /// Whether the robot is the dancer's mirror image.
    pub mirror: bool,
    /// What to do while there is no music.
    pub idle: IdleStyle,
    /// The style, as a place in the model's list.
    pub style: usize,
    /// Seed of the dancer's random numbers.
    pub seed: u64,
}
