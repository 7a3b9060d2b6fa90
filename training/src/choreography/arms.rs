//! Arm figures: where both arms are on every count.
//!
//! The figures are in `arms.toml`. An arm is two directions in the chest's frame, upper arm
//! and forearm; x points outwards, y up, z ahead, the same for both sides.

use serde::Deserialize;
use servodance_model::motion::vec3::{Vec3, add, lerp, unit_or};
use std::collections::HashMap;
use std::sync::LazyLock;

pub(crate) type ArmDirections = [Vec3; 2];

const REST: ArmDirections = [[0.20, -0.97, 0.02], [0.12, -0.93, 0.32]];
const READY: ArmDirections = [[0.40, -0.90, -0.12], [-0.10, 0.25, 0.95]];

/// The arm figures; `arms.toml` says what each one is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
pub(crate) enum Arms {
    Swing,
    LowV,
    HighV,
    Clap,
    ClapHigh,
    Punch,
    RaiseRoof,
    Point,
    Wave,
    Roll,
    CrossOpen,
    Sweep,
    Lasso,
    Snap,
    Robot,
    RobotAhead,
    Salsa,
    Hips,
    SkyPoint,
    PullDown,
}

#[derive(Deserialize)]
struct ArmTables {
    poses: HashMap<String, ArmDirections>,
    between: HashMap<String, (String, String, f64)>,
    figures: HashMap<Arms, Vec<[String; 2]>>,
}

static TABLES: LazyLock<ArmTables> = LazyLock::new(|| {
    let tables = toml::from_str(include_str!("arms.toml"));
    tables.unwrap_or_else(|error| panic!("arms.toml: {error}"))
});

impl ArmTables {
    fn pose(&self, name: &str) -> ArmDirections {
        match self.between.get(name) {
            Some((from, to, share)) => blend(self.poses[from], self.poses[to], *share),
            None => self.poses[name],
        }
    }
}

impl Arms {
    /// Left and right arm on `count`.
    pub(crate) fn arms(self, count: usize) -> [ArmDirections; 2] {
        let figure = &TABLES.figures[&self];
        figure[count % figure.len()].each_ref().map(|name| TABLES.pose(name))
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
