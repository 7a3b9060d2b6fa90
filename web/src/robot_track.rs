//! A kinematic robot behind the retargeter: poses of a dancer in, rows of numbers out.
//!
//! A row is shown [`RobotTrack::rate_hz`] times a second: for each link x, y, z in metres
//! and the quaternion x, y, z, w in the world, then every joint in radians. Row `n` is of
//! the moment `n / rate_hz` and comes once the frames that the retargeter looks ahead are
//! there. Cycles between two rows are computed, not shown.

use crate::error::WebError;
use crate::robots::WebRobot;
use servodance_retarget::{Retargeter, RobotModel};
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

/// As many rows a second as a screen can show; fewer where the robot has fewer cycles.
const SHOWN_HZ: f64 = 50.0;

/// The state of one robot in one dance.
pub struct RobotTrack {
    retargeter: Retargeter,
    control_hz: f64,
    /// Cycles from one row to the next.
    stride: u64,
    cycles: u64,
    frames: u64,
    last: Option<MotionFrame>,
    targets: Vec<f64>,
}

impl RobotTrack {
    /// A robot at rest.
    pub fn new(robot: &WebRobot) -> Result<Self, WebError> {
        let retargeter = robot.retargeter()?;
        Ok(Self {
            targets: retargeter.rest().to_vec(),
            retargeter,
            control_hz: robot.control_hz,
            stride: (robot.control_hz / SHOWN_HZ).round().max(1.0) as u64,
            cycles: 0,
            frames: 0,
            last: None,
        })
    }

    /// Rows a second.
    pub fn rate_hz(&self) -> f64 {
        self.control_hz / self.stride as f64
    }

    /// Numbers of a row.
    pub fn row(&self) -> usize {
        7 * self.model().link_names().len() + self.targets.len()
    }

    /// The robot's tree and shapes.
    pub fn model(&self) -> &RobotModel {
        self.retargeter.model()
    }

    /// How long after its frame a row comes, seconds.
    pub fn lookahead_s(&self) -> f64 {
        self.retargeter.lookahead_s()
    }

    /// Takes a pose; appends the rows that it completes to `rows`.
    pub fn push(&mut self, frame: &MotionFrame, rows: &mut Vec<f32>) -> Result<(), WebError> {
        self.retargeter.push(frame);
        self.frames += 1;
        self.last = Some(*frame);
        let seen_s = self.frames as f64 / FRAME_RATE_HZ - self.lookahead_s();
        self.run_until(seen_s, rows)
    }

    /// The rows up to the end of the last frame, after which the dancer stands still.
    pub fn finish(&mut self, rows: &mut Vec<f32>) -> Result<(), WebError> {
        let Some(mut still) = self.last else {
            return Ok(());
        };
        let end_s = self.frames as f64 / FRAME_RATE_HZ;
        for _ in 0..=(self.lookahead_s() * FRAME_RATE_HZ).ceil() as u64 {
            still.time_s += 1.0 / FRAME_RATE_HZ;
            self.retargeter.push(&still);
        }
        self.run_until(end_s, rows)
    }

    fn run_until(&mut self, end_s: f64, rows: &mut Vec<f32>) -> Result<(), WebError> {
        while (self.cycles as f64 / self.control_hz) < end_s {
            self.retargeter.next(self.cycles as f64 / self.control_hz, &mut self.targets)?;
            if self.cycles.is_multiple_of(self.stride) {
                self.show(rows);
            }
            self.cycles += 1;
        }
        Ok(())
    }

    fn show(&self, rows: &mut Vec<f32>) {
        let world_from_root = self.retargeter.world_from_root(&self.targets);
        for root_from_link in self.model().link_poses(&self.targets) {
            let pose = world_from_root * root_from_link;
            let ([x, y, z], turn) = (pose.translation.vector.into(), pose.rotation.coords);
            rows.extend([x, y, z, turn.x, turn.y, turn.z, turn.w].map(|v: f64| v as f32));
        }
        rows.extend(self.targets.iter().map(|target| *target as f32));
    }
}
