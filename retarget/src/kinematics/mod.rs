//! Where the links are, and how they move with the joints.

mod body_map;
mod chain;
mod jacobian;
mod joint_drive;
mod level;
mod platform;
mod shapes;
mod turning_base;

pub(crate) use body_map::{ArmLinks, BodyMap};
pub use chain::RobotModel;
pub(crate) use chain::{ChainLink, DrivenAncestor, JointMotion};
pub(crate) use jacobian::{Jacobian, PosedRobot};
pub(crate) use joint_drive::JointDrive;
pub(crate) use level::level_rotation;
pub(crate) use platform::{Platform, Rod, Twist};
pub(crate) use shapes::{Capsule, LinkShapes, capsule_of};
pub use shapes::{MeshVisual, Shape, Visual};
pub(crate) use turning_base::TurningBase;
