//! One pose for one input: how far apart two dances of one motion are when the second
//! begins in the middle of it, and how far joints that turn about the vertical go from rest.

use serde::Serialize;
use servodance_model::motion::Clip;
use servodance_runtime::offline::motion_tracking::{TrackedMotion, track_motion};
use servodance_runtime::robot::Robot;
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

/// The frame at which the second dance begins.
const CUT: usize = 200;
/// Compared are so many seconds after the cut at most.
const COMPARED_S: f64 = 30.0;
/// Both must show the same in steady parts after the first time, everywhere after the second.
const STEADY_S: f64 = 0.5;
const SETTLED_S: f64 = 2.0;
/// A joint is steady when it was slower than this for so long.
const STEADY_DEG_S: f64 = 20.0;
const STEADY_FOR_S: f64 = 0.3;

/// An angle, degrees, and the joint and motion where it was.
#[derive(Clone, Debug, Default, Serialize)]
#[allow(missing_docs)] // the names say it
pub struct FarthestJoint {
    pub deg: f64,
    pub joint: String,
    pub motion: String,
}

impl FarthestJoint {
    fn see(&mut self, deg: f64, joint: &str, motion: &str) {
        if deg > self.deg {
            *self = Self { deg, joint: joint.into(), motion: motion.into() };
        }
    }
}

/// What `bench start-frame` prints of a robot.
#[derive(Clone, Debug, Serialize)]
pub struct StartFrameReport {
    /// The robot.
    pub robot: String,
    /// Motions long enough to be cut.
    pub cut: usize,
    /// Largest difference in steady parts from 0.5 s after the cut on.
    pub steady: FarthestJoint,
    /// Largest difference from 2 s after the cut on.
    pub settled: FarthestJoint,
    /// Share of joint cycles from 2 s on that differ by more than 5 degrees.
    pub share_beyond_5_deg: f64,
    /// Median angle between the dancer's and the robot's arms, degrees, and jerk, both the mean
    /// over the motions.
    pub arms_deg: f64,
    /// Root mean square over all joints.
    pub jerk_rad_s3: f64,
    /// Farthest from rest of the joints that turn about the vertical there.
    pub yaw: FarthestJoint,
}

/// Dances every motion whole and from its 200th frame on.
/// Fails where the robot cannot be retargeted to.
pub fn run(robot: &Robot, motions: &[Clip]) -> anyhow::Result<StartFrameReport> {
    let retargeter = robot.retargeter()?;
    let (rest, yaws) = (retargeter.rest().to_vec(), retargeter.yaw_joints().to_vec());
    let mut report = StartFrameReport {
        robot: robot.name.clone(),
        cut: 0,
        steady: FarthestJoint::default(),
        settled: FarthestJoint::default(),
        share_beyond_5_deg: 0.0,
        arms_deg: 0.0,
        jerk_rad_s3: 0.0,
        yaw: FarthestJoint::default(),
    };
    let (mut compared, mut beyond) = (0_u64, 0_u64);
    for motion in motions {
        let frames = motion.frames();
        let mut whole = Vec::new();
        let tracked = track_motion(robot, &frames, |_, row| {
            whole.push(row.to_vec());
            Ok(())
        })?;
        let share = 1.0 / motions.len() as f64;
        report.arms_deg += share * TrackedMotion::quantile(&tracked.direction_errors_deg, 0.5);
        report.jerk_rad_s3 += share * tracked.jerk_rms_rad_s3;
        for row in &whole {
            for &joint in &yaws {
                let deg = (row[joint] - rest[joint]).abs().to_degrees();
                report.yaw.see(deg, &robot.servos[joint].name, &motion.name);
            }
        }
        if frames.len() <= CUT + (SETTLED_S * FRAME_RATE_HZ) as usize {
            continue;
        }
        report.cut += 1;
        let part = CUT..frames.len().min(CUT + (COMPARED_S * FRAME_RATE_HZ) as usize);
        let later = shown(robot, &begun_later(&frames[part]))?;
        let cycles = |seconds: f64| (seconds * robot.control_hz).round() as usize;
        let start = cycles(CUT as f64 / FRAME_RATE_HZ);
        for (cycle, row) in later.iter().enumerate().skip(cycles(STEADY_S)) {
            let Some(other) = whole.get(start + cycle) else { break };
            let before = &whole[start + cycle - cycles(STEADY_FOR_S)..start + cycle];
            for (joint, servo) in robot.servos.iter().enumerate() {
                let deg = (row[joint] - other[joint]).abs().to_degrees();
                if cycle >= cycles(SETTLED_S) {
                    report.settled.see(deg, &servo.name, &motion.name);
                    compared += 1;
                    beyond += u64::from(deg > 5.0);
                }
                let most = STEADY_DEG_S.to_radians() / robot.control_hz;
                let still = |pair: &[Vec<f64>]| (pair[1][joint] - pair[0][joint]).abs() < most;
                if before.windows(2).all(still) {
                    report.steady.see(deg, &servo.name, &motion.name);
                }
            }
        }
    }
    report.share_beyond_5_deg = beyond as f64 / compared.max(1) as f64;
    Ok(report)
}

fn begun_later(frames: &[MotionFrame]) -> Vec<MotionFrame> {
    let start_s = frames.first().map_or(0.0, |frame| frame.time_s);
    frames.iter().map(|frame| MotionFrame { time_s: frame.time_s - start_s, ..*frame }).collect()
}

fn shown(robot: &Robot, frames: &[MotionFrame]) -> anyhow::Result<Vec<Vec<f64>>> {
    let mut rows = Vec::new();
    track_motion(robot, frames, |_, row| {
        rows.push(row.to_vec());
        Ok(())
    })?;
    Ok(rows)
}
