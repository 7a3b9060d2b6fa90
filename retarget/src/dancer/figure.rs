//! What a body that is not like a human's shows of the dancer.
//!
//! An arm on its base is the whole dancer: it leans where the body sways, turns where it
//! turns, sinks into its elbow where knees bend, and lifts its end where hands go up. A
//! body on four legs moves its trunk over them, a base on wheels turns on the spot. Radians; lengths in leg lengths.

use crate::dancer::{PoseTarget, soft_limit, turn};
use k::nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// How far an arm leans back at rest, and its lower part points up, radians.
const ARM_BACK: f64 = 0.25;
const ARM_UP: f64 = -0.15;
/// The turn from the upper part of an arm to its lower one at rest, and what it needs beyond
/// to dance, radians.
const REST_BEND: f64 = FRAC_PI_2 + ARM_BACK - ARM_UP;
const BEND_ROOM: f64 = 0.3;
/// Radians of an arm's lean for a leg length of sway, for a leg length of bob, and of its
/// end's height for hands that go from hanging to raised.
const LEAN_PER_SWAY: f64 = 2.5;
const BEND_PER_BOB: f64 = 3.0;
const LIFT_PER_HANDS: f64 = 1.1;
/// Largest of each.
const MOST_LEAN: f64 = 0.45;
const MOST_BEND: f64 = 0.6;
const MOST_ARM_TURN: f64 = 0.8;
/// How far the trunk on four legs goes, leg lengths, and turns, radians.
const MOST_SHIFT: f64 = 0.12;
const DEEPEST: f64 = 0.14;
const MOST_ROLL: f64 = 0.2;
const MOST_BOW: f64 = 0.22;
const MOST_TRUNK_TURN: f64 = 0.2;
/// How far a base on wheels turns, radians.
pub(crate) const MOST_BASE_TURN: f64 = 0.6;
/// How far raised hands lift the front, radians.
const BOW_PER_HANDS: f64 = 0.15;

/// Rods' lengths of a plate's shift for a leg length of sway; the most of it, and of its tilt,
/// nod and look: what six rods can reach together.
const PLATE_PER_SWAY: f64 = 1.5;
const MOST_PLATE_SHIFT: f64 = 0.15;
const MOST_PLATE_TILT: f64 = 0.2;
const MOST_PLATE_NOD: f64 = 0.3;
const MOST_PLATE_LOOK: f64 = 0.45;

/// An antenna's angle from upright for an arm's.
const SPREAD: f64 = 0.45;

/// How high the hands are, -1 hanging to 1 raised: left, right.
fn hands(aim: &PoseTarget) -> [f64; 2] {
    [0, 1].map(|side| 0.5 * (aim.upper_arm[side].z + aim.forearm[side].z))
}

/// How a lone arm can show a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ArmMount {
    /// It hangs from its base and cannot rise: the figure stands on its head.
    pub upside_down: bool,
    /// The largest turn from its upper part to its lower one, radians.
    pub most_bend_rad: f64,
}

impl Default for ArmMount {
    fn default() -> Self {
        Self { upside_down: false, most_bend_rad: PI }
    }
}

/// The pose of a lone arm (as the left one) and of what it carries as a face.
pub(crate) fn arm_figure(aim: &PoseTarget, mount: &ArmMount) -> PoseTarget {
    let [left, right] = hands(aim);
    let raised = 0.5 * (left + right + 2.0); // 0 hanging, 2 raised
    let body = aim.chest.scaled_axis();
    let bend = soft_limit(-aim.sway.z * BEND_PER_BOB, MOST_BEND);
    let ahead = soft_limit(aim.sway.x * LEAN_PER_SWAY + body.y, MOST_LEAN) - ARM_BACK - 0.5 * bend;
    let aside = soft_limit(aim.sway.y * LEAN_PER_SWAY - body.x, MOST_LEAN);
    let yaw = soft_limit(body.z + 0.5 * aside + 0.4 * (left - right), MOST_ARM_TURN);
    let straighter = (REST_BEND + BEND_ROOM - mount.most_bend_rad).max(0.0);
    let up = ARM_UP + straighter + LIFT_PER_HANDS * 0.5 * raised - bend;
    let upper = Vector3::new(ahead.sin(), aside.sin(), ahead.cos() * aside.cos());
    let lower = Vector3::new(up.cos(), 0.5 * aside.sin(), up.sin());
    let turned = turn(yaw);
    let height = if mount.upside_down { -1.0 } else { 1.0 };
    let mounted = |part: Vector3<f64>| {
        turned * part.component_mul(&Vector3::new(1.0, 1.0, height)).normalize()
    };
    PoseTarget { upper_arm: [mounted(upper); 2], forearm: [mounted(lower); 2], ..*aim }
}

/// Antennas stand up where the dancer's arms are raised, and spread outward where they hang.
pub(crate) fn antenna_figure(aim: &PoseTarget) -> PoseTarget {
    let raised = hands(aim);
    let outward = [Vector3::y(), -Vector3::y()];
    let antenna = |side: usize| {
        let from_up = SPREAD * raised[side].clamp(-1.0, 1.0).acos();
        Vector3::z() * from_up.cos() + outward[side] * from_up.sin()
    };
    PoseTarget { upper_arm: [antenna(0), antenna(1)], ..*aim }
}

/// What a head on a platform does: its turn, and its shift in lengths of a rod. Besides
/// looking where the dancer looks it tilts and bobs with the body.
pub(crate) fn plate_figure(aim: &PoseTarget) -> (UnitQuaternion<f64>, Vector3<f64>) {
    let face = aim.face;
    let nod = soft_limit((-face.z).atan2(face.x.hypot(face.y)), MOST_PLATE_NOD);
    let look = soft_limit(face.y.atan2(face.x), MOST_PLATE_LOOK);
    let tilt = soft_limit(aim.chest.scaled_axis().x, MOST_PLATE_TILT);
    let turn = UnitQuaternion::from_euler_angles(tilt, nod, look);
    let shift = aim.sway.map(|part| soft_limit(part * PLATE_PER_SWAY, MOST_PLATE_SHIFT));
    (turn, shift)
}

/// How far a base on wheels turns on the spot, radians.
pub(crate) fn base_figure(aim: &PoseTarget) -> f64 {
    soft_limit(aim.chest.scaled_axis().z, MOST_BASE_TURN)
}

/// Where the trunk of a body on four legs is, seen from its place at rest: x, y, z in leg
/// lengths, then the turn as a scaled axis. `gain` scales it.
pub(crate) fn trunk_figure(aim: &PoseTarget, gain: f64) -> [f64; 6] {
    let [left, right] = hands(aim);
    let body = aim.chest.scaled_axis() * gain;
    let lift = BOW_PER_HANDS * (left + right + 2.0) * 0.5 * gain;
    let sway = aim.sway * gain;
    [
        soft_limit(sway.x, MOST_SHIFT),
        soft_limit(sway.y, MOST_SHIFT),
        soft_limit(sway.z.min(0.0), DEEPEST),
        soft_limit(body.x, MOST_ROLL),
        soft_limit(body.y - lift, MOST_BOW),
        soft_limit(body.z, MOST_TRUNK_TURN),
    ]
}
