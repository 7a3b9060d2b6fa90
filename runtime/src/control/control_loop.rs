//! The control loop: one fixed-rate cycle after another, from torque on to
//! torque off.
//!
//! ```text
//! arm -> Prelude -> Dance -> Finale -> torque off
//!           |         |        |
//!           +---------+--------+--> error or Ctrl-C -> torque off
//! ```
//!
//! A request to stop, or the end of the music, leads to the finale; a hold is
//! waited for there, so that the robot never goes limp with its arms up.
//!
//! Prelude: the robot moves to its first pose before the music begins (left
//! out when audio comes in live). Dance: motion in, joints out. Finale: from
//! the last pose to rest, so that torque off does not drop raised limbs.
//!
//! Simulated time (`--speed max`) waits for motion; the wall clock does not:
//! a frame that is not there is counted as late, and the robot holds.

use crate::control::beat_sync::steering::{Horizon, Steering};
use crate::control::beat_sync::trajectory_preview::Rehearsal;
use crate::control::cycle_clock::CycleClock;
use crate::control::delays::Delays;
use crate::control::idle::Idle;
use crate::control::latency::{Arrivals, Latency};
use crate::control::lead_time::Lead;
use crate::control::minimum_jerk::MinimumJerk;
use crate::control::recorder_feed::{Chronicle, Decided};
use crate::control::robot_buses::Rig;
use crate::control::servo_truth_log::Witness;
use crate::control::timing::Timing;
use crate::control::trace::Trace;
use crate::control::viewer_link::{Cycle, Showing};
use crate::pipeline::load_shedding::Sparing;
use crate::pipeline::motion_source::{Change, MotionSource, Next, Step};
use crate::pipeline::step_times::{Stage, StageClock, Times};
use crate::process::failpoint;
use crate::robot::Robot;
use crate::telemetry::recorder::Recorder;
use crate::viewer::{Activity, RobotEnd, ViewerRequest};
use servodance_retarget::Retargeter;
use servodance_types::{FRAME_RATE_HZ, MusicFrame};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Seconds from torque on to the music.
const PRELUDE_S: f64 = 4.0;
/// Seconds after the last motion frame in which the robot comes to a stop.
const TAIL_S: f64 = 0.5;
/// Features and token of a recording that is danced to as if it were live.
const COMPUTING_S: f64 = 0.005;
/// Before the first motion frame.
const FIRST_S: f64 = -1.0 / FRAME_RATE_HZ;
/// How much of a live run is kept for its report, seconds.
const LIVE_TRACE_S: f64 = 300.0;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The music was over.
    Finished,
    /// Somebody watching asked it to stop.
    Stopped,
    /// The user stopped it.
    Interrupted,
}

/// The loop and all that it keeps.
pub struct Control<'a> {
    robot: &'a Robot,
    rig: &'a mut Rig,
    retargeter: Retargeter,
    steering: Option<Steering>,
    idle: Idle,
    lead: Lead,
    /// Motion time of the present cycle.
    motion_s: f64,
    stop: &'a AtomicBool,
    show: Option<Showing<'a>>,
    activity: Activity,
    stop_asked: bool,
    live: bool,
    staged: bool,
    /// How long after its time a frame of a recording arrives that is danced to
    /// as if it were live.
    arrival_s: Option<f64>,
    music_start_s: f64,
    stood_s: f64,
    dancing: bool,
    clock: CycleClock,
    targets: Vec<f64>,
    newest_s: Option<f64>,
    /// When the newest sound that the motion knows was captured, if live.
    captured: Option<Instant>,
    ended: bool,
    /// What the recording is told.
    pub chronicle: Chronicle,
    /// The run so far.
    pub trace: Trace,
    /// Times of the stages.
    pub stages: StageClock,
    /// From sound to command, where audio is live.
    pub latency: Latency,
    /// Motion frames so far.
    pub frames: u64,
    /// Cycles without the motion frame that they needed.
    pub late_frames: u64,
    /// How late cycles began.
    late_ms: Times,
    /// Looks at the servos in every cycle, if wanted.
    pub witness: Option<Witness>,
}

impl<'a> Control<'a> {
    /// A loop that is ready to run.
    pub fn new(
        robot: &'a Robot,
        rig: &'a mut Rig,
        recorder: Option<Recorder>,
        timing: Timing,
        show: Option<&'a mut RobotEnd>,
        stop: &'a AtomicBool,
    ) -> anyhow::Result<Self> {
        let mut retargeter = robot.retargeter()?;
        let joints = robot.servos.len();
        let (as_live, staged) = (timing.as_live, timing.staged);
        let live = (timing.live || as_live) && !staged;
        let delays = Delays::new(robot, &retargeter);
        let live_s = live.then_some(delays.live_s());
        let even_lead_s = match live_s {
            Some(live_s) => -(live_s + retargeter.lookahead_s()),
            None => delays.servo_s,
        };
        let horizon = Horizon {
            preview_s: delays.limits_s,
            servo_lag_s: delays.servo_s,
            live_s,
        };
        let rehearsal = Rehearsal::new(robot.retargeter()?, robot.period_s());
        let steering = Steering::new(rehearsal, horizon, robot.period_s());
        Ok(Self {
            steering: timing.compensation.then_some(steering),
            idle: Idle::new(timing.idle, robot.period_s()),
            lead: Lead::new(even_lead_s),
            motion_s: even_lead_s - PRELUDE_S,
            robot,
            rig,
            targets: retargeter.rest().to_vec(),
            show: show.map(|end| Showing::new(end, &mut retargeter, robot.period_s())),
            activity: Activity::Starting,
            stop_asked: false,
            retargeter,
            stop,
            live: timing.live || as_live,
            staged,
            arrival_s: as_live.then_some(delays.capture_s + COMPUTING_S),
            music_start_s: if staged { 0.0 } else { PRELUDE_S },
            stood_s: 0.0,
            dancing: false,
            clock: CycleClock::new(timing.speed, robot.period_s()),
            newest_s: None,
            captured: None,
            ended: false,
            chronicle: Chronicle::new(recorder),
            trace: Trace::new(joints),
            stages: StageClock::default(),
            latency: Latency::default(),
            frames: 0,
            late_frames: 0,
            late_ms: Times::default(),
            witness: None,
        })
    }

    /// By how much motion is sent ahead of the music.
    pub fn lead(&self) -> Lead {
        self.lead
    }

    /// What the motion asked of the motors so far.
    pub fn effort(&self) -> servodance_retarget::TorqueReport {
        self.retargeter.torque_report()
    }

    /// Seconds that the robot idled.
    pub fn idled_s(&self) -> f64 {
        self.idle.idled_s()
    }

    /// Seconds from torque on to the first cycle of the recording.
    pub fn stood_s(&self) -> f64 {
        self.stood_s
    }

    /// Slowest and fastest pace of the motion so far.
    pub fn paces(&self) -> [f64; 2] {
        self.steering.as_ref().map_or([1.0; 2], Steering::paces)
    }

    /// Robot time at which the music began, seconds from the first cycle; below
    /// zero when live music was there first.
    pub fn music_start_s(&self) -> f64 {
        self.music_start_s
    }

    /// Dances until the music is over or `stop` is set. `on_frame` is told the
    /// time of each new motion frame. Torque is on after this, at rest or held.
    pub fn run(
        &mut self,
        source: &mut MotionSource,
        mut on_frame: impl FnMut(f64),
    ) -> anyhow::Result<Ending> {
        let present: Vec<f64> = self.rig.states().iter().map(|s| s.position_rad).collect();
        self.retargeter.seed(&present)?;
        let waits = self.live && self.arrival_s.is_none() && !self.staged;
        if waits && !self.wait_for_music(source, &mut on_frame)? {
            return Ok(Ending::Interrupted);
        }
        self.stood_s = self.rig.now_s();
        if !self.live || self.staged {
            self.clock.start_at(Instant::now());
        }
        self.dancing = true;
        while !self.is_over() && !self.stop_asked {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(Ending::Interrupted);
            }
            self.pace(); // before the newest is looked at, not after
            self.heed(source)?;
            let time_s = self.time_s();
            self.fetch_motion(source, &mut on_frame)?;
            self.choose_motion_time(time_s, source)?;
            self.retarget()?;
            self.activity = match time_s < 0.0 {
                true => Activity::Prelude,
                false => Activity::Dancing,
            };
            self.drive(time_s)?;
        }
        self.finale(source)
    }

    /// Does what those who watch have asked for since the last cycle.
    fn heed(&mut self, source: &mut MotionSource) -> anyhow::Result<()> {
        let Some(show) = &mut self.show else {
            return Ok(());
        };
        while let Some(request) = show.end.request() {
            request.apply_to(&mut show.end.settings);
            match request {
                ViewerRequest::Hold => show.hold = true,
                ViewerRequest::Resume => show.hold = false,
                ViewerRequest::Stop => {
                    self.stop_asked = true;
                    show.hold = false; // it shall not end with its arms up
                }
                ViewerRequest::Idle(idle) => self.idle.set_style(idle),
                ViewerRequest::Style(style) => source.change(Change::Style(style))?,
                ViewerRequest::Seed(seed) => source.change(Change::Seed(seed))?,
                // Steered to, a little in each cycle.
                ViewerRequest::Amplitude(_) | ViewerRequest::Mirror(_) => {}
                // Only while waiting, or while a recording plays.
                ViewerRequest::Start | ViewerRequest::Release | ViewerRequest::Seek(_) => {}
            }
        }
        self.rig.hold(show.hold);
        show.steer(&mut self.retargeter);
        Ok(())
    }

    /// Lets those who watch see this cycle.
    fn tell_viewers(&mut self) {
        let cycle = Cycle {
            activity: self.activity,
            music_s: self.music_s(),
            idle_share: self.idle.share(),
            late_frames: self.late_frames,
        };
        if let Some(show) = &mut self.show {
            show.show(self.rig, &self.retargeter, cycle);
        }
    }

    /// Lets those who watch see less while the machine is too slow.
    pub fn spare_viewers(&mut self, sparing: &Sparing) {
        if let Some(show) = &mut self.show {
            show.sparing = sparing.clone();
        }
    }

    /// Seconds of music at the present cycle; below zero in the prelude.
    fn time_s(&self) -> f64 {
        self.clock.cycle_s() - self.music_start_s
    }

    /// Where in the music what is decided now belongs.
    fn music_s(&self) -> f64 {
        match self.staged {
            true => self.motion_s - self.lead.even_s(),
            false => self.time_s(),
        }
    }

    /// How late cycles began, milliseconds: 99th percentile and the latest.
    pub fn lateness_ms(&self) -> (f64, f64) {
        let times = self.late_ms.percentiles();
        (times.p99_ms, times.max_ms)
    }

    fn is_over(&self) -> bool {
        self.ended && self.motion_s > self.newest_s.unwrap_or(0.0) + TAIL_S
    }

    /// Which moment of the motion the targets of this cycle show.
    fn choose_motion_time(&mut self, time_s: f64, source: &mut MotionSource) -> anyhow::Result<()> {
        let hidden = self.idle.share() >= 1.0;
        if let MotionSource::Stage(stage) = source {
            let moment = self.clock.moment(time_s);
            self.motion_s = stage.moment_s(moment, hidden) + self.lead.even_s();
            return Ok(());
        }
        self.motion_s = match &mut self.steering {
            Some(steering) => {
                let newest_s = self.newest_s.unwrap_or(f64::NEG_INFINITY);
                let shown_until_s = newest_s - self.retargeter.lookahead_s();
                steering.next(time_s, shown_until_s, hidden)?
            }
            None => time_s + self.lead.even_s(),
        };
        if time_s >= 0.0 {
            self.lead.book(self.motion_s - time_s);
        }
        Ok(())
    }

    /// Live: stands until music comes as it is made, then starts the clock by
    /// its time stamps, the cycles being so placed that each motion frame is
    /// there just before one of them.
    fn wait_for_music(
        &mut self,
        source: &mut MotionSource,
        on_frame: &mut impl FnMut(f64),
    ) -> anyhow::Result<bool> {
        let standing: Vec<f64> = self.rig.sent_rad().to_vec();
        let mut arrivals = Arrivals::default();
        self.activity = Activity::Listening;
        while !self.stop.load(Ordering::Relaxed) {
            self.heed(source)?;
            if self.stop_asked {
                self.targets.copy_from_slice(&standing);
                self.clock.start_at(Instant::now());
                return Ok(true);
            }
            match source.poll()? {
                Next::Step(step) => {
                    self.accept(&step, on_frame);
                    arrivals.note(&step);
                }
                Next::Ended => {
                    self.ended = true;
                    return Ok(true);
                }
                Next::Late | Next::Away => {
                    arrivals.caught_up();
                    if let Some(first) = arrivals.first_cycle(self.robot.period_s()) {
                        std::thread::sleep(first.saturating_duration_since(Instant::now()));
                        self.clock.start_at(first);
                        self.music_start_s = -arrivals.music_s(first);
                        return Ok(true);
                    }
                    self.stand(&standing)?;
                }
            }
        }
        Ok(false)
    }

    /// One cycle in the present pose, so that the servos' watchdogs stay fed.
    fn stand(&mut self, pose_rad: &[f64]) -> anyhow::Result<()> {
        std::thread::sleep(Duration::from_secs_f64(self.robot.period_s()));
        self.rig.cycle(self.clock.elapsed_s(), pose_rad)?;
        self.tell_viewers();
        Ok(())
    }

    /// Takes motion until the next cycle has all that it needs, and steering
    /// all that it can use.
    fn fetch_motion(
        &mut self,
        source: &mut MotionSource,
        on_frame: &mut impl FnMut(f64),
    ) -> anyhow::Result<()> {
        let motion_s = self.motion_s + self.robot.period_s();
        let needed_s = motion_s + self.retargeter.lookahead_s();
        let wanted_s = match (&self.steering, self.arrival_s) {
            _ if self.staged => f64::INFINITY,
            (_, Some(arrival_s)) => self.time_s() - arrival_s - 1.0 / FRAME_RATE_HZ,
            (Some(_), _) if self.live => f64::INFINITY,
            (Some(steering), _) => motion_s + steering.foresight_s(),
            (None, _) => needed_s,
        };
        let lacks = |newest_s: Option<f64>, until_s| newest_s.unwrap_or(FIRST_S) < until_s;
        while !self.ended && lacks(self.newest_s, wanted_s) {
            match source.poll()? {
                Next::Step(step) => self.accept(&step, on_frame),
                Next::Ended => self.ended = true,
                Next::Late => {
                    let late = motion_s >= 0.0 && lacks(self.newest_s, needed_s);
                    self.late_frames += u64::from(late && self.is_due(source));
                    break;
                }
                Next::Away => {
                    self.idle.hear(&MusicFrame {
                        time_s: self.music_s(),
                        ..MusicFrame::default()
                    });
                    break;
                }
            }
        }
        Ok(())
    }

    /// Whether motion is missed where it is not there.
    fn is_due(&self, source: &mut MotionSource) -> bool {
        match source {
            MotionSource::Stage(stage) => stage.is_led() && self.idle.share() < 1.0,
            _ => true,
        }
    }

    fn accept(&mut self, step: &Step, on_frame: &mut impl FnMut(f64)) {
        self.newest_s = Some(step.motion.time_s);
        self.captured = step.captured;
        if self.dancing {
            self.latency.arrived(step);
        }
        self.frames += 1;
        match &step.posture {
            Some(posture) => self.retargeter.push_with_posture(&step.motion, posture),
            None => self.retargeter.push(&step.motion),
        }
        if let Some(steering) = &mut self.steering {
            steering.push(&step.music, &step.motion);
        }
        self.idle.hear(&step.music);
        if let Some(show) = &mut self.show {
            show.hear(&step.music);
        }
        self.trace.motion.push(step.motion);
        self.stages.book(Stage::Features, step.features_ms);
        self.stages.book(Stage::Model, step.model_ms);
        on_frame(step.motion.time_s);
        if self.dancing {
            let at_s = step.motion.time_s + self.music_start_s;
            self.chronicle.frame(at_s, step);
        }
    }

    fn retarget(&mut self) -> anyhow::Result<()> {
        let (time_s, motion_s) = (self.music_s(), self.motion_s);
        let (retargeter, idle) = (&mut self.retargeter, &mut self.idle);
        let (targets, show) = (&mut self.targets, &mut self.show);
        let (result, ms) = self.stages.time(Stage::Retarget, || {
            let alter = |dance| {
                let shown = idle.step(time_s, dance);
                if let Some(show) = show {
                    show.see(shown);
                }
                Some((shown?, 1.0 - idle.share()))
            };
            retargeter.next_altered(motion_s, alter, targets)
        });
        result?;
        self.record_stage(Stage::Retarget, ms);
        Ok(())
    }

    /// One bus cycle with the present targets, then bookkeeping.
    fn drive(&mut self, time_s: f64) -> anyhow::Result<()> {
        failpoint::pass("control");
        let robot_s = self.stood_s + time_s + self.music_start_s;
        let (rig, targets) = (&mut *self.rig, &self.targets);
        let (result, bus_ms) = self.stages.time(Stage::Bus, || rig.cycle(robot_s, targets));
        result?;
        let start = Instant::now();
        if let Some(witness) = &mut self.witness {
            let truth = self.rig.truth().unwrap_or(self.rig.states());
            witness.see(self.idle.share(), truth.iter().map(|s| s.position_rad));
        }
        self.latency.sent(start);
        self.keep(time_s);
        self.tell_viewers();
        self.record_cycle(time_s);
        self.record_stage(Stage::Bus, bus_ms);
        let control_ms = start.elapsed().as_secs_f64() * 1e3;
        self.stages.book(Stage::Control, control_ms);
        self.record_stage(Stage::Control, control_ms);
        self.clock.advance();
        Ok(())
    }

    /// Real time: waits for the moment of this cycle.
    fn pace(&mut self) {
        let Some(late_s) = self.clock.wait() else {
            return;
        };
        if let Some(show) = &mut self.show {
            show.note_late(late_s);
        }
        if self.staged {
            self.late_ms.book(late_s * 1e3);
        }
    }

    /// Cycles between two samples of the trace, about 20 a second.
    pub fn decimation(&self) -> u64 {
        (self.robot.control_hz / FRAME_RATE_HZ).round().max(1.0) as u64
    }

    /// Samples a second of the traces.
    pub fn trace_hz(&self) -> f64 {
        self.robot.control_hz / self.decimation() as f64
    }

    /// Whether the present cycle is one of those that traces keep.
    fn is_sampled(&self) -> bool {
        self.clock.cycle().is_multiple_of(self.decimation())
    }

    fn keep(&mut self, time_s: f64) {
        if time_s >= 0.0 && self.is_sampled() {
            let targets = self.targets.iter().copied();
            self.trace.targets.push(time_s, targets);
            let reported = self.rig.states().iter().map(|s| s.position_rad);
            self.trace.servos.push(time_s, reported);
            if self.live {
                self.trace.keep_newest(LIVE_TRACE_S);
            }
        }
    }

    fn record_cycle(&mut self, time_s: f64) {
        let decided = Decided {
            targets_rad: &self.targets,
            lead_s: self.motion_s - time_s,
            idle_share: self.idle.share(),
            period_s: self.robot.period_s(),
            root: self.is_sampled().then_some(&self.retargeter),
        };
        let at_s = time_s + self.music_start_s;
        self.chronicle.cycle(at_s, self.stood_s, decided, self.rig);
    }

    fn record_stage(&mut self, stage: Stage, ms: f64) {
        let at_s = self.time_s() + self.music_start_s;
        self.chronicle.stage(at_s, stage, ms);
    }

    /// From the last pose to rest along a minimum-jerk path that stays far
    /// inside the limits. A hold is waited for.
    fn finale(&mut self, source: &mut MotionSource) -> anyhow::Result<Ending> {
        self.activity = Activity::Finale;
        let limits = self.robot.servos.iter().map(|servo| &servo.limits);
        let rest = self.retargeter.rest();
        let way = MinimumJerk::new(&self.targets, rest, limits, self.robot.control_hz);
        let mut done = 0;
        while done < way.cycles() || self.is_blending_in() {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(Ending::Interrupted);
            }
            self.pace();
            self.heed(source)?;
            let held = self.show.as_ref().is_some_and(|show| show.hold);
            done = (done + u64::from(!held)).min(way.cycles());
            way.at(done, &mut self.targets);
            self.drive(self.time_s())?;
        }
        Ok(match self.stop_asked {
            true => Ending::Stopped,
            false => Ending::Finished,
        })
    }

    /// Whether the robot is still on its way from where it was held.
    fn is_blending_in(&self) -> bool {
        self.show.is_some() && self.rig.is_ramping()
    }
}
