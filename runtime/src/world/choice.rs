//! Where the simulated robot is: the values of `--world`.

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
    /// The usual one: a floor for a robot that stands on its feet, none for others.
    pub fn usual(robot: &Robot) -> Self {
        match robot.retarget.stance.stands() {
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
