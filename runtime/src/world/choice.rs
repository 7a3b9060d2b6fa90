//! Where the simulated robot is: the values of `--world`.

use super::robot_world::RobotWorld;
use crate::robot::Robot;

/// What is around a simulated robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum WorldChoice {
    /// Nothing: each servo turns by itself, without weight.
    #[default]
    None,
    /// A floor, and gravity: the robot stands or falls.
    Floor,
    /// A stand that holds the root link, and gravity.
    Stand,
}

impl WorldChoice {
    /// Where a simulated robot is unless somebody says so: on a floor if it stands on its
    /// feet and its description has what physics needs, else nowhere.
    pub fn of_robot(robot: &Robot) -> Self {
        let stands = robot.retarget.stance.stands();
        match stands && RobotWorld::open(robot, Self::Floor).is_ok() {
            true => Self::Floor,
            false => Self::None,
        }
    }

    /// As the user writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Floor => "floor",
            Self::Stand => "stand",
        }
    }
}
