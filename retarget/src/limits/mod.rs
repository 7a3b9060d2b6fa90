//! What the output must hold in every cycle.

mod collision_limit;
mod joint_tracker;
mod predictive_control;
mod target_queue;
mod velocity_limit;

pub(crate) use collision_limit::CollisionLimit;
pub(crate) use joint_tracker::JointTracker;
pub(crate) use predictive_control::PredictiveController;
pub(crate) use velocity_limit::{JointLimiter, TrajectoryState};
