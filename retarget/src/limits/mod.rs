//! What the output must hold in every cycle.

mod collision_limit;
mod feed_forward;
mod joint_tracker;
mod predictive_control;
mod velocity_limit;

pub(crate) use collision_limit::CollisionLimit;
pub(crate) use feed_forward::FeedForward;
pub(crate) use joint_tracker::JointTracker;
pub(crate) use predictive_control::PredictiveController;
pub(crate) use velocity_limit::{JointLimiter, TrajectoryState};
