//! `servodance dance`: from a recording to moving servos and back to rest.
//!
//! ```text
//! audio -> features -> generator -> retargeter -> limits -> bus -> servos
//!          |---- motion source ----|----------- control loop -----------|
//! ```
//!
//! Everything that can be refused is refused before torque is turned on, and
//! every way out, an error or Ctrl-C too, turns it off again.

use crate::control::control_loop::{Control, Ending};
use crate::control::emergency_stop::EStopWatch;
use crate::control::latency::LatencyReport;
use crate::control::lead_time::Lead;
use crate::control::recorder_feed::Chronicle;
use crate::control::robot_buses::Rig;
use crate::control::timing::Timing;
use crate::control::{bus_choice, trace};
use crate::pipeline::audio_input::Audio;
use crate::pipeline::load_shedding::{LeftOut, Overload, Sparing};
use crate::pipeline::motion_source::{Dancer, DancerThread, Heard, MotionSource};
use crate::pipeline::step_times::{Stage, StageClock};
use crate::process::progress::Progress;
use crate::process::realtime::{OrdinaryAfterwards, Role, raise};
use crate::session::beat_scores as scores;
use crate::session::config::{AudioChoice, DanceConfig, Speed};
use crate::session::{animation, plot_selection, uncompensated_replay as shadow};
use crate::telemetry::pending_file::{PendingFile, write_whole};
use crate::telemetry::recorder::{Recorder, RecordingTopic, WhenBehind};
use crate::telemetry::report::{
    AlignmentReport, CaptureReport, CompensationReport, DanceReport, KinematicBeats, PipelineTimes,
};
use crate::viewer::{Activity, RobotEnd, snapshot};
use anyhow::Context;
use servodance_audio::capture::CaptureEvent;
use servodance_drivers::EStop;
use servodance_model::engine::EngineOptions;
use servodance_model::{Generator, GeneratorOptions};
use servodance_retarget::TorqueReport;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What came of a dance.
#[derive(Debug)]
pub struct Outcome {
    /// All figures.
    pub report: DanceReport,
    /// Whether the user stopped it before the music was over.
    pub interrupted: bool,
}

/// Dances. `stop` may be set at any time (by Ctrl-C, say) to end it early.
///
/// # Errors
/// Whatever the user gave that cannot be used, and whatever failed on the way;
/// torque is off by then.
pub fn dance(config: &DanceConfig, stop: &AtomicBool) -> anyhow::Result<Outcome> {
    let generator = open_generator(config.model.as_deref(), config.engine)?;
    let estop = EStop::default();
    let _watch = watch(config, &estop)?;
    perform(config, &generator, stop, &estop, None)
}

/// Watches the emergency stop's key, signal and file.
pub(crate) fn watch(config: &DanceConfig, estop: &EStop) -> anyhow::Result<EStopWatch> {
    // The terminal view reads the keys itself.
    let keyboard = !matches!(config.audio, AudioChoice::Stdin(_)) && !config.tui;
    EStopWatch::start(estop, config.estop_file.clone(), keyboard)
}

/// One dance, for those who watch, if there are any.
pub(crate) fn perform(
    config: &DanceConfig,
    generator: &Generator,
    stop: &AtomicBool,
    estop: &EStop,
    mut show: Option<&mut RobotEnd>,
) -> anyhow::Result<Outcome> {
    // Each thread inherits what it is started under.
    let afterwards = OrdinaryAfterwards;
    let urgent = |role| match config.speed {
        Speed::Max => Ok(()),
        Speed::Realtime => raise(role),
    };
    let allowed = urgent(Role::Capture);
    let audio = Audio::open(&config.audio, config.speed)?;
    let _ = urgent(Role::Model); // told once, below
    let audio_s = audio.duration_s();
    let timing = Timing {
        speed: config.speed,
        live: config.audio.is_live(config.speed),
        as_live: config.as_live,
        compensation: config.compensation,
        idle: config.idle,
        staged: false,
    };
    let model = generator.config().preset.clone();
    let encodec = config.conditioning.encodec(generator)?;
    let style_vector = match &config.style {
        Some(_) => None, // chosen by somebody who watches
        None => config.conditioning.style_vector(generator)?,
    };
    let generator = generator.start(GeneratorOptions {
        seed: config.seed,
        style: config.style.clone(),
        style_vector,
        ..GeneratorOptions::default()
    })?;
    let picture = config.picture.as_deref().map(PendingFile::create);
    drop(picture.transpose()?); // only to learn early whether it can be written
    let film = config.gif.as_deref().map(PendingFile::create);
    drop(film.transpose()?);
    let report_file = config.report.as_deref().map(PendingFile::create);
    drop(report_file.transpose()?);
    let progress = Progress::new(audio_s, config.quiet);
    let recorder = open_recorder(config, &progress)?;
    if let Err(not_allowed) = allowed {
        progress.note(&not_allowed.to_string());
    }
    let notes = progress.clone();
    let on_notice = Box::new(move |notice: &CaptureEvent| notes.note(&notice.to_string()));
    let mut dancer = Dancer::new(audio, generator, encodec.as_ref(), on_notice)?;
    let sparing = Sparing::default();
    if config.speed == Speed::Realtime {
        let notes = progress.clone();
        let on_change = Box::new(move |what: &str| notes.note(what));
        dancer = dancer.sparing(Overload::new(sparing.clone(), on_change));
    }
    dancer.prime()?;
    let mut source = match config.speed {
        Speed::Max => MotionSource::Inline(Box::new(dancer)),
        Speed::Realtime => MotionSource::Thread(DancerThread::start(dancer)?),
    };
    let _ = urgent(Role::Control);
    let started = Instant::now();
    let mut rig = Rig::open(&config.robot, &config.buses, config.speed, estop)?;
    for note in rig.arm()? {
        progress.note(&note);
    }
    let audience = show.as_deref_mut();
    let mut control = Control::new(&config.robot, &mut rig, recorder, timing, audience, stop)?;
    control.spare_viewers(&sparing);
    let ending = control.run(&mut source, |time_s| progress.at(time_s));
    let mut run = Run {
        lead: control.lead(),
        paces: control.paces(),
        idled_s: control.idled_s(),
        decimation: control.decimation(),
        music_start_s: control.music_start_s(),
        trace_hz: control.trace_hz(),
        chronicle: std::mem::take(&mut control.chronicle),
        stood_s: control.stood_s(),
        frames: control.frames,
        late_frames: control.late_frames,
        stages: std::mem::take(&mut control.stages),
        latency: control.latency.report(),
        effort: control.effort(),
        trace: std::mem::replace(&mut control.trace, trace::Trace::new(0)),
    };
    drop(control);
    let cause = match &ending {
        Ok(Ending::Finished) => "the music is over",
        Ok(Ending::Stopped) => "stopped on request",
        Ok(Ending::Interrupted) => "stopped by the user",
        Err(_) => "an error",
    };
    let disarmed = rig.disarm(cause);
    if let Some(end) = show {
        end.publish(|snapshot| tell_end(snapshot, &rig));
    }
    for event in rig.safety_log().iter().filter(|event| !event.routine) {
        progress.note(&format!(
            "{:.2} s, {} -> {}: {}",
            event.time_s, event.from, event.to, event.cause
        ));
    }
    let last_s = rig.now_s() - run.stood_s;
    run.chronicle.changes(last_s, run.stood_s, &rig);
    let ending = ending?; // the first error is the one to tell
    disarmed.context("torque off could not be verified: cut the power")?;
    let wall_s = started.elapsed().as_secs_f64();
    drop(afterwards);
    progress.done();

    let heard = source.heard()?;
    let mut report = report(config, &run, &rig, &heard, model, wall_s);
    report.left_out = sparing.names();
    judge(config, &run, &mut report)?;
    let recorded = finish_recording(config, run.chronicle, &report, run.music_start_s);
    if let Some(path) = &config.report {
        report.write(path)?;
    }
    let wanted = config.picture.as_ref();
    if let Some(path) = wanted.filter(|_| sparing.most() < LeftOut::Picture) {
        let picture = plot_selection::portrait(config, &run.trace, run.trace_hz, &report)?;
        write_whole(path, &picture.png()?)?;
    }
    if let Some(path) = &config.gif {
        animation::film(config, &run.trace, run.lead.mean_s(), &report, path)?;
    }
    recorded?;
    if let Some(counted) = report.violations.filter(|v| *v != Default::default()) {
        anyhow::bail!(
            "the simulated servos saw limits broken: {} position, {} velocity, {} acceleration; first: {}",
            counted.position,
            counted.velocity,
            counted.acceleration,
            rig.violation_notes().first().cloned().unwrap_or_default()
        );
    }
    Ok(Outcome {
        report,
        interrupted: ending == Ending::Interrupted,
    })
}

/// The last that is seen of a dance: torque is off, and why.
pub(crate) fn tell_end(snapshot: &mut snapshot::Snapshot, rig: &Rig) {
    snapshot.now.activity = Activity::Over;
    snapshot.now.safety = rig.state();
    let transitions = rig.transitions();
    for event in &transitions[transitions.len().saturating_sub(2)..] {
        snapshot.push_event(snapshot::ViewerEvent {
            time_s: event.time_s,
            state: snapshot::state_name(event.to),
            cause: event.cause.clone(),
        });
    }
}

/// What the control loop leaves behind.
struct Run {
    lead: Lead,
    paces: [f64; 2],
    idled_s: f64,
    decimation: u64,
    music_start_s: f64,
    trace_hz: f64,
    chronicle: Chronicle,
    stood_s: f64,
    frames: u64,
    late_frames: u64,
    stages: StageClock,
    latency: Option<LatencyReport>,
    effort: TorqueReport,
    trace: trace::Trace,
}

/// The weights in a file, or those that are built in.
pub fn open_generator(model: Option<&Path>, engine: EngineOptions) -> anyhow::Result<Generator> {
    Ok(match model {
        Some(path) => Generator::load_with(path, engine)?,
        None => Generator::built_in_with(engine)?,
    })
}

/// The recording, if one is asked for, begun with the robot's description.
fn open_recorder(config: &DanceConfig, progress: &Progress) -> anyhow::Result<Option<Recorder>> {
    let Some(path) = &config.record else {
        return Ok(None);
    };
    let joint_names = config.robot.servos.iter().map(|s| s.name.clone()).collect();
    let when_behind = match config.speed {
        Speed::Max => WhenBehind::Wait,
        Speed::Realtime => WhenBehind::LeaveOut,
    };
    let notes = progress.clone();
    let on_error = Box::new(move |text: &str| notes.note(text));
    let mut recorder = Recorder::create(path, joint_names, when_behind, on_error)?;
    recorder.text(
        RecordingTopic::RobotDescription,
        0.0,
        &config.robot.urdf_xml,
    );
    Ok(Some(recorder))
}

fn report(
    config: &DanceConfig,
    run: &Run,
    rig: &Rig,
    heard: &Heard,
    model: String,
    wall_s: f64,
) -> DanceReport {
    let times = |stage| run.stages.times(stage);
    DanceReport {
        version: DanceReport::version_string(),
        audio_s: heard.audio_s,
        frames: run.frames,
        tokens: run.frames * heard.tokens_per_frame,
        seed: config.seed,
        model,
        style: (config.style.clone()).or(config.conditioning.style_text.clone()),
        robot: config.robot.name.clone(),
        bus: bus_choice::names(&config.robot, &config.buses),
        wall_s,
        realtime_factor: heard.audio_s / wall_s.max(1e-9),
        stages: PipelineTimes {
            features: times(Stage::Features),
            model: times(Stage::Model),
            retarget: times(Stage::Retarget),
            control: times(Stage::Control),
            bus: times(Stage::Bus),
        },
        bus_stats: rig.bus_report(),
        violations: rig.violations(),
        alignment: AlignmentReport::default(),
        beats: crate::telemetry::report::BeatReport {
            tempo_bpm: heard.beats.tempo_bpm,
            times_s: heard.beats.times_s.clone(),
        },
        late_frames: run.late_frames,
        left_out: Vec::new(),
        latency_ms: run.latency,
        capture: heard.capture.map(CaptureReport::from),
        interventions: rig.interventions(),
        effort: run.effort.clone().into(),
        safety: rig.safety_log(),
        replaced_music_frames: heard.replaced_music_frames,
        lead_s: run.lead.mean_s(),
        idled_s: run.idled_s,
        compensation: CompensationReport::default(),
        kinematic_beats_s: KinematicBeats::default(),
    }
}

/// How well the beat was met along the way; without compensation too, if a
/// report of it is asked for.
fn judge(config: &DanceConfig, run: &Run, report: &mut DanceReport) -> anyhow::Result<()> {
    let music_s = &report.beats.times_s;
    let generator = scores::Speed::of_dancer(&run.trace.motion);
    let targets = scores::Speed::of_joints(&run.trace.targets, run.trace_hz);
    let servos = scores::Speed::of_joints(&run.trace.servos, run.trace_hz);
    report.alignment = AlignmentReport {
        generator: generator.scores(music_s),
        targets: targets.scores(music_s),
        servos: servos.scores(music_s),
    };
    report.kinematic_beats_s = KinematicBeats {
        generator: generator.beats_s(),
        targets: targets.beats_s(),
        servos: servos.beats_s(),
        off_servos: Vec::new(),
    };
    report.compensation.on = config.compensation;
    report.compensation.pace = run.paces;
    if config.compensation && config.report.is_some() {
        let motion = &run.trace.motion;
        let shadow = shadow::shadow(&config.robot, motion, run.lead.even_s(), run.decimation)?;
        let targets = scores::Speed::of_joints(&shadow.targets, run.trace_hz);
        let servos = scores::Speed::of_joints(&shadow.servos, run.trace_hz);
        report.compensation.off_targets = Some(targets.scores(music_s));
        report.compensation.off_servos = Some(servos.scores(music_s));
        report.kinematic_beats_s.off_servos = servos.beats_s();
    }
    Ok(())
}

/// Writes the beats and the facts that a reader needs to check the report.
fn finish_recording(
    config: &DanceConfig,
    chronicle: Chronicle,
    report: &DanceReport,
    music_start_s: f64,
) -> anyhow::Result<()> {
    let Some(mut recorder) = chronicle.into_recorder() else {
        return Ok(());
    };
    for time_s in &report.beats.times_s {
        recorder.number(
            RecordingTopic::Beat,
            time_s + music_start_s,
            report.beats.tempo_bpm,
        );
    }
    let limits: Vec<serde_json::Value> = config
        .robot
        .servos
        .iter()
        .map(|servo| {
            serde_json::json!({
                "name": servo.name,
                "lower_rad": servo.limits.lower_rad,
                "upper_rad": servo.limits.upper_rad,
                "velocity_rad_s": servo.limits.velocity_rad_s,
                "acceleration_rad_s2": servo.limits.acceleration_rad_s2,
                "tick_rad": servo.model.rad_per_tick,
            })
        })
        .collect();
    recorder.metadata(BTreeMap::from([
        ("music_start_s".to_owned(), music_start_s.to_string()),
        ("audio_s".to_owned(), report.audio_s.to_string()),
        ("control_hz".to_owned(), config.robot.control_hz.to_string()),
        ("robot".to_owned(), report.robot.clone()),
        ("model".to_owned(), report.model.clone()),
        ("seed".to_owned(), report.seed.to_string()),
        ("joints".to_owned(), serde_json::to_string(&limits)?),
    ]));
    recorder.finish()
}
