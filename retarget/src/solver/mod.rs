//! Inverse kinematics of the whole body.

pub(crate) mod arm_search;
pub(crate) mod body_solver;
pub(crate) mod least_squares;
pub(crate) mod limb_task;
mod searched_arm;
