//! What a run of the control loop leaves behind: recording, traces, durations.

use super::latency::LatencyLog;
use super::motion_log::MotionLog;
use super::motion_plan::MotionPlan;
use super::recorder_feed::{CycleDecision, RecorderFeed};
use super::robot_buses::RobotBuses;
use super::servo_truth_log::ServoTruthLog;
use super::trace::Trace;
use crate::pipeline::dance_step::DanceStep;
use crate::pipeline::step_times::{DurationLog, PipelineStep, StepClock};
use crate::robot::Robot;
use servodance_types::FRAME_RATE_HZ;

/// How much of a live run is kept for its report, seconds.
const LIVE_TRACE_S: f64 = 300.0;

pub struct LoopLog {
    pub recorder: RecorderFeed,
    pub trace: Trace,
    pub steps: StepClock,
    /// From sound to command, where audio is live.
    pub latency: LatencyLog,
    pub lateness: DurationLog,
    pub servo_truth: Option<ServoTruthLog>,
    pub motion: Option<MotionLog>,
    control_hz: f64,
    /// Whether only the newest minutes of the trace are kept.
    is_endless: bool,
}

/// Moments of one cycle, seconds.
#[derive(Clone, Copy)]
pub struct CycleTimes {
    pub cycle: u64,
    pub music_s: f64,
    pub recording_s: f64,
    pub stood_s: f64,
}

impl LoopLog {
    pub fn new(robot: &Robot, recorder: RecorderFeed, is_endless: bool) -> Self {
        Self {
            recorder,
            trace: Trace::new(robot.servos.len()),
            steps: StepClock::default(),
            latency: LatencyLog::default(),
            lateness: DurationLog::default(),
            servo_truth: None,
            motion: None,
            control_hz: robot.control_hz,
            is_endless,
        }
    }

    /// Cycles between two samples of the trace, about 20 a second.
    pub fn decimation(&self) -> u64 {
        (self.control_hz / FRAME_RATE_HZ).round().max(1.0) as u64
    }

    /// Samples a second of the trace.
    pub fn trace_hz(&self) -> f64 {
        self.control_hz / self.decimation() as f64
    }

    /// A motion frame came; `recording_s` is its time if the dance has begun.
    pub fn frame(&mut self, step: &DanceStep, recording_s: Option<f64>) {
        self.trace.motion.push(step.motion);
        self.steps.push(PipelineStep::Features, step.features_ms);
        self.steps.push(PipelineStep::Model, step.model_ms);
        if let Some(recording_s) = recording_s {
            self.latency.arrived(step);
            self.recorder.frame(recording_s, step);
        }
    }

    pub fn cycle(&mut self, times: CycleTimes, plan: &MotionPlan, servos: &RobotBuses) {
        let is_sampled = times.cycle.is_multiple_of(self.decimation());
        if times.music_s >= 0.0 && is_sampled {
            self.sample(times.music_s, plan, servos);
        }
        let decision = CycleDecision {
            targets_rad: &plan.targets_rad,
            lead_s: plan.motion_s - times.music_s,
            idle_share: plan.idle.share(),
            period_s: 1.0 / self.control_hz,
            root: is_sampled.then_some(&plan.retargeter),
        };
        self.recorder.cycle(times.recording_s, times.stood_s, decision, servos);
    }

    fn sample(&mut self, music_s: f64, plan: &MotionPlan, servos: &RobotBuses) {
        let targets = plan.targets_rad.iter().copied();
        self.trace.targets.push(music_s, targets);
        let reported = servos.states().iter().map(|s| s.position_rad);
        self.trace.servos.push(music_s, reported);
        self.trace.roots.push(servos.root_pose(&plan.retargeter));
        if self.is_endless {
            self.trace.keep_newest(LIVE_TRACE_S);
        }
    }

    /// Notes the motion of a cycle and where servos are, if that is logged.
    pub fn motion(&self, plan: &MotionPlan, servos: &RobotBuses) {
        if let Some(log) = &self.motion {
            let truth = servos.truth().unwrap_or(servos.states());
            log.push(plan.motion_s, &plan.targets_rad, truth);
        }
    }

    /// Notes where simulated servos truly are, if that is logged.
    pub fn servo_truth(&mut self, idle_share: f64, servos: &RobotBuses) {
        if let Some(log) = &mut self.servo_truth {
            let truth = servos.truth().unwrap_or(servos.states());
            log.push(idle_share, truth.iter().map(|s| s.position_rad));
        }
    }
}
