//! A robot in the simulated world, without buses: does it stand while it dances?

mod servo_loop;
mod standing_trial;

pub use servo_loop::{ServoLoop, ServoVariation};
pub use standing_trial::{StandingTrial, TrialOptions, TrialReport};
