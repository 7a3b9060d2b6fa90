//! Robot files as files: looked over, and written anew for a description.
//!
//! What a robot file means is in [`crate::robot`]; here is what people need
//! before one can be used: set beside the file, blamed, completed by an editor.

mod check;
mod copies;
mod homes;
mod new;
mod origin;
mod overrides;
mod schema;
mod servos;
mod text;

pub use check::{Checked, check};
pub(crate) use homes::{Homes, Stray};
pub use new::{NewRobot, new_robot};
pub(crate) use origin::Origin;
pub use overrides::Overrides;
pub use schema::ROBOT_SCHEMA;
