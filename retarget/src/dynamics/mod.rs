//! Forces and moments.

pub(crate) mod joint_torque;
