//! What the safety layer keeps of one joint, and of an adapter that was pulled out.

use servodance_types::{HeldBack, JointLimits};

use super::config::SafetyConfig;
use super::derating::Derate;
use super::limits::Limiter;
use super::stillness::Stillness;

pub(super) struct SafeJoint {
    pub limiter: Limiter,
    pub target_rad: f64,
    pub ramp_from_rad: f64,
    /// When its ramp began; `None` before the first targets.
    pub ramp_began_s: Option<f64>,
    pub away_since_s: Option<f64>,
    pub derate: Derate,
    /// What changed its last command.
    pub held: HeldBack,
    pub lost: Option<LostServo>,
    pub stillness: Stillness,
    limits: JointLimits,
    period_s: f64,
}

impl SafeJoint {
    /// A joint that stands at `position_rad` and is held there.
    pub fn new(limits: JointLimits, position_rad: f64, config: &SafetyConfig) -> Self {
        let held = limits.clamp_rad(position_rad);
        Self {
            limiter: Limiter::new(limits, config.period_s(), held),
            target_rad: held,
            ramp_from_rad: held,
            ramp_began_s: None,
            away_since_s: None,
            derate: Derate::new(*config),
            held: HeldBack::Nothing,
            lost: None,
            stillness: Stillness::default(),
            limits,
            period_s: config.period_s(),
        }
    }

    /// Holds at `held_rad`, and is blended into its targets from there.
    pub fn begin_at(&mut self, now_s: f64, held_rad: f64) {
        self.limiter = Limiter::new(self.limits, self.period_s, held_rad);
        self.ramp_from_rad = held_rad;
        self.ramp_began_s = Some(now_s);
        self.away_since_s = None;
        self.stillness = Stillness::default();
        self.lost = None;
    }

    /// The share of the targets that is followed, 0 to 1; `None` before any came.
    /// Quintic: speed and acceleration are zero at both ends.
    pub fn ramp_weight(&self, now_s: f64, ramp_s: f64) -> Option<f64> {
        let elapsed_s = now_s - self.ramp_began_s?;
        if elapsed_s >= ramp_s {
            return Some(1.0);
        }
        let u = (elapsed_s / ramp_s).clamp(0.0, 1.0);
        Some(u * u * u * (10.0 + u * (6.0 * u - 15.0)))
    }
}

pub(super) struct LostServo {
    pub since_s: f64,
    pub next_try_s: f64,
    pub reason: String,
}

pub(super) struct LostAdapter {
    pub since_s: f64,
    pub next_try_s: f64,
    pub waiting: bool,
}
