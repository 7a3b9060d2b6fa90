//! A robot in the simulated world, without buses: does it stand while it dances?

mod amplitude_search;
mod servo_loop;
mod standing_trial;

pub use amplitude_search::{StandingAmplitude, find_amplitude, scaled};
pub use servo_loop::{ServoLoop, ServoVariation};
pub use standing_trial::{StandingTrial, TrialOptions, TrialReport};
