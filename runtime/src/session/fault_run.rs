//! A dance in simulation while things go wrong, judged at the servos: the whole
//! way from sound to servo in simulated time, the same parts as any dance.
//!
//! What came of it is told whether the dance reached its end or not. Nothing is
//! written, nobody watches.

use crate::control::bus_choice::BusChoice;
use crate::control::control_loop::Control;
use crate::control::idle::IdleStyle;
use crate::control::robot_buses::{Rig, Trial};
use crate::control::timing::Timing;
use crate::pipeline::audio_input::Audio;
use crate::pipeline::motion_source::{Dancer, MotionSource};
use crate::robot::Robot;
use crate::session::config::Speed;
use crate::telemetry::report::ViolationReport;
use servodance_audio::song::Song;
use servodance_drivers::EStop;
use servodance_model::{Generator, GeneratorOptions};
use servodance_sim::Cue;
use std::sync::atomic::AtomicBool;

/// After the end the servos are left alone for this long, seconds: their own
/// watchdogs stop those that cannot be reached.
const AFTERWARDS_S: f64 = 1.0;

/// What a robot is to dance through.
#[derive(Clone, Debug)]
pub struct Ordeal<'a> {
    /// Who dances.
    pub robot: &'a Robot,
    /// Who invents the motion.
    pub generator: &'a Generator,
    /// To what.
    pub song: Song,
    /// What goes wrong, in the order of time: seconds since torque on.
    pub faults: Vec<Cue>,
    /// Decides the dance, and which replies faults hit.
    pub seed: u64,
    /// Style, if not the usual one.
    pub style: Option<String>,
    /// What is done while there is no music.
    pub idle: IdleStyle,
    /// Whether nothing is known ahead, as with live sound.
    pub as_live: bool,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Endured {
    /// Why the dance ended before its time, if it did.
    pub stopped_by: Option<String>,
    /// Seconds of music that were danced to.
    pub music_s: f64,
    /// Robot time of the last cycle, seconds since torque on.
    pub robot_s: f64,
    /// Limits broken, as the simulated servos counted them.
    pub violations: ViolationReport,
    /// The first of them in words.
    pub violation_notes: Vec<String>,
    /// Joints whose servos still drove after the end.
    pub unsafe_joints: Vec<String>,
    /// Control cycles without the motion that they needed.
    pub late_frames: u64,
}

impl Ordeal<'_> {
    /// Dances. `on_frame` is told the time of each new motion frame; `stop`
    /// ends it early.
    ///
    /// # Errors
    /// The dance could not begin.
    pub fn endure(self, stop: &AtomicBool, on_frame: impl FnMut(f64)) -> anyhow::Result<Endured> {
        let dance = self.generator.start(GeneratorOptions {
            seed: self.seed,
            style: self.style,
            ..GeneratorOptions::default()
        })?;
        let audio = Audio::BuiltIn(Box::new(self.song), 0);
        let mut source = MotionSource::Inline(Box::new(Dancer::new(
            audio,
            dance,
            None,
            Box::new(drop_notice),
        )?));
        let trial = Trial {
            faults: self.faults,
            seed: self.seed,
        };
        let timing = Timing {
            speed: Speed::Max,
            live: false,
            as_live: self.as_live,
            compensation: true,
            idle: self.idle,
            staged: false,
        };
        let buses = vec![BusChoice::Sim; self.robot.buses.len()];
        let estop = EStop::default();
        let mut rig = Rig::open_on_trial(self.robot, &buses, timing.speed, &estop, trial)?;
        rig.arm()?;
        let mut control = Control::new(self.robot, &mut rig, None, timing, None, stop)?;
        let ending = control.run(&mut source, on_frame);
        let late_frames = control.late_frames;
        drop(control);
        let disarmed = rig.disarm("the end");
        let stopped_by = ending.map(drop).and(disarmed).err();
        rig.let_be(AFTERWARDS_S);
        Ok(Endured {
            stopped_by: stopped_by.map(|error| format!("{error:#}")),
            music_s: source.heard()?.audio_s,
            // A cycle that failed is not counted there.
            robot_s: rig.now_s() + self.robot.period_s() + 1e-9,
            violations: rig.violations().unwrap_or_default(),
            violation_notes: rig.violation_notes(),
            unsafe_joints: rig.unsafe_joints(),
            late_frames,
        })
    }
}

/// Only live sound gives notice.
fn drop_notice(_: &servodance_audio::capture::CaptureEvent) {}
