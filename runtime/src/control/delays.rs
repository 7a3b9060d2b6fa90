//! The delays between air and servo by name, and their sum. Seconds.
//!
//! ```text
//! air -> capture -> features -> token -> hand-over -> interpolation -> limits -> bus, motor -> horn
//! ```

use crate::robot::Robot;
use servodance_retarget::Retargeter;
use servodance_types::FRAME_RATE_HZ;

/// What a capture device collects before it hands it over, usually.
const CAPTURE_S: f64 = 0.01;
/// What computing and threads may take, so that live motion is never waited for.
const HAND_OVER_S: f64 = 0.03;

/// Each part of the delay, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delays {
    /// Sound waits for its block to be full.
    pub capture_s: f64,
    /// An event waits for the end of its music frame: in the mean.
    pub feature_s: f64,
    /// One token a frame: the newest is up to a frame old.
    pub token_s: f64,
    /// Features and token are computed, threads wake up: at most.
    pub hand_over_s: f64,
    /// Between motion frames runs a spline, which needs the next frames.
    pub interpolation_s: f64,
    /// Limbs are planned ahead, so that limits do not make them late.
    pub limits_s: f64,
    /// From command to position: bus and motor, measured per robot.
    pub servo_s: f64,
}

impl Delays {
    /// The delays of one robot.
    pub fn new(robot: &Robot, retargeter: &Retargeter) -> Self {
        Self {
            capture_s: CAPTURE_S,
            feature_s: 0.5 / FRAME_RATE_HZ,
            token_s: 1.0 / FRAME_RATE_HZ,
            hand_over_s: HAND_OVER_S,
            interpolation_s: retargeter.lookahead_s() - retargeter.preview_s(),
            limits_s: retargeter.preview_s(),
            servo_s: robot.servo_lag_s,
        }
    }

    /// From the time of a live frame until it is certainly there, capture excepted.
    pub fn live_s(&self) -> f64 {
        self.token_s + self.hand_over_s
    }

    /// From live music to the servo horn, without whole beats of steering.
    pub fn total_s(&self) -> f64 {
        self.named().iter().map(|(_, seconds)| seconds).sum()
    }

    /// The parts in the order in which sound passes them.
    pub fn named(&self) -> [(&'static str, f64); 7] {
        [
            ("capture block", self.capture_s),
            ("feature window", self.feature_s),
            ("token", self.token_s),
            ("computing and hand-over", self.hand_over_s),
            ("interpolation", self.interpolation_s),
            ("limits, planned ahead", self.limits_s),
            ("bus and motor", self.servo_s),
        ]
    }
}
