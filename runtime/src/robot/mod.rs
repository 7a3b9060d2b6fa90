//! Robots: the built-in ones, robot files, keys set beside a file, the draft of a
//! new file and the check of an old one.
//!
//! | to | see |
//! |---|---|
//! | add a robot | `built_in` |
//! | add a key to robot files | `robot_file`, and `configs/robot.schema.json` |
//! | read a robot | [`Robot::load`] |
//! | write a file for a description | [`new_robot`] |
//! | draw robots beside the human | [`pose_sheet`] |

mod check;
mod config_source;
mod description_text;
mod draft;
mod getup_plan;
mod loaded;
pub(crate) mod meshes;
mod overrides;
mod pose_sheet;
mod robot_file;
mod robot_folders;
#[cfg(test)]
mod schema;
mod standing_gain;

pub use check::{Checked, check};
pub use draft::{NewRobot, check_place, new_robot};
pub use getup_plan::{GetupPlan, GetupPose, Lying};
pub use loaded::Robot;
pub use meshes::Meshes;
pub use overrides::Overrides;
#[cfg(test)]
pub(crate) use pose_sheet::human;
pub use pose_sheet::pose_sheet;
pub use robot_file::RobotError;
pub use servodance_robots::{BUILT_IN, BuiltIn, ROBOT_SCHEMA, names};
pub use standing_gain::settle_amplitude;
