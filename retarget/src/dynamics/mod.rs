//! Forces and moments.

mod joint_torque;
mod rigid_links;

pub use joint_torque::TorqueReport;
pub(crate) use joint_torque::{StanceFoot, TorqueEstimator};
pub(crate) use rigid_links::{placement, rigid_links};
