//! Forces and moments.

mod joint_torque;

pub use joint_torque::TorqueReport;
pub(crate) use joint_torque::{StanceFoot, TorqueEstimator};
