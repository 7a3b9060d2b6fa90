//! From motion frames to joint targets: which moment of the motion a cycle
//! shows, blended with idle, retargeted.

use super::beat_sync::steering::{BeatSteering, Horizon};
use super::beat_sync::trajectory_preview::TrajectoryPreview;
use super::delays::Delays;
use super::idle::Idle;
use super::lead_time::LeadTime;
use super::timing::{LEAD_IN_S, LoopOptions, MotionArrival};
use crate::pipeline::dance_step::DanceStep;
use crate::robot::Robot;
use servodance_retarget::{BodyPoints, Retargeter};
use servodance_types::JointState;

pub struct MotionPlan {
    pub retargeter: Retargeter,
    steering: Option<BeatSteering>,
    pub idle: Idle,
    pub lead: LeadTime,
    pub motion_s: f64,
    /// Joint targets of the present cycle, radians.
    pub targets_rad: Vec<f64>,
}

impl MotionPlan {
    pub fn new(robot: &Robot, options: LoopOptions) -> anyhow::Result<Self> {
        let retargeter = robot.servo_retargeter()?;
        let delays = Delays::new(robot, &retargeter);
        let live_s = matches!(options.arrival, MotionArrival::Live | MotionArrival::AsLive)
            .then_some(delays.live_s());
        let even_lead_s = match live_s {
            Some(live_s) => -(live_s + retargeter.lookahead_s()),
            None => delays.servo_s,
        };
        let horizon = Horizon { preview_s: delays.limits_s, servo_lag_s: delays.servo_s, live_s };
        let steering = match options.compensation {
            true => {
                let preview = TrajectoryPreview::new(robot.servo_retargeter()?, robot.period_s());
                Some(BeatSteering::new(preview, horizon, robot.period_s()))
            }
            false => None,
        };
        Ok(Self {
            steering,
            idle: Idle::new(options.idle, robot.period_s()),
            lead: LeadTime::new(even_lead_s),
            motion_s: even_lead_s - LEAD_IN_S,
            targets_rad: retargeter.rest().to_vec(),
            retargeter,
        })
    }

    pub fn seed(&mut self, states: &[JointState]) -> anyhow::Result<()> {
        let present: Vec<f64> = states.iter().map(|s| s.position_rad).collect();
        Ok(self.retargeter.seed(&present)?)
    }

    pub fn push(&mut self, step: &DanceStep) {
        match &step.posture {
            Some(posture) => self.retargeter.push_with_posture(&step.motion, posture),
            None => self.retargeter.push(&step.motion),
        }
        if let Some(steering) = &mut self.steering {
            steering.push(&step.music, &step.motion);
        }
        self.idle.hear(&step.music);
    }

    /// Motion time until which steering wants to know the motion.
    pub fn foreseen_s(&self, motion_s: f64) -> Option<f64> {
        let steering = self.steering.as_ref()?;
        Some(motion_s + steering.foresight_s())
    }

    pub fn is_hidden(&self) -> bool {
        self.idle.share() >= 1.0
    }

    /// Chooses the motion time of the cycle at music time `time_s`; motion is
    /// known up to `newest_s`.
    pub fn choose_time(&mut self, time_s: f64, newest_s: Option<f64>) -> anyhow::Result<()> {
        let hidden = self.is_hidden();
        self.motion_s = match &mut self.steering {
            Some(steering) => {
                let newest_s = newest_s.unwrap_or(f64::NEG_INFINITY);
                let shown_until_s = newest_s - self.retargeter.lookahead_s();
                steering.next(time_s, shown_until_s, hidden)?
            }
            None => time_s + self.lead.even_s(),
        };
        if time_s >= 0.0 {
            self.lead.push(self.motion_s - time_s);
        }
        Ok(())
    }

    /// Shows the moment of the motion that a leader asks for.
    pub fn follow_leader(&mut self, moment_s: f64) {
        self.motion_s = moment_s + self.lead.even_s();
    }

    /// Targets of the present cycle; `observe` gets the human pose behind them.
    pub fn retarget(
        &mut self,
        music_s: f64,
        mut observe: impl FnMut(Option<BodyPoints>),
    ) -> anyhow::Result<()> {
        let (idle, motion_s) = (&mut self.idle, self.motion_s);
        let alter = |dance| {
            let shown = idle.step(music_s, dance);
            observe(shown);
            Some((shown?, 1.0 - idle.share()))
        };
        Ok(self.retargeter.next_altered(motion_s, alter, &mut self.targets_rad)?)
    }

    /// Slowest and fastest pace of the motion so far.
    pub fn paces(&self) -> [f64; 2] {
        let steering = self.steering.as_ref();
        steering.map_or([1.0; 2], BeatSteering::paces)
    }
}
