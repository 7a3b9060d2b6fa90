//! The dancer's usual posture, which movement is seen against.
//!
//! [`BaselineEstimator`] learns it from what it is shown, over seconds; [`PostureReader`]
//! does so from frames, for others who come later; [`PostureTrack`] are those that
//! somebody sent along with the frames, at any time between two of them. Of a motion that is
//! known beforehand: `surrounding_posture`.

use std::collections::VecDeque;

use crate::dancer::{BodyPoints, direction, mean_angle, robot_axes, turn, wrap, yaw_of};
use k::nalgebra::Vector3;
use servodance_types::BodyJoint::{self, *};
use servodance_types::{FRAME_RATE_HZ, MotionFrame, Posture};

/// The heading is the mean over so many seconds; quicker turns are shown.
const HEADING_S: f64 = 1.2;
/// What counts as the dancer's usual posture is the mean over these. Both leave joints the time
/// to arrive within two seconds, after which a dance agrees wherever in the motion it began.
const USUAL_S: f64 = 1.5;
/// Time constant with which the floor is believed to rise, seconds.
const FLOOR_S: f64 = 1.0;
/// A foot this much higher than the other one carries 1/e as much.
const LIFT_M: f64 = 0.05;
/// Legs shorter than this are no legs, metres.
const SHORTEST_LEG_M: f64 = 0.05;
const KEPT: usize = 256;
/// What most dancers' posture is, from captured and generated dances, and for how many seconds
/// that counts before the dancer has been seen.
const COMMON: BaselinePosture = BaselinePosture {
    heading: 0.0,
    nod: [0.2, 0.0],
    sway: [0.045, 0.0],
    feet: [[0.06, 0.17], [0.06, -0.17]],
    floor_z: 0.0,
};
const COMMON_S: f64 = 0.5;
/// Numbers of a posture beside heading and floor.
pub(super) const POSTURE: usize = 8;

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

    /// Nod, sway and feet in a row.
    pub(super) fn flat(&self) -> [f64; POSTURE] {
        let Self { nod, sway, feet: [left, right], .. } = self;
        [nod[0], nod[1], sway[0], sway[1], left[0], left[1], right[0], right[1]]
    }

    pub(super) fn set(&mut self, flat: [f64; POSTURE]) {
        let pair = |at: usize| [flat[at], flat[at + 1]];
        (self.nod, self.sway, self.feet) = (pair(0), pair(2), [pair(4), pair(6)]);
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

/// Learns the usual posture of a body: the mean of what was seen over the last seconds, so
/// that whoever begins to look in the middle of a dance soon agrees with whoever saw it all.
#[derive(Clone, Debug)]
pub(crate) struct BaselineEstimator {
    headings: RecentMean<1>,
    postures: RecentMean<POSTURE>,
    /// Where the body faces, counted on through whole turns.
    facing: Option<f64>,
    floor_share: f64,
    pub usual: BaselinePosture,
}

impl BaselineEstimator {
    /// Of a body that is seen every `dt_s`.
    pub fn new(dt_s: f64) -> Self {
        Self {
            headings: RecentMean::new(HEADING_S / dt_s, 0.0),
            postures: RecentMean::new(USUAL_S / dt_s, COMMON_S / dt_s),
            facing: None,
            floor_share: dt_s / (dt_s + FLOOR_S),
            usual: COMMON,
        }
    }

    pub fn observe(&mut self, points: &BodyPoints) {
        let now = facing(points);
        let counted = self.facing.map_or(now, |before| before + wrap(now - before));
        let floor_share = if self.facing.is_none() { 1.0 } else { self.floor_share };
        self.facing = Some(counted);
        let usual = &mut self.usual;
        [usual.heading] = self.headings.with([counted], [0.0]);
        // Seen from where the body faces now: from its usual heading one mean would wait for
        // the other.
        let seen = PostureSample::of(points, now);
        let Some((sway, [left, right])) = seen.legs else {
            // Without legs they stay as they were.
            let mut seen_alone = usual.flat();
            seen_alone[..2].copy_from_slice(&seen.nod);
            usual.set(self.postures.with(seen_alone, COMMON.flat()));
            return;
        };
        let seen = [seen.nod[0], seen.nod[1], sway.x, sway.y, left.x, left.y, right.x, right.y];
        usual.set(self.postures.with(seen, COMMON.flat()));
        let lowest = points[LeftFoot as usize].z.min(points[RightFoot as usize].z);
        usual.floor_z = lowest.min(usual.floor_z + (lowest - usual.floor_z) * floor_share);
    }
}

/// The mean of the last values, and of others that count as seen until enough have come.
#[derive(Clone, Debug)]
struct RecentMean<const N: usize> {
    values: VecDeque<[f64; N]>,
    most: usize,
    sum: [f64; N],
    /// For how many values the others count at first.
    others: f64,
}

impl<const N: usize> RecentMean<N> {
    fn new(most: f64, others: f64) -> Self {
        let most = (most.round() as usize).max(1);
        Self { values: VecDeque::with_capacity(most + 1), most, sum: [0.0; N], others }
    }

    /// Takes in a value; the mean with it.
    fn with(&mut self, value: [f64; N], others: [f64; N]) -> [f64; N] {
        self.values.push_back(value);
        let gone = match self.values.len() > self.most {
            true => self.values.pop_front().unwrap_or([0.0; N]),
            false => [0.0; N],
        };
        let count = self.values.len() as f64;
        let weight = self.others * (1.0 - count / self.most as f64);
        std::array::from_fn(|at| {
            self.sum[at] += value[at] - gone[at];
            (self.sum[at] + weight * others[at]) / (count + weight)
        })
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

pub(super) fn facing(points: &BodyPoints) -> f64 {
    mean_angle(chest_yaw(points), pelvis_yaw(points))
}
