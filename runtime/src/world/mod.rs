//! The world that simulated servos carry a robot's body in: which one, how it is
//! made from a robot file, and what is told of the body afterwards.
//!
//! Physics itself is `servodance_sim::world`; real robots bring their own.

mod choice;
mod report;
mod robot_world;

pub use choice::WorldChoice;
pub use report::BodyReport;
pub use robot_world::RobotWorld;
