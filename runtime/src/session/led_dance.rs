//! A dance whose motion comes from the leader of a stage: the same control loop,
//! retargeter and safety layer as in [`super::dance`], without music and without
//! a generator.

use crate::control::bus_choice::{self, BusChoice};
use crate::control::control_loop::{ControlLoop, Ending, disarm_cause};
use crate::control::idle::IdleStyle;
use crate::control::robot_buses::RobotBuses;
use crate::control::servo_truth_log::ServoTruthLog;
use crate::control::timing::{LoopOptions, MotionArrival};
use crate::control::viewer_link::{arm_watched, publish_end};
use crate::pipeline::motion_source::MotionSource;
use crate::pipeline::stage_source::StageSource;
use crate::process::realtime::{OrdinaryAfterwards, ThreadRole, raise};
use crate::process::speed::Speed;
use crate::robot::Robot;
use crate::session::dance_report::recording_facts;
use crate::telemetry::recorder::Recorder;
use crate::telemetry::report::{SafetyEvent, ViolationReport};
use crate::viewer::{Activity, RobotEnd};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use servodance_drivers::EStop;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Cycles that the servo truth log has room for: ten minutes at 100 a second.
const LOGGED_CYCLES: usize = 60_000;
/// How often a follower without a leader looks for one.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// The robot that is led, and its buses.
#[derive(Clone, Debug)]
pub struct FollowConfig {
    /// The robot that dances.
    pub robot: Robot,
    /// Where commands go, for each bus of the robot.
    pub buses: Vec<BusChoice>,
    /// What to do while there is no leader.
    pub idle: IdleStyle,
    /// Where the servo truth log goes, for tests of many robots side by side.
    pub servo_truth: Option<PathBuf>,
}

/// Result of a led dance.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[allow(missing_docs)] // the other names say it
pub struct LedDanceResult {
    pub robot: String,
    /// The bus: `sim`, `serial:PATH`, or `NAME=PORT` for each of several.
    pub bus: String,
    /// Control cycles a second that were asked for.
    pub control_hz: f64,
    pub frames: u64,
    /// Control cycles for which motion was due and no frame was there.
    pub late_frames: u64,
    /// Lateness of the latest control cycle, milliseconds.
    pub late_ms_max: f64,
    /// Lateness of control cycles, 99th percentile, milliseconds.
    pub late_ms_p99: f64,
    pub idled_s: f64,
    /// Limits broken at the simulated servos; `null` on a real bus.
    pub violations: Option<ViolationReport>,
    /// How often the safety layer changed a command.
    pub interventions: u64,
    /// What the safety layer did and why, in order.
    pub safety: Vec<SafetyEvent>,
}

/// Waits with torque off for the first leader; `false` if the user stopped it.
fn wait_for_leader(source: &mut StageSource, stop: &AtomicBool, estop: &EStop) -> bool {
    while !source.is_led() && !estop.is_pressed() {
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        std::thread::sleep(LOOK_AGAIN);
    }
    true
}

/// Follows until `stop` is set; torque is off until the first leader is heard. `shared_s` reads the clock that all programs of
/// this machine share; `note` gets lines for the user, `recorder` all that happens.
pub fn follow(
    config: &FollowConfig,
    mut source: StageSource,
    recorder: Option<Recorder>,
    viewers: &mut RobotEnd,
    stop: &AtomicBool,
    shared_s: impl Fn() -> f64,
    note: impl Fn(&str),
) -> anyhow::Result<LedDanceResult> {
    let robot = &config.robot;
    let estop = viewers.estop.clone();
    let afterwards = OrdinaryAfterwards;
    if let Err(not_allowed) = raise(ThreadRole::Control) {
        note(&not_allowed.to_string());
    }
    let options = LoopOptions {
        speed: Speed::Realtime,
        arrival: MotionArrival::Led,
        compensation: false,
        idle: config.idle,
    };
    let mut servos = RobotBuses::open(robot, &config.buses, options.speed, &estop)?;
    viewers.publish(|snapshot| snapshot.now.activity = Activity::Listening);
    // A stop that was pressed meanwhile keeps it from arming, and says so.
    let is_led = wait_for_leader(&mut source, stop, &estop);
    if is_led {
        for text in arm_watched(&mut servos, Some(&mut *viewers))? {
            note(&text);
        }
    }
    let mut source = MotionSource::Stage(Box::new(source));
    let link = Some(&mut *viewers);
    let mut control = ControlLoop::new(robot, &mut servos, recorder, options, link, stop)?;
    control.log.servo_truth = config
        .servo_truth
        .is_some()
        .then(|| ServoTruthLog::new(robot.servos.len(), LOGGED_CYCLES, shared_s));
    let ending = match is_led {
        true => control.run(&mut source, |_| ()),
        false => Ok(Ending::Interrupted),
    };
    let mut run = control.into_record();
    let disarmed = servos.disarm(disarm_cause(&ending, "the stage is over"));
    publish_end(viewers, &servos);
    drop(afterwards);
    if let (Some(log), Some(path)) = (&run.log.servo_truth, &config.servo_truth) {
        log.write(path)?;
    }
    let stood_s = run.clock.stood_s;
    run.log.recorder.changes(servos.now_s() - stood_s, stood_s, &servos);
    let recorder = std::mem::take(&mut run.log.recorder).into_recorder();
    let recorded = recorder.map_or(Ok(()), |mut recorder| {
        recorder.metadata(recording_facts(robot, run.clock.music_start_s)?);
        recorder.finish()
    });
    ending?;
    disarmed.context("torque off could not be verified: cut the power")?;
    recorded?;
    let lateness = run.log.lateness.percentiles();
    Ok(LedDanceResult {
        robot: robot.name.clone(),
        bus: bus_choice::names(robot, &config.buses),
        control_hz: robot.control_hz,
        frames: run.input.frames,
        late_frames: run.input.late_frames,
        late_ms_max: lateness.max_ms,
        late_ms_p99: lateness.p99_ms,
        idled_s: run.plan.idle.idled_s(),
        violations: servos.violations(),
        interventions: servos.interventions(),
        safety: servos.safety_log(),
    })
}
