//! The control loop: one fixed-rate cycle after another, from torque on to
//! torque off. Its states and their diagram: [`LoopState`].
//!
//! Lead-in: the robot moves to its first pose before the music begins; live
//! music has none. Lead-out: from the last pose to rest, so that torque off does
//! not drop raised limbs. A hold is waited for there: the robot never goes limp
//! with its arms up.
//!
//! Simulated time (`--speed max`) waits for motion; the wall clock does not: a
//! frame that is not there is counted as late, and the robot holds. A servo that
//! does not answer is the business of `servodance_drivers::safety`.

mod dead_man;
mod listening;
mod state;

pub use state::{Ending, disarm_cause};

use super::balance::Balance;
use super::cycle_clock::CycleClock;
use super::delays::Delays;
use super::loop_clock::LoopClock;
use super::loop_log::{CycleTimes, LoopLog};
use super::minimum_jerk::MinimumJerk;
use super::motion_input::MotionInput;
use super::motion_plan::MotionPlan;
use super::recorder_feed::RecorderFeed;
use super::robot_buses::RobotBuses;
use super::timing::{LEAD_IN_S, LoopOptions, MotionArrival};
use super::viewer_link::{CycleView, ViewerLink};
use crate::pipeline::dance_step::{DanceChange, DanceStep, Polled};
use crate::pipeline::load_shedding::LoadShedding;
use crate::pipeline::motion_source::MotionSource;
use crate::pipeline::step_times::PipelineStep;
use crate::process::failpoint;
use crate::robot::Robot;
use crate::telemetry::recorder::Recorder;
use crate::viewer::{RobotEnd, ViewerRequest};
use dead_man::{DeadMan, DeadManAction};
use servodance_audio::playback::MusicStart;
use servodance_types::MusicFrame;
use state::LoopState;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Seconds after the last motion frame in which the robot comes to a stop.
const TAIL_S: f64 = 0.5;
/// How long a robot that falls draws its limbs in, and then gives way before torque goes
/// off, seconds.
const TUCK_S: f64 = 0.15;
const GIVE_WAY_S: f64 = 0.3;

pub struct ControlLoop<'a> {
    robot: &'a Robot,
    servos: &'a mut RobotBuses,
    stop: &'a AtomicBool,
    state: LoopState,
    stop_requested: bool,
    clock: LoopClock,
    input: MotionInput,
    plan: MotionPlan,
    balance: Option<Balance>,
    viewers: Option<ViewerLink<'a>>,
    dead_man: Option<DeadMan>,
    /// Dead-man mode has ended the dance.
    unattended: bool,
    /// Where the music that is played learns when it begins.
    played: Option<MusicStart>,
    pub log: LoopLog,
}

/// What is left of a loop that has run.
pub struct LoopRecord {
    pub clock: LoopClock,
    pub input: MotionInput,
    pub plan: MotionPlan,
    pub log: LoopLog,
}

impl<'a> ControlLoop<'a> {
    pub fn new(
        robot: &'a Robot,
        servos: &'a mut RobotBuses,
        recorder: Option<Recorder>,
        options: LoopOptions,
        viewers: Option<&'a mut RobotEnd>,
        stop: &'a AtomicBool,
    ) -> anyhow::Result<Self> {
        let mut plan = MotionPlan::new(robot, options)?;
        let delays = Delays::new(robot, &plan.retargeter);
        let dead_man = viewers.as_ref().and_then(|end| end.dead_man_s).map(DeadMan::new);
        let is_endless = options.arrival != MotionArrival::Ahead;
        Ok(Self {
            state: LoopState::Starting,
            stop_requested: false,
            clock: LoopClock {
                cycles: CycleClock::new(options.speed, robot.period_s()),
                music_start_s: match options.arrival {
                    MotionArrival::Led => 0.0,
                    _ => LEAD_IN_S,
                },
                stood_s: 0.0,
            },
            input: MotionInput::new(options.arrival, &delays),
            viewers: viewers
                .map(|end| ViewerLink::new(end, &mut plan.retargeter, robot.period_s())),
            dead_man,
            unattended: false,
            played: None,
            balance: Balance::new(robot, &plan.retargeter, servos),
            plan,
            log: LoopLog::new(robot, RecorderFeed::new(recorder), is_endless),
            robot,
            servos,
            stop,
        })
    }

    /// Lets load shedding decide how often viewers are served.
    pub fn shed_viewers(&mut self, shedding: &LoadShedding) {
        if let Some(viewers) = &mut self.viewers {
            viewers.shedding = shedding.clone();
        }
    }

    /// Lets the music be played in step with the motion.
    pub fn play(&mut self, start: MusicStart) {
        self.played = Some(start);
    }

    /// Dances until the music is over or `stop` is set. `on_frame` gets the time
    /// of each new motion frame. Torque is on after this, at rest or held.
    pub fn run(
        &mut self,
        source: &mut MotionSource,
        mut on_frame: impl FnMut(f64),
    ) -> anyhow::Result<Ending> {
        self.plan.seed(self.servos.states())?;
        let waits = self.input.arrival == MotionArrival::Live;
        if waits && !self.wait_for_music(source, &mut on_frame)? {
            return Ok(Ending::Interrupted);
        }
        self.clock.stood_s = self.servos.now_s();
        if matches!(self.input.arrival, MotionArrival::Ahead | MotionArrival::Led) {
            self.clock.start_now();
        }
        while !self.is_over() {
            if self.is_interrupted() {
                return Ok(Ending::Interrupted);
            }
            self.dance_cycle(source, &mut on_frame)?;
            if self.falls() {
                return self.give_way();
            }
        }
        self.lead_out(source)
    }

    pub fn into_record(self) -> LoopRecord {
        if let Some(played) = &self.played {
            played.silence();
        }
        LoopRecord { clock: self.clock, input: self.input, plan: self.plan, log: self.log }
    }

    fn is_interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn is_over(&self) -> bool {
        let newest_s = self.input.newest_s.unwrap_or(0.0);
        self.stop_requested || (self.input.ended && self.plan.motion_s > newest_s + TAIL_S)
    }

    fn dance_cycle(
        &mut self,
        source: &mut MotionSource,
        on_frame: &mut impl FnMut(f64),
    ) -> anyhow::Result<()> {
        let time_s = self.clock.time_s();
        self.state = match time_s < 0.0 {
            true => LoopState::LeadIn,
            false => LoopState::Dancing,
        };
        self.wait_for_cycle(); // before the newest motion is looked at, not after
        self.tell_music();
        self.handle_requests(source)?;
        self.fetch_motion(source, on_frame)?;
        self.choose_motion_time(time_s, source)?;
        self.retarget()?;
        self.drive(time_s)
    }

    /// From the last pose to rest along a minimum-jerk path that stays far
    /// inside the limits. A hold is waited for.
    fn lead_out(&mut self, source: &mut MotionSource) -> anyhow::Result<Ending> {
        self.state = LoopState::LeadOut;
        let limits = self.robot.servos.iter().map(|servo| &servo.limits);
        let rest = self.plan.retargeter.rest();
        let path = MinimumJerk::new(&self.plan.targets_rad, rest, limits, self.robot.control_hz);
        let mut done = 0;
        while done < path.cycles() || self.is_blending_in() {
            if self.is_interrupted() {
                return Ok(Ending::Interrupted);
            }
            self.wait_for_cycle();
            self.handle_requests(source)?;
            let held = self.viewers.as_ref().is_some_and(|viewers| viewers.hold);
            done = (done + u64::from(!held)).min(path.cycles());
            path.at(done, &mut self.plan.targets_rad);
            self.drive(self.clock.time_s())?;
            if self.falls() {
                return self.give_way();
            }
        }
        Ok(match (self.unattended, self.stop_requested) {
            (true, _) => Ending::Unattended,
            (false, true) => Ending::Stopped,
            (false, false) => Ending::Finished,
        })
    }

    /// Whether the robot falls by its sensor, or has fallen in its world.
    fn falls(&mut self) -> bool {
        let announced = self.balance.as_ref().is_some_and(Balance::is_falling);
        if announced {
            self.servos.announce_fall();
        }
        announced || self.servos.has_fallen()
    }

    /// Once a fall has begun: limbs towards rest, then the servos are told to be where
    /// they are, so that they push little, until torque goes off.
    fn give_way(&mut self) -> anyhow::Result<Ending> {
        self.balance = None;
        let cycles = |seconds: f64| (seconds * self.robot.control_hz).ceil() as u64;
        let (tuck, give_way) = (cycles(TUCK_S), cycles(GIVE_WAY_S));
        for cycle in 0..tuck + give_way {
            match cycle < tuck {
                true => self.plan.targets_rad.copy_from_slice(self.plan.retargeter.rest()),
                false => {
                    let states = self.servos.states();
                    for (target, state) in self.plan.targets_rad.iter_mut().zip(states) {
                        *target = state.position_rad;
                    }
                }
            }
            self.wait_for_cycle();
            self.drive(self.clock.time_s())?;
        }
        Ok(Ending::Fell)
    }

    /// Whether the robot is still on its way from where it was held.
    fn is_blending_in(&self) -> bool {
        self.viewers.is_some() && self.servos.is_ramping()
    }

    /// Real time: waits for the moment of this cycle.
    fn wait_for_cycle(&mut self) {
        let Some(late_s) = self.clock.cycles.wait() else {
            return;
        };
        if let Some(viewers) = &mut self.viewers {
            viewers.note_late(late_s);
        }
        if self.input.arrival == MotionArrival::Led {
            self.log.lateness.push(late_s * 1e3);
        }
    }

    /// Says when the music begins, by the clock on the wall: later, where cycles were.
    fn tell_music(&self) {
        if let Some(played) = &self.played {
            played.set(self.clock.cycles.moment(self.clock.music_start_s));
        }
    }

    /// Does what viewers have asked for since the last cycle.
    fn handle_requests(&mut self, source: &mut MotionSource) -> anyhow::Result<()> {
        let Some(viewers) = &mut self.viewers else {
            return Ok(());
        };
        while let Some(request) = viewers.end.request() {
            request.apply_to(&mut viewers.end.settings);
            match request {
                ViewerRequest::Hold => viewers.hold = true,
                ViewerRequest::Resume => viewers.hold = false,
                ViewerRequest::Stop => {
                    self.stop_requested = true;
                    viewers.hold = false; // the end is at rest, not with raised arms
                }
                ViewerRequest::Idle(idle) => self.plan.idle.set_style(idle),
                ViewerRequest::Style(style) => source.change(DanceChange::Style(style))?,
                ViewerRequest::Seed(seed) => source.change(DanceChange::Seed(seed))?,
                ViewerRequest::Tap => source.change(DanceChange::Tap(self.plan.motion_s))?,
                ViewerRequest::OperatorLost => {
                    self.servos.note("an operator's page has fallen silent");
                }
                // Approached a little in each cycle, by `adjust`.
                ViewerRequest::Amplitude(_) | ViewerRequest::Mirror(_) => {}
                // Only while waiting, or while a recording plays.
                ViewerRequest::Start | ViewerRequest::Release | ViewerRequest::Seek(_) => {}
            }
        }
        let silent_s = viewers.end.operators.silent_s();
        match self.dead_man.as_mut().and_then(|dead_man| dead_man.watch(silent_s)) {
            Some(DeadManAction::Hold) => {
                self.servos.note(&format!("no operator for {silent_s:.1} s: holding"));
                viewers.hold = true;
            }
            Some(DeadManAction::Rest) => {
                self.servos.note(&format!("no operator for {silent_s:.1} s: going to rest"));
                (self.stop_requested, self.unattended) = (true, true);
                viewers.hold = false;
            }
            None => {}
        }
        self.servos.hold(viewers.hold);
        viewers.adjust(&mut self.plan.retargeter);
        Ok(())
    }

    /// Takes motion until the next cycle has all that it needs, and steering
    /// all that it can use.
    fn fetch_motion(
        &mut self,
        source: &mut MotionSource,
        on_frame: &mut impl FnMut(f64),
    ) -> anyhow::Result<()> {
        let motion_s = self.plan.motion_s + self.robot.period_s();
        let needed_s = motion_s + self.plan.retargeter.lookahead_s();
        let foreseen_s = self.plan.foreseen_s(motion_s);
        let time_s = self.clock.time_s();
        let wanted_s = self.input.wanted_until_s(time_s, needed_s, foreseen_s);
        while self.input.lacks(wanted_s) {
            match source.poll()? {
                Polled::Step(step) => self.accept(&step, on_frame),
                Polled::Ended => self.input.ended = true,
                Polled::Late => {
                    let late = motion_s >= 0.0 && self.input.lacks(needed_s);
                    self.input.late_frames += u64::from(late && self.is_due(source));
                    break;
                }
                Polled::Away => {
                    let time_s = self.music_s();
                    self.plan.idle.hear(&MusicFrame { time_s, ..MusicFrame::default() });
                    break;
                }
            }
        }
        Ok(())
    }

    fn is_due(&self, source: &mut MotionSource) -> bool {
        match source {
            MotionSource::Stage(stage) => stage.is_led() && !self.plan.is_hidden(),
            _ => true,
        }
    }

    fn accept(&mut self, step: &DanceStep, on_frame: &mut impl FnMut(f64)) {
        self.input.newest_s = Some(step.motion.time_s);
        self.input.frames += 1;
        self.plan.push(step);
        if let Some(viewers) = &mut self.viewers {
            viewers.push_music(&step.music);
        }
        on_frame(step.motion.time_s);
        let is_dancing = self.state != LoopState::Listening;
        let recording_s = self.clock.recording_s(step.motion.time_s);
        self.log.frame(step, is_dancing.then_some(recording_s));
    }

    /// Which moment of the motion the targets of this cycle show.
    fn choose_motion_time(&mut self, time_s: f64, source: &mut MotionSource) -> anyhow::Result<()> {
        if let MotionSource::Stage(stage) = source {
            let moment = self.clock.cycles.moment(time_s);
            let moment_s = stage.moment_s(moment, self.plan.is_hidden());
            self.plan.follow_leader(moment_s);
            return Ok(());
        }
        self.plan.choose_time(time_s, self.input.newest_s)
    }

    /// Music time that belongs to the motion of this cycle.
    fn music_s(&self) -> f64 {
        match self.input.arrival {
            MotionArrival::Led => self.plan.motion_s - self.plan.lead.even_s(),
            _ => self.clock.time_s(),
        }
    }

    fn retarget(&mut self) -> anyhow::Result<()> {
        let music_s = self.music_s();
        let (plan, viewers) = (&mut self.plan, &mut self.viewers);
        let (result, ms) = self.log.steps.time(PipelineStep::Retarget, || {
            plan.retarget(music_s, |pose| {
                if let Some(viewers) = viewers {
                    viewers.push_pose(pose);
                }
            })
        });
        result?;
        self.record_step(PipelineStep::Retarget, ms);
        Ok(())
    }

    /// One bus cycle with the present targets, then bookkeeping.
    fn drive(&mut self, time_s: f64) -> anyhow::Result<()> {
        failpoint::pass("control");
        let robot_s = self.clock.robot_s(time_s);
        let (servos, targets) = (&mut *self.servos, &self.plan.targets_rad);
        let commands = match &mut self.balance {
            Some(balance) => balance.correct(targets, &mut self.plan.retargeter, servos),
            None => targets,
        };
        let cycle = || servos.cycle(robot_s, commands);
        let (result, bus_ms) = self.log.steps.time(PipelineStep::Bus, cycle);
        result?;
        let start = Instant::now();
        self.log.servo_truth(self.plan.idle.share(), self.servos);
        self.log.motion(&self.plan, self.servos);
        self.log.latency.sent(start);
        self.publish();
        let times = CycleTimes {
            cycle: self.clock.cycles.cycle(),
            music_s: time_s,
            recording_s: self.clock.recording_s(time_s),
            stood_s: self.clock.stood_s,
        };
        self.log.cycle(times, &self.plan, self.servos);
        self.record_step(PipelineStep::Bus, bus_ms);
        let control_ms = start.elapsed().as_secs_f64() * 1e3;
        self.log.steps.push(PipelineStep::Control, control_ms);
        self.record_step(PipelineStep::Control, control_ms);
        self.clock.cycles.advance();
        Ok(())
    }

    fn record_step(&mut self, step: PipelineStep, ms: f64) {
        let recording_s = self.clock.recording_s(self.clock.time_s());
        self.log.recorder.step(recording_s, step, ms);
    }

    fn publish(&mut self) {
        let cycle = CycleView {
            activity: self.state.activity(),
            music_s: self.music_s(),
            idle_share: self.plan.idle.share(),
            late_frames: self.input.late_frames,
        };
        if let Some(viewers) = &mut self.viewers {
            viewers.publish(self.servos, &self.plan.retargeter, cycle);
        }
    }
}
