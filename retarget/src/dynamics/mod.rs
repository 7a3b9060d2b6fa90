//! Forces and moments.

mod joint_torque;
mod rigid_links;

pub use joint_torque::TorqueReport;
pub(crate) use joint_torque::{GRAVITY_M_S2, StanceFoot, TorqueEstimator};
pub use rigid_links::JointLoad;
pub(crate) use rigid_links::{joint_loads, placement, rigid_links};
