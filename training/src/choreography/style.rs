//! Which figures belong to which style, and how they are danced.

use super::arms::Arms;
use super::legs::Steps;
use super::torso::Trunk;
use servodance_types::named;

/// A way to dance that the choreographer knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DanceStyle {
    /// Relaxed club dancing: side steps, sways, waves.
    Groove,
    /// Arms point and clap, the body turns around.
    Disco,
    /// Sharp stops and right angles.
    Robot,
    /// Jumps, kicks, punches, hands in the air.
    Hype,
    /// Salsa basics with hips and bent arms.
    Salsa,
}

pub(crate) struct StyleParameters {
    /// Exponent of the time share, see [`super::track::minimum_jerk`].
    pub(crate) snap: f64,
    /// Rise of the body between beats, metres.
    pub(crate) bounce_m: f64,
    /// Nod of the head on the beat, radians.
    pub(crate) nod_rad: f64,
}

named!(DanceStyle {
    Groove "groove", Disco "disco", Robot "robot", Hype "hype", Salsa "salsa"
});

impl DanceStyle {
    pub(crate) fn parameters(self) -> StyleParameters {
        let (snap, bounce_m, nod_rad) = match self {
            Self::Groove => (1.0, 0.055, 0.16),
            Self::Disco => (1.1, 0.045, 0.10),
            Self::Robot => (1.35, 0.0, 0.0),
            Self::Hype => (1.2, 0.075, 0.20),
            Self::Salsa => (1.0, 0.02, 0.03),
        };
        StyleParameters { snap, bounce_m, nod_rad }
    }

    /// Step figures to choose from; one named twice is danced more often.
    pub(crate) fn steps(self) -> &'static [Steps] {
        use Steps::*;
        match self {
            Self::Groove => &[StepTouch, TwoStep, Sway, Bounce, HeelTap, Twist, Lunge, Walk],
            Self::Disco => &[StepTouch, Grapevine, Sway, Turn, Lunge, Kick, Twist, Walk],
            Self::Robot => &[Bounce, March, Lunge, Turn, Sway, HeelTap, Squat],
            Self::Hype => &[Jack, March, Kick, Charleston, Squat, TwoStep, Bounce, Lunge],
            Self::Salsa => &[Salsa, SalsaSide, Salsa, Turn, StepTouch],
        }
    }

    pub(crate) fn arms(self) -> &'static [Arms] {
        use Arms::*;
        match self {
            Self::Groove => &[Swing, Snap, Wave, CrossOpen, LowV, Roll, SkyPoint, PullDown, Clap],
            Self::Disco => &[Point, Roll, Sweep, Clap, HighV, Lasso, Hips, Swing],
            Self::Robot => &[Robot, RobotAhead, Punch, CrossOpen, PullDown],
            Self::Hype => &[Punch, RaiseRoof, HighV, ClapHigh, Swing, Lasso, PullDown],
            Self::Salsa => &[Salsa, Swing, Sweep, Hips, CrossOpen],
        }
    }

    pub(crate) fn trunks(self) -> &'static [Trunk] {
        use Trunk::*;
        match self {
            Self::Groove => &[Groove, Sway, BodyRoll, HipCircle, ChestPop, Shoulders, Lean],
            Self::Disco => &[Sway, Twist, HipSide, Groove, HipCircle],
            Self::Robot => &[Robot, ChestPop, Twist, DownUp],
            Self::Hype => &[Groove, Twist, ChestPop, DownUp, BodyRoll],
            Self::Salsa => &[HipSide, HipSide, HipCircle, Sway],
        }
    }
}
