//! Correction of the legs by what a sensor on the pelvis says: ankle and hip strategy.
//!
//! The pelvis's lean and rate are compared with those that the commands of some
//! hundredths of a second ago imply (feet flat on the floor). Ankles damp the rate,
//! hips turn the trunk back. Gains follow from mass, height and the stiffness of the
//! ankles' servos; what goes out keeps every joint limit.

use std::collections::VecDeque;

use k::nalgebra::{UnitQuaternion, Vector3};
use servodance_types::{ImuState, JointLimits, JointState};

use super::fall_detector::FallDetector;
use super::foot_load::FootLoad;
use super::leg_servo::LegServo;
use super::servo_give::ServoGive;
use crate::dynamics::GRAVITY_M_S2;
use crate::limits::JointTracker;
use crate::retargeter::{LegJoint, Retargeter};

/// Age of the commands that a reading answers to: servo lag and the sensor's delay.
const ANSWERED_S: f64 = 0.07;
/// Leans smaller than this are the servos' own give: not turned back.
const DEAD_BAND_RAD: f64 = 0.035;
/// From this lean on all of its rate is damped. A heavy robot on stiff ankles swings at the
/// pace of a beat (g1 at 1.9 Hz), and arms that keep that beat rock it off its soles if small
/// leans are left undamped; below, a sensor's noise would shake a robot that stands still.
const DAMPED_RAD: f64 = 0.005;
/// Largest correction of a joint, radians, and its time constant, seconds.
const MOST_RAD: f64 = 0.28;
const SMOOTH_S: f64 = 0.015;
/// Share of the lean that each strategy takes back.
const HIP_SHARE: [f64; 2] = [0.56, 0.29];
const ANKLE_SHARE: [f64; 2] = [0.31, 0.0];
/// Time in which the ankles take back a lean forward or back that stays, seconds, and the
/// most they take, radians: a floor that slopes.
const TRIM_S: f64 = 2.0;
const MOST_TRIM_RAD: f64 = 0.07;
/// Damping ratio that ankles and feedback have together.
const DAMPING_RATIO: f64 = 0.7;
/// No more damping than this, seconds: a sensor that is 20 ms late makes legs of stiff servos
/// shake with more (lite22 with 0.06, at 8 Hz).
const MOST_DAMPING_S: f64 = 0.04;
/// A joint belongs to roll or pitch when its axis is nearer to it than this cosine.
const ALONG: f64 = 0.7;
/// Time to full acceleration of a correction, seconds.
const RISE_S: f64 = 0.02;
/// A robot is steady while it leans and turns by less than this beyond the plan.
const STEADY_RAD: f64 = 0.05;
const STEADY_RAD_S: f64 = 0.6;
/// An old reading is not acted on, seconds.
const OLD_S: f64 = 0.1;

/// A leg's joint that turns the body about x (roll) or y (pitch).
#[derive(Clone, Copy, Debug)]
struct LeanJoint {
    joint: usize,
    /// 0 roll, 1 pitch.
    axis: usize,
    /// Command that leans the body by +1 with the foot on the floor.
    sign: f64,
    is_ankle: bool,
}

/// What keeps one robot on its feet.
pub struct BalanceFeedback {
    joints: Vec<LeanJoint>,
    give: ServoGive,
    load: FootLoad,
    fall: FallDetector,
    is_falling: bool,
    is_steady: bool,
    upright: UnitQuaternion<f64>,
    trackers: Vec<(usize, JointTracker)>,
    dt_s: f64,
    /// Planned lean about x and y, newest last.
    planned: VecDeque<[f64; 2]>,
    /// Seconds by which the ankles answer the rate, by axis.
    damping_s: [f64; 2],
    correction: [[f64; 2]; 2],
    trim_rad: f64,
    age_s: f64,
    limits: Vec<JointLimits>,
    settled: bool,
}

impl BalanceFeedback {
    /// `None` for a robot that does not stand. `servos` by joint.
    pub fn new(robot: &Retargeter, servos: &[LegServo], limits: &[JointLimits]) -> Option<Self> {
        let legs = robot.standing_legs()?;
        let mut joints = Vec::new();
        let poses = robot.rest_poses();
        let mut used = Vec::new();
        for path in legs {
            used.extend(path.iter().map(|leg| leg.joint));
            let mut leans: Vec<LeanJoint> = Vec::new();
            for LegJoint { link, joint, axis } in path {
                let axis = poses[link].rotation * axis;
                for (index, along) in [axis.x, axis.y].into_iter().enumerate() {
                    if along.abs() > ALONG {
                        let sign = -along.signum();
                        leans.push(LeanJoint { joint, axis: index, sign, is_ankle: false });
                    }
                }
            }
            // Nearest to the hip and nearest to the floor, about each axis.
            for axis in 0..2 {
                let mut own = leans.iter().filter(|lean| lean.axis == axis);
                let hip = own.next().copied();
                let ankle = own.next_back().copied();
                joints.extend(hip);
                joints.extend(ankle.map(|ankle| LeanJoint { is_ankle: true, ..ankle }));
            }
        }
        let (mass_kg, height_m) = robot.mass_and_height();
        let damping_s = [0, 1].map(|axis| {
            let ankles = joints.iter().filter(|lean| lean.is_ankle && lean.axis == axis);
            let servos = ankles.filter_map(|lean| servos.get(lean.joint));
            let (stiffness, damping) = servos.fold((0.0, 0.0), |(kp, kd), servo| {
                (kp + servo.kp_nm_rad, kd + servo.damping_nm_s)
            });
            ankle_damping_s(mass_kg, height_m, stiffness, damping)
        });
        let dt_s = robot.period_s();
        used.sort_unstable();
        used.dedup();
        let rest = robot.rest();
        let tracker = |joint: usize| {
            let limits = limits[joint];
            let jerk = limits.acceleration_rad_s2 / RISE_S;
            (joint, JointTracker::new(limits, jerk, dt_s, rest[joint], 0.1))
        };
        Some(Self {
            fall: FallDetector::new(height_m, dt_s),
            is_falling: false,
            is_steady: true,
            give: ServoGive::new(&used, servos, dt_s),
            load: FootLoad::new(&used, servos, dt_s),
            trackers: used.into_iter().map(tracker).collect(),
            limits: limits.to_vec(),
            upright: robot.upright(),
            planned: VecDeque::with_capacity((ANSWERED_S / dt_s) as usize + 2),
            correction: [[0.0; 2]; 2],
            trim_rad: 0.0,
            age_s: f64::INFINITY,
            joints,
            dt_s,
            damping_s,
            settled: false,
        })
    }

    /// Corrects the commands of one cycle of `robot` in place; `reading` is the sensor's, if
    /// it answered. Without any the legs still go ahead of what their servos will give.
    pub fn correct(
        &mut self,
        robot: &Retargeter,
        reading: Option<&ImuState>,
        commands_rad: &mut [f64],
    ) {
        let kept = (ANSWERED_S / self.dt_s).round() as usize;
        if self.planned.len() > kept {
            self.planned.pop_front();
        }
        self.planned.push_back(self.lean(robot.root_placement(commands_rad).rotation[2]));
        self.age_s = if reading.is_some() { 0.0 } else { self.age_s + self.dt_s };
        let wanted = match reading {
            Some(reading) => {
                let (lean, rate) = self.beyond_plan(reading);
                let outside = |shift| robot.outside_soles_m(shift);
                self.is_falling = !self.load.is_lifted() && self.fall.observe(lean, rate, outside);
                self.is_steady =
                    lean[0].hypot(lean[1]) < STEADY_RAD && rate[0].hypot(rate[1]) < STEADY_RAD_S;
                self.trim(lean[1]);
                self.wanted(lean, rate)
            }
            None if self.age_s > OLD_S => [[0.0; 2]; 2],
            None => self.correction,
        };
        let share = self.dt_s / (SMOOTH_S + self.dt_s);
        for (now, wanted) in self.correction.iter_mut().flatten().zip(wanted.iter().flatten()) {
            *now += (wanted * self.load.share() - *now) * share;
        }
        for lean in &self.joints {
            let correction = self.correction[lean.axis][usize::from(lean.is_ankle)];
            let trim = if lean.is_ankle && lean.axis == 1 { self.trim_rad } else { 0.0 };
            commands_rad[lean.joint] += lean.sign * (correction + trim);
        }
        self.give.compensate(robot.torque_nm(), commands_rad);
        self.keep_limits(commands_rad);
        self.load.command(commands_rad);
    }

    /// Takes in where the servos are, before the commands of a cycle are corrected: a
    /// robot that somebody has lifted is not balanced.
    pub fn feel(&mut self, robot: &Retargeter, states: &[JointState]) {
        self.load.observe(states, robot.torque_nm());
    }

    /// Whether the feet carry nothing: somebody holds the robot.
    pub fn is_lifted(&self) -> bool {
        self.load.is_lifted()
    }

    /// Follows what the pelvis leans forward or back for seconds. To the sides the ankles of
    /// two planted feet shift the pelvis and do not turn it.
    fn trim(&mut self, pitch_rad: f64) {
        let step = self.load.share() * pitch_rad * self.dt_s / TRIM_S;
        self.trim_rad = (self.trim_rad - step).clamp(-MOST_TRIM_RAD, MOST_TRIM_RAD);
    }

    /// Lean about x and y, radians, from the vertical in the root link.
    fn lean(&self, up: [f64; 3]) -> [f64; 2] {
        let up = self.upright * Vector3::from(up);
        [up.y.atan2(up.z), -up.x.atan2(up.z)]
    }

    /// Whether a fall has begun that the feet cannot stop.
    pub fn is_falling(&self) -> bool {
        self.is_falling
    }

    /// Whether the robot leans as planned, as far as is known.
    pub fn is_steady(&self) -> bool {
        self.is_steady
    }

    /// Lean and its rate about x and y that the commands do not explain.
    fn beyond_plan(&self, reading: &ImuState) -> ([f64; 2], [f64; 2]) {
        let Some(then) = self.planned.front() else {
            return Default::default();
        };
        let before = self.planned.get(1).unwrap_or(then);
        let lean = self.lean(reading.up);
        let rate = self.upright * Vector3::from(reading.rate_rad_s);
        let rate = [rate.x, rate.y];
        let planned_rate = |axis: usize| (before[axis] - then[axis]) / self.dt_s;
        (
            [0, 1].map(|axis| lean[axis] - then[axis]),
            [0, 1].map(|axis| rate[axis] - planned_rate(axis)),
        )
    }

    /// Corrections of hips and ankles, by axis.
    fn wanted(&self, lean: [f64; 2], rate: [f64; 2]) -> [[f64; 2]; 2] {
        std::array::from_fn(|axis| {
            let (off, faster) = (lean[axis], rate[axis]);
            let beyond = (off.abs() - DEAD_BAND_RAD).max(0.0).copysign(off);
            let active = (off.abs() / DAMPED_RAD).min(1.0);
            let back = |share: f64, damping_s: f64| {
                (-share * beyond - damping_s * faster * active).clamp(-MOST_RAD, MOST_RAD)
            };
            let damping_s = self.damping_s[axis];
            [back(HIP_SHARE[axis], 0.5 * damping_s), back(ANKLE_SHARE[axis], damping_s)]
        })
    }

    fn keep_limits(&mut self, commands_rad: &mut [f64]) {
        for (joint, tracker) in &mut self.trackers {
            let command = &mut commands_rad[*joint];
            if !self.settled {
                tracker.restart(self.limits[*joint].clamp_rad(*command));
            }
            let wanted = tracker.follow(*command);
            tracker.advance(wanted);
            *command = tracker.position();
        }
        self.settled = true;
    }
}

/// Seconds by which the ankles' command answers the rate, so that the body on its
/// ankles is damped as wanted: an inverted pendulum of this mass and height on springs.
fn ankle_damping_s(mass_kg: f64, height_m: f64, stiffness: f64, damping: f64) -> f64 {
    if stiffness <= 0.0 {
        return 0.0;
    }
    let inertia = 1.2 * mass_kg * height_m * height_m;
    let left = (stiffness - mass_kg * GRAVITY_M_S2 * height_m).max(0.1 * stiffness);
    let wanted = 2.0 * DAMPING_RATIO * (left * inertia).sqrt();
    ((wanted - damping) / stiffness).clamp(0.0, MOST_DAMPING_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_humanoid_needs_little_more_damping_than_its_servos_have() {
        let damping_s = ankle_damping_s(3.15, 0.25, 42.0, 2.2);
        assert!((0.02..=MOST_DAMPING_S).contains(&damping_s), "{damping_s}");
    }
}
