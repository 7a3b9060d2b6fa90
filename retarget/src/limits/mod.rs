//! What the output must hold in every cycle.

pub(crate) mod collision_limit;
pub(crate) mod joint_tracker;
pub(crate) mod predictive_control;
pub(crate) mod velocity_limit;
