//! Which motion frames are known, and how many came too late.

use super::delays::Delays;
use super::timing::MotionArrival;
use servodance_types::FRAME_RATE_HZ;

/// Features and token of a recording that is danced to as if it were live.
const COMPUTING_S: f64 = 0.005;
/// Motion time before the first motion frame.
const FIRST_S: f64 = -1.0 / FRAME_RATE_HZ;

pub struct MotionInput {
    pub arrival: MotionArrival,
    /// How long after its time a frame arrives, where that is simulated.
    arrival_s: f64,
    /// Motion time of the newest frame; `None` before the first.
    pub newest_s: Option<f64>,
    pub ended: bool,
    pub frames: u64,
    /// Cycles without the motion frame that they needed.
    pub late_frames: u64,
}

impl MotionInput {
    pub fn new(arrival: MotionArrival, delays: &Delays) -> Self {
        Self {
            arrival,
            arrival_s: delays.capture_s + COMPUTING_S,
            newest_s: None,
            ended: false,
            frames: 0,
            late_frames: 0,
        }
    }

    /// Whether more motion may come, and what is known ends before a time.
    pub fn lacks(&self, until_s: f64) -> bool {
        !self.ended && self.newest_s.unwrap_or(FIRST_S) < until_s
    }

    /// How far motion is to be fetched in the cycle at music time `time_s`:
    /// `needed_s` is what the retargeter needs, `foreseen_s` what steering wants.
    pub fn wanted_until_s(&self, time_s: f64, needed_s: f64, foreseen_s: Option<f64>) -> f64 {
        match (self.arrival, foreseen_s) {
            (MotionArrival::Led, _) => f64::INFINITY,
            (MotionArrival::AsLive, _) => time_s - self.arrival_s - 1.0 / FRAME_RATE_HZ,
            (MotionArrival::Live, Some(_)) => f64::INFINITY,
            (MotionArrival::Ahead, Some(foreseen_s)) => foreseen_s,
            (_, None) => needed_s,
        }
    }
}
