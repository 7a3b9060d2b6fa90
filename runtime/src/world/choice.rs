//! Where the simulated robot is: the values of `--world`.

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
    /// As the user writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Floor => "floor",
            Self::Stand => "stand",
        }
    }
}
