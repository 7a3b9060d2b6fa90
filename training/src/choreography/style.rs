//! Which figures belong to which style, and how they are danced.

use super::arms::Arms;
use super::legs::Steps;
use super::torso::Trunk;

/// A way to dance that the choreographer knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DanceStyle {
    /// Relaxed club dancing: side steps, sways, waves.
    Groove,
    /// Pointing, clapping, turning.
    Disco,
    /// Sharp stops and right angles.
    Robot,
    /// Jumps, kicks, punches, hands in the air.
    Hype,
    /// Salsa basics with hips and bent arms.
    Salsa,
}

/// The figures and manners of a style.
pub(crate) struct Manner {
    pub(crate) steps: &'static [Steps],
    pub(crate) arms: &'static [Arms],
    pub(crate) trunks: &'static [Trunk],
    /// See [`super::track::minimum_jerk`].
    pub(crate) snap: f64,
    /// Rise of the body between beats, metres.
    pub(crate) bounce_m: f64,
    /// Nod of the head on the beat, radians.
    pub(crate) nod_rad: f64,
}

impl DanceStyle {
    /// Every style.
    pub const ALL: [Self; 5] = [
        Self::Groove,
        Self::Disco,
        Self::Robot,
        Self::Hype,
        Self::Salsa,
    ];

    /// The name of the style in data sets, one of [`crate::motion::index::STYLES`].
    pub fn name(self) -> &'static str {
        match self {
            Self::Groove => "groove",
            Self::Disco => "disco",
            Self::Robot => "robot",
            Self::Hype => "hype",
            Self::Salsa => "salsa",
        }
    }

    pub(crate) fn manner(self) -> Manner {
        match self {
            Self::Groove => Manner {
                steps: &[
                    Steps::StepTouch,
                    Steps::TwoStep,
                    Steps::Sway,
                    Steps::Bounce,
                    Steps::HeelTap,
                    Steps::Twist,
                    Steps::Lunge,
                    Steps::Walk,
                ],
                arms: &[
                    Arms::Swing,
                    Arms::Snap,
                    Arms::Wave,
                    Arms::CrossOpen,
                    Arms::LowV,
                    Arms::Roll,
                    Arms::ShoulderSky,
                    Arms::PullDown,
                    Arms::Clap,
                ],
                trunks: &[
                    Trunk::Groove,
                    Trunk::Sway,
                    Trunk::BodyRoll,
                    Trunk::HipCircle,
                    Trunk::ChestPop,
                    Trunk::Shoulders,
                    Trunk::Lean,
                ],
                snap: 1.0,
                bounce_m: 0.055,
                nod_rad: 0.16,
            },
            Self::Disco => Manner {
                steps: &[
                    Steps::StepTouch,
                    Steps::Grapevine,
                    Steps::Sway,
                    Steps::Turn,
                    Steps::Lunge,
                    Steps::Kick,
                    Steps::Twist,
                    Steps::Walk,
                ],
                arms: &[
                    Arms::Point,
                    Arms::Roll,
                    Arms::Sweep,
                    Arms::Clap,
                    Arms::HighV,
                    Arms::Lasso,
                    Arms::Hips,
                    Arms::Swing,
                ],
                trunks: &[
                    Trunk::Sway,
                    Trunk::Twist,
                    Trunk::HipSide,
                    Trunk::Groove,
                    Trunk::HipCircle,
                ],
                snap: 1.1,
                bounce_m: 0.045,
                nod_rad: 0.10,
            },
            Self::Robot => Manner {
                steps: &[
                    Steps::Bounce,
                    Steps::March,
                    Steps::Lunge,
                    Steps::Turn,
                    Steps::Sway,
                    Steps::HeelTap,
                    Steps::Squat,
                ],
                arms: &[
                    Arms::Robot,
                    Arms::RobotAhead,
                    Arms::Punch,
                    Arms::CrossOpen,
                    Arms::PullDown,
                ],
                trunks: &[Trunk::Robot, Trunk::ChestPop, Trunk::Twist, Trunk::DownUp],
                snap: 1.35,
                bounce_m: 0.0,
                nod_rad: 0.0,
            },
            Self::Hype => Manner {
                steps: &[
                    Steps::Jack,
                    Steps::March,
                    Steps::Kick,
                    Steps::Charleston,
                    Steps::Squat,
                    Steps::TwoStep,
                    Steps::Bounce,
                    Steps::Lunge,
                ],
                arms: &[
                    Arms::Punch,
                    Arms::RaiseRoof,
                    Arms::HighV,
                    Arms::ClapHigh,
                    Arms::Swing,
                    Arms::Lasso,
                    Arms::PullDown,
                ],
                trunks: &[
                    Trunk::Groove,
                    Trunk::Twist,
                    Trunk::ChestPop,
                    Trunk::DownUp,
                    Trunk::BodyRoll,
                ],
                snap: 1.2,
                bounce_m: 0.075,
                nod_rad: 0.20,
            },
            Self::Salsa => Manner {
                steps: &[
                    Steps::Salsa,
                    Steps::SalsaSide,
                    Steps::Salsa,
                    Steps::Turn,
                    Steps::StepTouch,
                ],
                arms: &[
                    Arms::Salsa,
                    Arms::Swing,
                    Arms::Sweep,
                    Arms::Hips,
                    Arms::CrossOpen,
                ],
                trunks: &[
                    Trunk::HipSide,
                    Trunk::HipSide,
                    Trunk::HipCircle,
                    Trunk::Sway,
                ],
                snap: 1.0,
                bounce_m: 0.02,
                nod_rad: 0.03,
            },
        }
    }
}
