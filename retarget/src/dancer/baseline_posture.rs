//! The dancer's usual posture, which movement is seen against.
//!
//! [`BaselineEstimator`] learns it from what it is shown, over seconds; [`PostureReader`]
//! does so from frames, for others who come later; [`PostureTrack`] are those that
//! somebody sent along with the frames, at any time between two of them.

use std::collections::VecDeque;

use crate::dancer::{BodyPoints, direction, mean_angle, robot_axes, turn, wrap, yaw_of};
use k::nalgebra::Vector3;
use servodance_types::BodyJoint::{self, *};
use servodance_types::{FRAME_RATE_HZ, MotionFrame, Posture};

/// Heading is followed with this time constant; quicker turns are shown.
const HEADING_S: f64 = 1.2;
/// Time constant of what counts as the dancer's usual posture.
const USUAL_S: f64 = 4.0;
/// Time constant with which the floor is believed to rise, seconds.
const FLOOR_S: f64 = 1.0;
/// A foot this much higher than the other one carries 1/e as much.
const LIFT_M: f64 = 0.05;
/// Legs shorter than this are no legs, metres.
const SHORTEST_LEG_M: f64 = 0.05;
const KEPT: usize = 256;

/// See [`Posture`]; robot axes, angles from x towards y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct BaselinePosture {
    pub heading: f64,
    pub nod: [f64; 2],
    pub sway: [f64; 2],
    pub feet: [[f64; 2]; 2],
    pub floor_z: f64,
}

impl BaselinePosture {
    /// A share of the way from here to `other`.
    pub fn toward(&self, other: &Self, share: f64) -> Self {
        let pair = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|i| a[i] + share * (b[i] - a[i]));
        Self {
            heading: self.heading + share * wrap(other.heading - self.heading),
            nod: pair(self.nod, other.nod),
            sway: pair(self.sway, other.sway),
            feet: [0, 1].map(|side| pair(self.feet[side], other.feet[side])),
            floor_z: self.floor_z + share * (other.floor_z - self.floor_z),
        }
    }

    pub fn mirrored(&self) -> Self {
        let mirror = |[ahead, left]: [f64; 2]| [ahead, -left];
        Self {
            heading: -self.heading,
            nod: mirror(self.nod),
            sway: mirror(self.sway),
            feet: [mirror(self.feet[1]), mirror(self.feet[0])],
            floor_z: self.floor_z,
        }
    }

    /// That of the same dancer at another place, facing elsewhere: from where
    /// `from` is to where `to` is.
    pub fn moved(&self, from: &BodyPoints, to: &BodyPoints) -> Self {
        Self { heading: facing(to) - wrap(facing(from) - self.heading), ..*self }
    }
}

impl From<&Posture> for BaselinePosture {
    fn from(posture: &Posture) -> Self {
        let pair = |values: [f32; 2]| values.map(f64::from);
        Self {
            heading: posture.heading_rad.into(),
            nod: pair(posture.nod_rad),
            sway: pair(posture.sway),
            feet: posture.feet.map(pair),
            floor_z: posture.floor_m.into(),
        }
    }
}

impl From<&BaselinePosture> for Posture {
    fn from(usual: &BaselinePosture) -> Self {
        let pair = |values: [f64; 2]| values.map(|value| value as f32);
        Self {
            heading_rad: wrap(usual.heading) as f32,
            nod_rad: pair(usual.nod),
            sway: pair(usual.sway),
            feet: usual.feet.map(pair),
            floor_m: usual.floor_z as f32,
        }
    }
}

/// What a body does at one moment, against a heading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PostureSample {
    /// See [`BaselinePosture::nod`].
    pub nod: [f64; 2],
    /// Hips over the supporting foot and toes before the hips, in leg lengths;
    /// `None` where there are no legs.
    pub legs: Option<(Vector3<f64>, [Vector3<f64>; 2])>,
}

impl PostureSample {
    pub fn of(points: &BodyPoints, heading: f64) -> Self {
        let at = |joint: BodyJoint| points[joint as usize];
        let up = direction(turn(-chest_yaw(points)) * (at(Head) - at(Neck)), Vector3::z());
        let leg = leg_length(points);
        let legs = (leg >= SHORTEST_LEG_M).then(|| {
            let (left, right) = (at(LeftAnkle), at(RightAnkle));
            // Share of the weight on the left foot: a logistic of the height.
            let on_left = 1.0 / (1.0 + ((left.z - right.z) / LIFT_M).clamp(-50.0, 50.0).exp());
            let support = left * on_left + right * (1.0 - on_left);
            let hips = (at(LeftHip) + at(RightHip)) * 0.5;
            let toes = [at(LeftFoot), at(RightFoot)];
            (
                turn(-heading) * (hips - support) / leg,
                toes.map(|toe| turn(-heading) * (toe - hips) / leg),
            )
        });
        Self { nod: [up.x, up.y].map(|side| side.atan2(up.z.max(0.1))), legs }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct BaselineEstimator {
    dt_s: f64,
    started: bool,
    pub usual: BaselinePosture,
}

impl BaselineEstimator {
    /// Of a body that is seen every `dt_s`.
    pub fn new(dt_s: f64) -> Self {
        Self { dt_s, started: false, usual: BaselinePosture::default() }
    }

    pub fn observe(&mut self, points: &BodyPoints) {
        let (heading_share, share) = (self.share(HEADING_S), self.share(USUAL_S));
        let first = !self.started;
        self.started = true;
        let usual = &mut self.usual;
        if first {
            usual.heading = pelvis_yaw(points);
        }
        usual.heading += wrap(facing(points) - usual.heading) * heading_share;
        let seen = PostureSample::of(points, usual.heading);
        let learn = |usual: &mut [f64; 2], now: [f64; 2]| {
            let share = if first { 1.0 } else { share };
            for (usual, now) in usual.iter_mut().zip(now) {
                *usual += (now - *usual) * share;
            }
        };
        learn(&mut usual.nod, seen.nod);
        let Some((sway, feet)) = seen.legs else {
            return;
        };
        learn(&mut usual.sway, [sway.x, sway.y]);
        for (usual, foot) in usual.feet.iter_mut().zip(feet) {
            learn(usual, [foot.x, foot.y]);
        }
        let lowest = points[LeftFoot as usize].z.min(points[RightFoot as usize].z);
        let floor_share = if first { 1.0 } else { self.dt_s / (self.dt_s + FLOOR_S) };
        usual.floor_z = lowest.min(usual.floor_z + (lowest - usual.floor_z) * floor_share);
    }

    fn share(&self, time_constant_s: f64) -> f64 {
        self.dt_s / (self.dt_s + time_constant_s)
    }
}

/// Reads the usual posture from the frames of one dance, one after the other.
#[derive(Clone, Debug)]
pub struct PostureReader(BaselineEstimator);

impl Default for PostureReader {
    fn default() -> Self {
        Self(BaselineEstimator::new(1.0 / FRAME_RATE_HZ))
    }
}

impl PostureReader {
    /// The posture that is usual with this frame; one that is not
    /// finite is left out.
    pub fn read(&mut self, frame: &MotionFrame) -> Posture {
        if frame.is_finite() {
            self.0.observe(&robot_axes(frame));
        }
        Posture::from(&self.0.usual)
    }
}

#[derive(Debug)]
pub(crate) struct PostureTrack {
    known: VecDeque<(i64, BaselinePosture)>,
}

impl PostureTrack {
    pub fn new() -> Self {
        Self { known: VecDeque::with_capacity(KEPT) }
    }

    /// Takes in the posture of a frame; one that is not newer begins anew.
    pub fn push(&mut self, time_s: f64, posture: &Posture) {
        let place = (time_s * FRAME_RATE_HZ).round() as i64;
        if self.known.back().is_some_and(|(last, _)| *last >= place) {
            self.known.clear();
        }
        if self.known.len() == KEPT {
            self.known.pop_front();
        }
        self.known.push_back((place, BaselinePosture::from(posture)));
    }

    /// The posture at a time: between two, or the nearest; `None` if none came.
    pub fn at(&self, time_s: f64) -> Option<BaselinePosture> {
        let place = time_s * FRAME_RATE_HZ;
        let after = self.known.partition_point(|(at, _)| (*at as f64) <= place);
        let later = self.known.get(after);
        let Some((from, before)) = after.checked_sub(1).and_then(|i| self.known.get(i)) else {
            return later.map(|(_, usual)| *usual);
        };
        Some(later.map_or(*before, |(to, usual)| {
            before.toward(usual, (place - *from as f64) / (to - from) as f64)
        }))
    }
}

fn leg_length(points: &BodyPoints) -> f64 {
    let at = |joint: BodyJoint| points[joint as usize];
    let length = |hip, knee, ankle| (at(hip) - at(knee)).norm() + (at(knee) - at(ankle)).norm();
    f64::midpoint(length(LeftHip, LeftKnee, LeftAnkle), length(RightHip, RightKnee, RightAnkle))
}

pub(crate) fn chest_yaw(points: &BodyPoints) -> f64 {
    yaw_of(points[LeftShoulder as usize] - points[RightShoulder as usize])
}

pub(crate) fn pelvis_yaw(points: &BodyPoints) -> f64 {
    yaw_of(points[LeftHip as usize] - points[RightHip as usize])
}

fn facing(points: &BodyPoints) -> f64 {
    mean_angle(chest_yaw(points), pelvis_yaw(points))
}
