//! Robots: files that describe them, and those that come with servodance.

mod check;
mod draft;
mod homes;
mod loaded;
mod origin;
mod overrides;
mod schema;

pub use check::{Checked, check};
pub use draft::{NewRobot, new_robot};
pub(crate) use homes::{Homes, Stray};
pub use loaded::{BUILT_IN, BuiltIn, Robot, RobotError};
pub(crate) use origin::Origin;
pub use overrides::Overrides;
pub use schema::ROBOT_SCHEMA;
