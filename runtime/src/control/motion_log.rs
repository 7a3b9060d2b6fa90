//! Which moment of the motion was asked for when, and where simulated servos truly were:
//! for measuring sound against servos by one clock.

use servodance_types::JointState;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// One control cycle.
#[derive(Clone, Debug)]
pub struct LoggedCycle {
    /// When the servos were read.
    pub at: Instant,
    /// The moment of the motion that was sent, seconds of music.
    pub motion_s: f64,
    /// What was asked for, radians.
    pub targets_rad: Vec<f64>,
    /// Where the servos were, radians.
    pub positions_rad: Vec<f64>,
}

/// Shared by the control loop, which alone writes, and whoever measures afterwards.
#[derive(Clone, Debug, Default)]
pub struct MotionLog(Arc<Mutex<Vec<LoggedCycle>>>);

impl MotionLog {
    pub(crate) fn push(&self, motion_s: f64, targets_rad: &[f64], servos: &[JointState]) {
        let mut cycles = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        cycles.push(LoggedCycle {
            at: Instant::now(),
            motion_s,
            targets_rad: targets_rad.to_vec(),
            positions_rad: servos.iter().map(|servo| servo.position_rad).collect(),
        });
    }

    /// All cycles so far; the log is empty then.
    pub fn take(&self) -> Vec<LoggedCycle> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
