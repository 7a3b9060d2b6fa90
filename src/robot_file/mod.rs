//! Robot files as files: looked over, and written anew for a description.
//!
//! What a robot file means is in [`crate::robot`]; here is what people need
//! before one can be used.

mod check;
mod new;
mod servos;
mod text;

pub use check::{Checked, check};
pub use new::{NewRobot, new_robot};
