//! A fault run: a dance in simulation while faults are injected, judged at the
//! servos. Simulated time, all other parts as in any dance.
//!
//! The result is given whether the dance reached its end or not. Nothing is
//! written, nothing is shown.

use crate::control::bus_choice::BusChoice;
use crate::control::control_loop::ControlLoop;
use crate::control::idle::IdleStyle;
use crate::control::robot_buses::{RobotBuses, SimulationPlan};
use crate::control::timing::{LoopOptions, MotionArrival};
use crate::pipeline::audio_input::AudioInput;
use crate::pipeline::dancer::Dancer;
use crate::pipeline::motion_source::MotionSource;
use crate::process::speed::Speed;
use crate::robot::Robot;
use crate::telemetry::report::{SafetyEvent, ViolationReport};
use crate::world::{BodyReport, WorldChoice};
use servodance_audio::song::Song;
use servodance_drivers::EStop;
use servodance_model::{Generator, GeneratorOptions};
use servodance_sim::Cue;
use std::sync::atomic::AtomicBool;

/// After the end the bus is silent for this long, seconds: servos that cannot be
/// reached are stopped by their own watchdogs.
const SILENCE_S: f64 = 1.0;

/// What to dance, and the faults to inject.
#[derive(Clone, Debug)]
pub struct FaultRun<'a> {
    /// The robot whose servos are simulated.
    pub robot: &'a Robot,
    /// The model, loaded once for many runs.
    pub generator: &'a Generator,
    /// The music to dance to.
    pub song: Song,
    /// The world that the servos carry the robot in.
    pub world: WorldChoice,
    /// Faults in the order of time, seconds since torque on.
    pub faults: Vec<Cue>,
    /// Decides the dance, and which replies faults hit.
    pub seed: u64,
    /// Style, if not the default one.
    pub style: Option<String>,
    /// What is done while there is no music.
    pub idle: IdleStyle,
    /// Whether nothing is known ahead, as with live sound.
    pub as_live: bool,
}

/// Result of a fault run.
#[derive(Clone, Debug)]
pub struct FaultRunResult {
    /// Why the dance ended before its time, if it did.
    pub stopped_by: Option<String>,
    /// Seconds of music that were danced to.
    pub music_s: f64,
    /// Robot time of the last cycle, seconds since torque on.
    pub robot_s: f64,
    /// Limits broken, as the simulated servos counted them.
    pub violations: ViolationReport,
    /// The first broken limits, one sentence each.
    pub violation_notes: Vec<String>,
    /// Joints whose servos still drove after the end.
    pub unsafe_joints: Vec<String>,
    /// Control cycles without the motion that they needed.
    pub late_frames: u64,
    /// What the body did in its world until torque off; `None` without one.
    pub body: Option<BodyReport>,
    /// When the robot fell, or its sensor said that it would; seconds since torque on.
    pub fall_s: Option<f64>,
    /// What the safety layer and balance told, in order.
    pub events: Vec<SafetyEvent>,
}

impl<'a> FaultRun<'a> {
    /// A run without faults and without a world: seed 1, default style, music known ahead.
    pub fn new(robot: &'a Robot, generator: &'a Generator, song: Song) -> Self {
        Self {
            robot,
            generator,
            song,
            world: WorldChoice::None,
            faults: Vec::new(),
            seed: 1,
            style: None,
            idle: robot.idle,
            as_live: false,
        }
    }

    /// Dances; fails if the dance cannot begin. `on_frame` gets the time of each
    /// new motion frame; `stop` ends the run early.
    pub fn run(
        self,
        stop: &AtomicBool,
        on_frame: impl FnMut(f64),
    ) -> anyhow::Result<FaultRunResult> {
        let dance = self.generator.start(GeneratorOptions {
            seed: self.seed,
            style: self.style,
            ..GeneratorOptions::default()
        })?;
        let audio = AudioInput::song(self.song);
        // Only live sound gives notices.
        let dancer = Dancer::new(audio, dance, None, Box::new(|_| ()))?;
        let mut source = MotionSource::Inline(Box::new(dancer));
        let plan = SimulationPlan {
            world: self.world,
            faults: self.faults,
            seed: self.seed,
            ..SimulationPlan::default()
        };
        let options = LoopOptions {
            speed: Speed::Max,
            arrival: match self.as_live {
                true => MotionArrival::AsLive,
                false => MotionArrival::Ahead,
            },
            compensation: true,
            idle: self.idle,
        };
        let buses = vec![BusChoice::Sim; self.robot.buses.len()];
        let estop = EStop::default();
        let mut servos =
            RobotBuses::open_simulating(self.robot, &buses, options.speed, &estop, plan)?;
        servos.arm()?;
        let mut control = ControlLoop::new(self.robot, &mut servos, None, options, None, stop)?;
        let ending = control.run(&mut source, on_frame);
        let late_frames = control.into_record().input.late_frames;
        let disarmed = servos.disarm("the end");
        let stopped_by = ending.map(drop).and(disarmed).err();
        let body = servos.body_report();
        servos.advance_silently(SILENCE_S);
        Ok(FaultRunResult {
            stopped_by: stopped_by.map(|error| format!("{error:#}")),
            music_s: source.finish()?.audio_s,
            // A cycle that failed is not counted there.
            robot_s: servos.now_s() + self.robot.period_s() + 1e-9,
            violations: servos.violations().unwrap_or_default(),
            violation_notes: servos.violation_notes(),
            unsafe_joints: servos.unsafe_joints(),
            late_frames,
            body,
            fall_s: servos.fall_s(),
            events: servos.safety_log(),
        })
    }
}
