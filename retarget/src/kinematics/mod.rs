//! Where the links are, and how they move with the joints.

mod body_map;
mod chain;
mod jacobian;
mod shapes;

pub(crate) use body_map::BodyMap;
pub use chain::RobotModel;
pub(crate) use chain::{DrivenAncestor, JointMotion};
pub(crate) use jacobian::{Jacobian, PosedRobot};
pub(crate) use shapes::{Capsule, LinkShapes, capsule_of};
pub use shapes::{MeshVisual, Shape, Visual};
