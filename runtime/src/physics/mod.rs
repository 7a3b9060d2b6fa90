//! A robot in the simulated world, without buses: does it stand while it dances?

mod amplitude_search;
mod push_search;
mod servo_loop;
mod stance_check;
mod standing_trial;
mod upper_speed;

pub use amplitude_search::{StandingAmplitude, StandingShares, TrialDance, find_amplitude};
pub use push_search::survived_push_ns;
pub use servo_loop::{ServoLoop, ServoVariation};
pub use stance_check::StanceCheck;
pub use standing_trial::{StandingTrial, TrialOptions, TrialReport};
pub use upper_speed::{upper_speed2, upper_speed2_by_limits};
