//! A dance whose motion comes from the leader of a stage: the same rig,
//! retargeter, idle behaviour and safety layer as in [`crate::session::dance`], without
//! music and without a generator.

use crate::control::bus_choice::{self, BusChoice};
use crate::control::control_loop::{Control, Ending};
use crate::control::idle::IdleStyle;
use crate::control::robot_buses::Rig;
use crate::control::servo_truth_log::Witness;
use crate::control::timing::Timing;
use crate::pipeline::motion_source::MotionSource;
use crate::pipeline::stage_source::StageSource;
use crate::process::realtime::{OrdinaryAfterwards, Role, raise};
use crate::robot::Robot;
use crate::session::config::Speed;
use crate::session::dance::tell_end;
use crate::telemetry::report::{SafetyEvent, ViolationReport};
use crate::viewer::RobotEnd;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Cycles that a witness has room for: ten minutes at 100 a second.
const WITNESSED: usize = 60_000;

/// Who follows, and how.
#[derive(Clone, Debug)]
pub struct FollowConfig {
    /// Who.
    pub robot: Robot,
    /// Where commands go, for each bus of the robot.
    pub buses: Vec<BusChoice>,
    /// What to do while nobody leads.
    pub idle: IdleStyle,
    /// Where it is written when the servos were where, for trials.
    pub witness: Option<PathBuf>,
}

/// What came of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Followed {
    /// Name of the robot.
    pub robot: String,
    /// The bus: `sim`, `serial:PATH`, or `NAME=PORT` for each of several.
    pub bus: String,
    /// Control cycles a second that were asked for.
    pub control_hz: f64,
    /// Motion frames that were danced.
    pub frames: u64,
    /// Control cycles for which motion was due and no frame was there.
    pub late_frames: u64,
    /// The latest control cycle, milliseconds, and the 99th percentile.
    pub late_ms_max: f64,
    /// See `late_ms_max`.
    pub late_ms_p99: f64,
    /// Seconds that the robot idled.
    pub idled_s: f64,
    /// Limits broken at the simulated servos; `null` on a real bus.
    pub violations: Option<ViolationReport>,
    /// How often the safety layer changed a command.
    pub interventions: u64,
    /// What the safety layer did and why, in order.
    pub safety: Vec<SafetyEvent>,
}

/// Follows until `stop` is set. `shared_s` reads the clock that all programs of
/// this machine share.
///
/// # Errors
/// Buses that cannot be opened, servos that fail; torque is off by then.
pub fn follow(
    config: &FollowConfig,
    source: StageSource,
    end: &mut RobotEnd,
    stop: &AtomicBool,
    shared_s: impl Fn() -> f64,
    tell: impl Fn(&str),
) -> anyhow::Result<Followed> {
    let robot = &config.robot;
    let estop = end.estop.clone();
    let afterwards = OrdinaryAfterwards;
    if let Err(not_allowed) = raise(Role::Control) {
        tell(&not_allowed.to_string());
    }
    let mut rig = Rig::open(robot, &config.buses, Speed::Realtime, &estop)?;
    for note in rig.arm()? {
        tell(&note);
    }
    let timing = Timing {
        speed: Speed::Realtime,
        live: true,
        as_live: false,
        compensation: false,
        idle: config.idle,
        staged: true,
    };
    let mut source = MotionSource::Stage(Box::new(source));
    let mut control = Control::new(robot, &mut rig, None, timing, Some(&mut *end), stop)?;
    let joints = robot.servos.len();
    control.witness = config
        .witness
        .is_some()
        .then(|| Witness::new(joints, WITNESSED, shared_s));
    let ending = control.run(&mut source, |_| ());
    let witness = control.witness.take();
    let (late_ms_p99, late_ms_max) = control.lateness_ms();
    let mut followed = Followed {
        robot: robot.name.clone(),
        bus: bus_choice::names(robot, &config.buses),
        control_hz: robot.control_hz,
        frames: control.frames,
        late_frames: control.late_frames,
        late_ms_max,
        late_ms_p99,
        idled_s: control.idled_s(),
        violations: None,
        interventions: 0,
        safety: Vec::new(),
    };
    drop(control);
    let cause = match &ending {
        Ok(Ending::Finished) => "the stage is over",
        Ok(Ending::Stopped) => "stopped on request",
        Ok(Ending::Interrupted) => "stopped by the user",
        Err(_) => "an error",
    };
    let disarmed = rig.disarm(cause);
    end.publish(|snapshot| tell_end(snapshot, &rig));
    drop(afterwards);
    followed.violations = rig.violations();
    followed.interventions = rig.interventions();
    followed.safety = rig.safety_log();
    if let (Some(witness), Some(path)) = (witness, &config.witness) {
        witness.write(path)?;
    }
    ending?;
    disarmed.context("torque off could not be verified: cut the power")?;
    Ok(followed)
}
