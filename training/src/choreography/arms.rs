//! Arm figures: where both arms are on every count.
//!
//! An arm is two directions in the chest's frame, upper arm and forearm; x
//! points outwards, y up, z ahead, the same for both sides.

use servodance_model::motion::vec3::{Vec3, add, lerp, unit_or};

pub(crate) type ArmDirections = [Vec3; 2];

const REST: ArmDirections = [[0.20, -0.97, 0.02], [0.12, -0.93, 0.32]];
const READY: ArmDirections = [[0.40, -0.90, -0.12], [-0.10, 0.25, 0.95]];
const FRONT_SWING: ArmDirections = [[0.15, -0.75, 0.62], [-0.25, 0.30, 0.92]];
const BACK_SWING: ArmDirections = [[0.35, -0.75, -0.55], [0.10, -0.45, 0.88]];
const OUT: ArmDirections = [[0.95, -0.02, 0.22], [0.96, 0.05, 0.25]];
const LOW_V: ArmDirections = [[0.70, -0.70, 0.12], [0.72, -0.62, 0.25]];
const HIGH_V: ArmDirections = [[0.62, 0.74, 0.20], [0.45, 0.88, 0.12]];
const UP: ArmDirections = [[0.25, 0.94, 0.20], [0.08, 0.99, 0.05]];
const CACTUS: ArmDirections = [[0.92, -0.02, 0.30], [0.22, 0.95, 0.18]];
const HANGING: ArmDirections = [[0.93, 0.05, 0.25], [0.10, -0.98, 0.12]];
const AHEAD: ArmDirections = [[0.22, -0.15, 0.96], [0.02, 0.05, 0.99]];
const BENT_AHEAD: ArmDirections = [[0.25, -0.90, 0.30], [0.02, 0.10, 0.99]];
const PUNCH: ArmDirections = [[0.02, -0.08, 0.99], [-0.22, 0.06, 0.97]];
const GUARD: ArmDirections = [[0.35, -0.75, 0.45], [-0.25, 0.90, 0.35]];
const CROSSED: ArmDirections = [[0.10, -0.55, 0.82], [-0.88, 0.28, 0.38]];
const CLAP: ArmDirections = [[0.18, -0.62, 0.76], [-0.66, 0.35, 0.66]];
const CLAP_HIGH: ArmDirections = [[0.35, 0.86, 0.36], [-0.72, 0.66, 0.20]];
const HIP: ArmDirections = [[0.78, -0.58, -0.22], [-0.62, -0.62, 0.45]];
const POINT_UP: ArmDirections = [[0.72, 0.62, 0.30], [0.68, 0.70, 0.18]];
const POINT_DOWN: ArmDirections = [[0.02, -0.72, 0.70], [-0.72, -0.55, 0.42]];
const ELBOW_UP: ArmDirections = [[0.90, 0.35, 0.25], [0.70, -0.62, 0.35]];
const HAND_UP: ArmDirections = [[0.90, -0.25, 0.30], [0.72, 0.62, 0.28]];
const SHOULDER: ArmDirections = [[0.75, -0.25, 0.60], [-0.45, 0.85, 0.05]];
const SWEEP_ACROSS: ArmDirections = [[-0.10, 0.35, 0.93], [-0.75, 0.55, 0.35]];
const ROLL_HIGH: ArmDirections = [[0.32, -0.62, 0.72], [-0.92, 0.22, 0.30]];
const ROLL_LOW: ArmDirections = [[0.30, -0.80, 0.50], [-0.86, -0.12, 0.50]];
const OVERHEAD: ArmDirections = [[0.55, 0.80, 0.20], [-0.45, 0.85, 0.30]];
const OVERHEAD_OUT: ArmDirections = [[0.75, 0.62, 0.10], [0.60, 0.75, -0.20]];
const SNAP: ArmDirections = [[0.60, -0.62, 0.40], [0.35, 0.80, 0.50]];

/// The arm figures. Numbers in brackets: counts until they repeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arms {
    Swing,      // bent arms swing against each other (2)
    LowV,       // straight arms out to the low V and in (2)
    HighV,      // low V, high V (2)
    Clap,       // clap on every second count (2)
    ClapHigh,   // clap over the head on every second count (2)
    Punch,      // punches in turn (2)
    RaiseRoof,  // palms push the ceiling (2)
    Point,      // point up and out, point down and across; then the other arm (8)
    Wave,       // a wave through both arms and back (4)
    Roll,       // forearms roll about each other (2)
    CrossOpen,  // crossed before the chest, open (2)
    Sweep,      // both hands sweep from high left to high right (4)
    Lasso,      // one hand circles over the head (4)
    Snap,       // fingers snap at the sides in turn (2)
    Robot,      // right angles, one arm up, one hanging (4)
    RobotAhead, // forearms ahead, turned out, up, down (4)
    Salsa,      // bent arms of a couple dancer, in turn (2)
    Hips,       // hands on the hips (2)
    SkyPoint,   // hand to the shoulder, hand to the sky, in turn (4)
    PullDown,   // arms out, elbows pulled down (2)
}

impl Arms {
    /// Left and right arm on `count`.
    pub(crate) fn arms(self, count: usize) -> [ArmDirections; 2] {
        let even = count.is_multiple_of(2);
        let turns = |a: ArmDirections, b: ArmDirections| if even { [a, b] } else { [b, a] };
        let both = |a: ArmDirections, b: ArmDirections| if even { [a; 2] } else { [b; 2] };
        match self {
            Self::Swing => turns(FRONT_SWING, BACK_SWING),
            Self::LowV => both(LOW_V, READY),
            Self::HighV => both(LOW_V, HIGH_V),
            Self::Clap => both(blend(READY, OUT, 0.45), CLAP),
            Self::ClapHigh => both(CACTUS, CLAP_HIGH),
            Self::Punch => turns(PUNCH, GUARD),
            Self::RaiseRoof => both(UP, blend(CACTUS, GUARD, 0.35)),
            Self::Point => {
                let right_leads = count % 8 < 4;
                let arm = if even { POINT_UP } else { POINT_DOWN };
                if right_leads { [HIP, arm] } else { [arm, HIP] }
            }
            Self::Wave => {
                [[ELBOW_UP, LOW_V], [HAND_UP, ELBOW_UP], [LOW_V, HAND_UP], [HAND_UP, ELBOW_UP]]
                    [count % 4]
            }
            Self::Roll => turns(ROLL_HIGH, ROLL_LOW),
            Self::CrossOpen => both(CROSSED, blend(OUT, LOW_V, 0.3)),
            Self::Sweep => [
                [OUT, SWEEP_ACROSS],
                [HIGH_V, blend(UP, SWEEP_ACROSS, 0.3)],
                [SWEEP_ACROSS, OUT],
                [blend(UP, SWEEP_ACROSS, 0.3), HIGH_V],
            ][count % 4],
            Self::Lasso => [
                [READY, OVERHEAD],
                [BENT_AHEAD, OVERHEAD_OUT],
                [READY, blend(OVERHEAD, UP, 0.6)],
                [BENT_AHEAD, OVERHEAD_OUT],
            ][count % 4],
            Self::Snap => turns(SNAP, blend(READY, REST, 0.3)),
            Self::Robot => {
                [[CACTUS, HANGING], [HANGING, CACTUS], [BENT_AHEAD, BENT_AHEAD], [AHEAD, HANGING]]
                    [count % 4]
            }
            Self::RobotAhead => [
                [BENT_AHEAD, REST],
                [BENT_AHEAD, BENT_AHEAD],
                [CACTUS, CACTUS],
                [AHEAD, BENT_AHEAD],
            ][count % 4],
            Self::Salsa => turns(FRONT_SWING, blend(READY, BACK_SWING, 0.5)),
            Self::Hips => both(HIP, blend(HIP, READY, 0.2)),
            Self::SkyPoint => {
                [[SHOULDER, REST], [UP, REST], [REST, SHOULDER], [REST, UP]][count % 4]
            }
            Self::PullDown => both(HIGH_V, blend(GUARD, HIP, 0.35)),
        }
    }
}

pub(crate) fn resting(sway: f64) -> [ArmDirections; 2] {
    [blend(REST, READY, 0.10 + 0.06 * sway), blend(REST, READY, 0.10 - 0.06 * sway)]
}

/// Between two arms, by direction. The path bends ahead, so that an arm that
/// crosses over does not go through the body.
pub(crate) fn blend(a: ArmDirections, b: ArmDirections, t: f64) -> ArmDirections {
    std::array::from_fn(|i| {
        let way = 1.0 - a[i].iter().zip(&b[i]).map(|(a, b)| a * b).sum::<f64>();
        let ahead = 0.22 * way * (1.0 - (2.0 * t - 1.0).powi(2));
        let outwards = 0.5 * ahead;
        unit_or(add(lerp(a[i], b[i], t), [outwards, 0.0, ahead]), [0.0, -1.0, 0.0])
    })
}

/// `arm` drawn towards rest (`size` below 1) or away from it.
pub(crate) fn sized(arm: ArmDirections, size: f64) -> ArmDirections {
    if size >= 1.0 { arm } else { blend(READY, arm, size) }
}
