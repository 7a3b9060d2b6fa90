//! Where the pelvis of a planted robot goes.
//!
//! The human's bob, sway, lean and turn, scaled to the robot's legs, softly
//! kept in reach, and followed inside rates that the legs can keep: were the
//! legs to lag behind, the feet would drag.

use crate::dancer::{PoseTarget, soft_limit};
use crate::limits::JointTracker;
use k::nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use servodance_types::JointLimits;

/// Sway that is shown in full, as a share of the leg length: x, y.
const MOST_SWAY: [f64; 2] = [0.10, 0.14];
const MOST_CARRY: f64 = 0.2;
const DEEPEST: f64 = 0.28;
const HIGHEST: f64 = 0.03;
/// Largest lean and turn of the pelvis, radians.
const MOST_TURN: f64 = 0.30;
/// Rates that the legs can keep: leg lengths a second, and so on.
const SWAY_RATE: f64 = 2.0;
const SWAY_ACCELERATION: f64 = 6.0;
const TURN_RATE: f64 = 2.0;
const TURN_ACCELERATION: f64 = 10.0;
/// Time to full acceleration, seconds.
const RISE_S: f64 = 0.05;

pub(crate) struct PelvisTrajectory {
    rest: Isometry3<f64>,
    leg_m: f64,
    dt_s: f64,
    preview_s: f64,
    pace: f64,
    carried: [f64; 6],
    /// x, y, z in leg lengths, then the turn as a scaled axis.
    trackers: [JointTracker; 6],
}

impl PelvisTrajectory {
    /// Standing still at `rest`, the root link's pose.
    /// `pace` scales the accelerations.
    pub fn new(rest: Isometry3<f64>, leg_m: f64, dt_s: f64, preview_s: f64, pace: f64) -> Self {
        let carried = [f64::INFINITY; 6];
        let trackers = trackers(dt_s, preview_s, pace, &carried);
        Self { rest, leg_m, dt_s, preview_s, pace, carried, trackers }
    }

    /// Limits the accelerations: metres per second squared along x, y and z, radians per
    /// second squared about them.
    pub fn carry(&mut self, [x, y, z, roll, pitch, yaw]: [f64; 6]) {
        let leg_m = self.leg_m;
        self.carried = [x / leg_m, y / leg_m, z / leg_m, roll, pitch, yaw];
        self.restart();
    }

    pub fn rest(&self) -> &Isometry3<f64> {
        &self.rest
    }

    pub fn restart(&mut self) {
        self.trackers = trackers(self.dt_s, self.preview_s, self.pace, &self.carried);
    }

    pub fn observe(&mut self, root: &Isometry3<f64>) {
        let shift = (root.translation.vector - self.rest.translation.vector) / self.leg_m;
        let turn = (root.rotation * self.rest.rotation.inverse()).scaled_axis();
        let reached = [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z];
        for (tracker, reached) in self.trackers.iter_mut().zip(reached) {
            tracker.observe(reached);
        }
    }

    /// `wanted` with the pelvis moved by `shift`, metres.
    pub fn shifted(&self, mut wanted: [f64; 6], shift: &Vector3<f64>) -> [f64; 6] {
        for (wanted, shift) in wanted.iter_mut().zip(shift) {
            *wanted += shift / self.leg_m;
        }
        wanted
    }

    /// What the dancer asks for, softly kept in reach; `gain` scales it.
    pub fn wanted(aim: &PoseTarget, gain: f64) -> [f64; 6] {
        let turn = aim.chest.scaled_axis() * gain;
        [
            soft_limit(aim.sway.x * gain, MOST_SWAY[0]),
            soft_limit(aim.sway.y * gain, MOST_SWAY[1]),
            soft_between(aim.sway.z * gain, -DEEPEST, HIGHEST),
            soft_limit(turn.x, MOST_TURN),
            soft_limit(turn.y, MOST_TURN),
            soft_limit(turn.z, MOST_TURN),
        ]
    }

    /// The root link's pose for one cycle, `wanted` being due
    /// when the preview ends.
    pub fn step(&mut self, wanted: &[f64; 6]) -> Isometry3<f64> {
        for (tracker, wanted) in self.trackers.iter_mut().zip(wanted) {
            tracker.step(*wanted);
        }
        let mut reached = [0.0; 6];
        for (reached, tracker) in reached.iter_mut().zip(&self.trackers) {
            *reached = tracker.position();
        }
        self.pose(&reached)
    }

    pub fn work(&self) -> u64 {
        self.trackers.iter().map(JointTracker::work).sum()
    }

    pub fn pose(&self, [x, y, z, roll, pitch, yaw]: &[f64; 6]) -> Isometry3<f64> {
        let shift = Vector3::new(*x, *y, *z) * self.leg_m;
        Isometry3::from_parts(
            Translation3::from(self.rest.translation.vector + shift),
            UnitQuaternion::from_scaled_axis(Vector3::new(*roll, *pitch, *yaw))
                * self.rest.rotation,
        )
    }
}

fn trackers(dt_s: f64, preview_s: f64, pace: f64, carried: &[f64; 6]) -> [JointTracker; 6] {
    let tracker = |axis: usize, [lower, upper]: [f64; 2], velocity: f64, acceleration: f64| {
        let acceleration = (acceleration * pace).min(carried[axis]);
        let limits = JointLimits {
            lower_rad: lower,
            upper_rad: upper,
            velocity_rad_s: velocity,
            acceleration_rad_s2: acceleration,
        };
        JointTracker::new(limits, acceleration / RISE_S, dt_s, 0.0, preview_s)
    };
    let sway = |axis: usize, range: [f64; 2]| tracker(axis, range, SWAY_RATE, SWAY_ACCELERATION);
    let [x, y] = MOST_SWAY.map(|most| most + MOST_CARRY);
    let turn = |axis: usize| tracker(axis, [-MOST_TURN, MOST_TURN], TURN_RATE, TURN_ACCELERATION);
    [sway(0, [-x, x]), sway(1, [-y, y]), sway(2, [-DEEPEST, HIGHEST]), turn(3), turn(4), turn(5)]
}

/// Follows small values, stays between `low < 0` and `high > 0`.
fn soft_between(value: f64, low: f64, high: f64) -> f64 {
    match value < 0.0 {
        true => soft_limit(value, -low),
        false => soft_limit(value, high),
    }
}
