//! What the dancer does, said so that a robot can do it.
//!
//! From 22 points to directions of limbs, orientation of chest and pelvis, the
//! way of the face, and the pelvis over the supporting foot in leg lengths.
//! Vectors are in the robot's world: x forward, y left, z up. Turning on the
//! spot is taken out: slowly for a robot that stands (it shows the quick part),
//! at once for one that is held.

use crate::dancer::{
    BaselineEstimator, BaselinePosture, BodyPoints, PostureSample, chest_yaw, direction,
    pelvis_yaw, soft_limit, turn, wrap,
};
use k::nalgebra::{Rotation3, UnitQuaternion, Vector3};
use servodance_types::BodyJoint::{self, *};

/// Largest turn and leans asked of a chest, radians.
const MOST_TURN: f64 = 0.5;
const MOST_LEAN: f64 = 0.45;
/// Largest nod and turn of the head, radians.
const MOST_NOD: f64 = 0.7;
const MOST_LOOK: f64 = 1.0;
/// A toe this much above the floor, or this fast, is not on it: metres, m/s.
const LIFTED_M: f64 = 0.04;
const STEPPING_M_S: f64 = 0.5;
/// Hip height over the supporting ankle of an upright dancer, leg lengths.
const UPRIGHT: f64 = 0.98;

/// What is asked of the robot in one cycle. Pairs are `[left, right]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PoseTarget {
    pub upper_arm: [Vector3<f64>; 2],
    pub forearm: [Vector3<f64>; 2],
    pub thigh: [Vector3<f64>; 2],
    pub shank: [Vector3<f64>; 2],
    pub face: Vector3<f64>,
    pub chest: UnitQuaternion<f64>,
    pub pelvis: UnitQuaternion<f64>,
    /// Pelvis over the supporting foot against usual (x, y) and upright
    /// (z), in leg lengths.
    pub sway: Vector3<f64>,
    pub feet: [FootTarget; 2],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FootTarget {
    pub up: bool,
    /// Against its usual place before the pelvis: x, y in leg lengths.
    pub place: [f64; 2],
}

impl PoseTarget {
    pub fn standing() -> Self {
        let down = -Vector3::z();
        let arm = |out: f64| Vector3::new(0.02, out, -1.0).normalize();
        Self {
            upper_arm: [arm(0.25), arm(-0.25)],
            forearm: [arm(0.15), arm(-0.15)],
            thigh: [down; 2],
            shank: [down; 2],
            face: Vector3::x(),
            chest: UnitQuaternion::identity(),
            pelvis: UnitQuaternion::identity(),
            sway: Vector3::zeros(),
            feet: [FootTarget::default(); 2],
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HeadingReference {
    /// The robot stands and can turn a little: show quick turns.
    Slow,
    /// The pelvis is fixed, the chest can turn against it.
    Pelvis,
    Chest,
}

/// Reads aims from body points; remembers the dancer's usual posture.
pub(crate) struct PoseReader {
    heading: HeadingReference,
    dt_s: f64,
    averages: BaselineEstimator,
    usual: BaselinePosture,
    last_toes: Option<[Vector3<f64>; 2]>,
    last: PoseTarget,
}

impl PoseReader {
    pub fn new(heading: HeadingReference, dt_s: f64) -> Self {
        Self {
            heading,
            dt_s,
            averages: BaselineEstimator::new(dt_s),
            usual: BaselinePosture::default(),
            last_toes: None,
            last: PoseTarget::standing(),
        }
    }

    /// Forgets what is usual for the dancer.
    pub fn forget(&mut self) {
        self.averages = BaselineEstimator::new(self.dt_s);
    }

    /// The aim for one cycle. Directions that the points do not give (two
    /// points at one place) stay as they were. `led`: the usual posture where
    /// others know it, and how much of the points is theirs, 0 to 1.
    pub fn read(&mut self, points: &BodyPoints, led: Option<(BaselinePosture, f64)>) -> PoseTarget {
        let at = |joint: BodyJoint| points[joint as usize];
        let (chest_yaw, pelvis_yaw) = (chest_yaw(points), pelvis_yaw(points));
        self.averages.observe(points);
        self.usual = match led {
            Some((usual, share)) if share < 1.0 => self.averages.usual.toward(&usual, share),
            Some((usual, _)) => usual,
            None => self.averages.usual,
        };
        let seen = PostureSample::of(points, self.usual.heading);
        let (chest_turn, pelvis_turn) = self.turns(chest_yaw, pelvis_yaw);

        // Arms and head turn with the chest, legs with the pelvis.
        let with_chest = turn(chest_turn - chest_yaw);
        let with_pelvis = turn(pelvis_turn - pelvis_yaw);
        let last = self.last;
        let limb = |turned: &Rotation3<f64>, from, to, before| {
            direction(turned * (at(to) - at(from)), before)
        };
        let torso = direction(turn(-chest_yaw) * (at(Neck) - at(Pelvis)), Vector3::z());
        let lean = [
            soft_limit(torso.x.atan2(torso.z.max(0.05)), MOST_LEAN),
            soft_limit(torso.y.atan2(torso.z.max(0.05)), MOST_LEAN),
        ];
        let aim = PoseTarget {
            upper_arm: [
                limb(&with_chest, LeftShoulder, LeftElbow, last.upper_arm[0]),
                limb(&with_chest, RightShoulder, RightElbow, last.upper_arm[1]),
            ],
            forearm: [
                limb(&with_chest, LeftElbow, LeftWrist, last.forearm[0]),
                limb(&with_chest, RightElbow, RightWrist, last.forearm[1]),
            ],
            thigh: [
                limb(&with_pelvis, LeftHip, LeftKnee, last.thigh[0]),
                limb(&with_pelvis, RightHip, RightKnee, last.thigh[1]),
            ],
            shank: [
                limb(&with_pelvis, LeftKnee, LeftAnkle, last.shank[0]),
                limb(&with_pelvis, RightKnee, RightAnkle, last.shank[1]),
            ],
            face: self.face(&seen, chest_yaw, chest_turn),
            chest: leaning(chest_turn, lean),
            pelvis: leaning(pelvis_turn, lean.map(|angle| angle * 0.5)),
            sway: self.sway(&seen, last.sway),
            feet: self.feet(points, &seen, last.feet),
        };
        self.last = aim;
        aim
    }

    /// Turns of chest and pelvis that the robot shall show.
    fn turns(&self, chest_yaw: f64, pelvis_yaw: f64) -> (f64, f64) {
        let twist = soft_limit(wrap(chest_yaw - pelvis_yaw), MOST_TURN);
        match self.heading {
            HeadingReference::Slow => {
                let quick = soft_turn(pelvis_yaw - self.usual.heading);
                (soft_limit(quick + twist, MOST_TURN), quick)
            }
            HeadingReference::Pelvis => (twist, 0.0),
            HeadingReference::Chest => (0.0, 0.0),
        }
    }

    /// Where the face points: nods against the usual nod; turns and sideways
    /// tilts of the head show as turns.
    fn face(&self, seen: &PostureSample, chest_yaw: f64, chest_turn: f64) -> Vector3<f64> {
        let [nod, tilt] = [0, 1].map(|side| seen.nod[side] - self.usual.nod[side]);
        let nod = soft_limit(nod, MOST_NOD);
        let ahead = 0.6 * soft_turn(chest_yaw - self.usual.heading);
        let look = soft_limit(ahead + tilt, MOST_LOOK);
        turn(chest_turn + look) * Vector3::new(nod.cos(), 0.0, -nod.sin())
    }

    /// The pelvis over the foot that carries, in leg lengths.
    fn sway(&self, seen: &PostureSample, before: Vector3<f64>) -> Vector3<f64> {
        let usual = self.usual.sway;
        seen.legs.map_or(before, |(offset, _)| {
            Vector3::new(offset.x - usual[0], offset.y - usual[1], offset.z - UPRIGHT)
        })
    }

    /// Contacts are read from the motion: labels of frames are too coarse.
    fn feet(
        &mut self,
        points: &BodyPoints,
        seen: &PostureSample,
        before: [FootTarget; 2],
    ) -> [FootTarget; 2] {
        let toes = [LeftFoot, RightFoot].map(|joint| points[joint as usize]);
        let Some((_, places)) = seen.legs else {
            return before;
        };
        let last = self.last_toes.replace(toes).unwrap_or(toes);
        std::array::from_fn(|side| {
            let (place, usual) = (places[side], self.usual.feet[side]);
            let speed = (toes[side] - last[side]).norm() / self.dt_s;
            FootTarget {
                up: toes[side].z - self.usual.floor_z > LIFTED_M || speed > STEPPING_M_S,
                place: [place.x - usual[0], place.y - usual[1]],
            }
        })
    }
}

/// The body seen in a mirror: left and right exchanged.
pub(crate) fn mirrored(points: &BodyPoints) -> BodyPoints {
    let mut out = *points;
    for joint in BodyJoint::ALL {
        let point = points[MIRROR[joint as usize]];
        out[joint as usize] = Vector3::new(point.x, -point.y, point.z);
    }
    out
}

/// Index of each joint's mirror partner (`BodyJoint::mirrored` allocates).
const MIRROR: [usize; 22] =
    [0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20];

/// A turn, softly limited; comes back to zero at half a turn, where left and
/// right meet, so that a spin does not make it jump.
fn soft_turn(angle: f64) -> f64 {
    soft_limit(wrap(angle).sin(), MOST_TURN)
}

/// Turned by `yaw` and leaning forward and to the left by `lean`.
fn leaning(yaw: f64, lean: [f64; 2]) -> UnitQuaternion<f64> {
    let up = Vector3::new(lean[0].tan(), lean[1].tan(), 1.0);
    let lean = UnitQuaternion::rotation_between(&Vector3::z(), &up)
        .unwrap_or_else(UnitQuaternion::identity);
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw) * lean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirror_table_agrees_with_the_body() {
        for joint in BodyJoint::ALL {
            assert_eq!(MIRROR[joint as usize], joint.mirrored() as usize);
        }
    }

    #[test]
    fn one_point_for_all_joints_gives_finite_aims() {
        let mut reader = PoseReader::new(HeadingReference::Slow, 0.01);
        let aim = reader.read(&[Vector3::zeros(); 22], None);
        assert!(aim.upper_arm[0].norm() > 0.99 && aim.sway.norm() == 0.0);
    }
}
