//! One dance: from sound to moving servos and back to rest.
//!
//! Everything that can be refused is refused before torque is turned on, and
//! every way out, an error or Ctrl-C too, turns it off again.

use super::config::DanceConfig;
use super::dance_report::{dance_report, finish_recording};
use super::dance_verdict::verdict;
use super::{animation, plot_selection};
use crate::control::control_loop::{ControlLoop, Ending, LoopRecord, disarm_cause};
use crate::control::emergency_stop::EmergencyStopWatch;
use crate::control::robot_buses::{RobotBuses, SimulationPlan};
use crate::control::viewer_link::{arm_watched, publish_end};
use crate::pipeline::audio_input::{AudioChoice, AudioInput};
use crate::pipeline::dancer::Dancer;
use crate::pipeline::dancer_thread::DancerThread;
use crate::pipeline::load_shedding::{LeftOut, LoadShedding, OverloadWatch};
use crate::pipeline::model_args::EngineArgs;
use crate::pipeline::motion_source::MotionSource;
use crate::pipeline::song_sound::song_sound;
use crate::pipeline::speaker::PlayedSong;
use crate::process::progress::Progress;
use crate::process::realtime::{NotAllowed, OrdinaryAfterwards, ThreadRole, raise};
use crate::process::speed::Speed;
use crate::robot::Robot;
use crate::telemetry::pending_file::{PendingFile, write_whole};
use crate::telemetry::recorder::{Recorder, RecordingTopic, WhenBehind};
use crate::telemetry::report::{DanceReport, SafetyEvent};
use crate::viewer::RobotEnd;
use anyhow::Context;
use servodance_audio::capture::CaptureEvent;
use servodance_audio::playback::Sound;
use servodance_drivers::{EStop, State};
use servodance_model::Generator;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Result of a dance.
#[derive(Debug)]
pub struct Outcome {
    /// All figures, as `--report` writes them.
    pub report: DanceReport,
    /// Whether the user stopped it before the music was over.
    pub interrupted: bool,
    /// Whether dead-man mode ended it: no operator was there.
    pub unattended: bool,
}

/// Dances. `stop` may be set at any time (by Ctrl-C, say) to end it early.
pub fn dance(config: &DanceConfig, stop: &AtomicBool) -> anyhow::Result<Outcome> {
    let generator = open_generator(config.generator.model.as_deref(), config.generator.engine)?;
    let estop = EStop::default();
    let _watch = watch_emergency_stop(config, &estop)?;
    let prepared = prepare(config, &generator, stop, &estop)?;
    perform(config, &generator, prepared, stop, &estop, None)
}

/// The weights in a file, or those that are built in.
pub fn open_generator(model: Option<&Path>, engine: EngineArgs) -> anyhow::Result<Generator> {
    let engine = engine.options();
    Ok(match model {
        Some(path) => Generator::load_with(path, engine)?,
        None => Generator::built_in_with(engine)?,
    })
}

/// Watches the emergency stop's key, signal and file.
pub(super) fn watch_emergency_stop(
    config: &DanceConfig,
    estop: &EStop,
) -> anyhow::Result<EmergencyStopWatch> {
    // The terminal view reads the keys itself.
    let keyboard = !matches!(config.audio, AudioChoice::Stdin(_)) && !config.tui;
    EmergencyStopWatch::start(estop, config.estop_file.clone(), keyboard)
}

/// One dance that was prepared; `viewers` is the link to those who watch, if there are any.
pub(super) fn perform(
    config: &DanceConfig,
    generator: &Generator,
    prepared: Prepared,
    stop: &AtomicBool,
    estop: &EStop,
    mut viewers: Option<&mut RobotEnd>,
) -> anyhow::Result<Outcome> {
    let Prepared { mut source, recorder, song, progress, shedding, afterwards } = prepared;
    let played = match &config.speaker {
        Some(_) if !config.audio.is_recording() => None, // it is heard already
        Some(speaker) => Some(PlayedSong::open(speaker, &config.audio)?),
        None => None,
    };
    let _ = raise_in(config.speed, ThreadRole::Control);
    let started = Instant::now();
    let plan = SimulationPlan { world: config.world, ..SimulationPlan::default() };
    let mut servos =
        RobotBuses::open_simulating(&config.robot, &config.buses, config.speed, estop, plan)?;
    let mut events = servos.listen();
    arm(&mut servos, viewers.as_deref_mut(), &progress)?;
    let mut control = ControlLoop::new(
        &config.robot,
        &mut servos,
        recorder,
        config.loop_options(),
        viewers.as_deref_mut(),
        stop,
    )?;
    control.shed_viewers(&shedding);
    if let Some(song) = song {
        control.log.recorder.record_song(song);
    }
    control.log.motion.clone_from(&config.motion_log);
    if let Some(played) = &played {
        control.play(played.start.clone());
    }
    let ending = control.run(&mut source, |time_s| {
        progress.at(time_s);
        note_safety_events(&mut events, &progress);
    });
    let mut run = control.into_record();
    let disarmed = servos.disarm(disarm_cause(&ending, "the music is over"));
    if played.is_some_and(|played| played.is_gone()) {
        progress.note("the loudspeaker went away: the rest was danced in silence");
    }
    if let Some(viewers) = viewers {
        publish_end(viewers, &servos);
    }
    note_safety_events(&mut events, &progress);
    let stood_s = run.clock.stood_s;
    let last_s = servos.now_s() - stood_s;
    run.log.recorder.changes(last_s, stood_s, &servos);
    let wall_s = started.elapsed().as_secs_f64();
    drop(afterwards);
    progress.done();

    // What went wrong is seen best in what was recorded until then.
    let report = source.finish().and_then(|music| {
        if let Some(damage) = &music.damage {
            progress.note(damage);
        }
        let mut report = dance_report(config, &run, &servos, &music, wall_s)?;
        report.model.clone_from(&generator.config().preset);
        report.left_out = shedding.names();
        let recorder = std::mem::take(&mut run.log.recorder).into_recorder();
        write_files(config, &run, recorder, &report, shedding.most())?;
        Ok(report)
    });
    let ending = ending?; // the first error is the one to report
    disarmed.context("torque off could not be verified: cut the power")?;
    let report = report?;
    verdict(config, &report, &run.log.trace, &servos)?;
    Ok(Outcome {
        report,
        interrupted: ending == Ending::Interrupted,
        unattended: ending == Ending::Unattended,
    })
}

fn arm(
    servos: &mut RobotBuses,
    mut viewers: Option<&mut RobotEnd>,
    progress: &Progress,
) -> anyhow::Result<()> {
    if let Some(viewers) = viewers.as_deref_mut() {
        viewers.publish(|snapshot| snapshot.now.safety = State::Arming);
    }
    for note in arm_watched(servos, viewers)? {
        progress.note(&note);
    }
    Ok(())
}

/// The recording, the report and the pictures that are asked for.
fn write_files(
    config: &DanceConfig,
    run: &LoopRecord,
    recorder: Option<Recorder>,
    report: &DanceReport,
    left_out: LeftOut,
) -> anyhow::Result<()> {
    let recorded = finish_recording(config, recorder, report, run.clock.music_start_s);
    if let Some(path) = &config.report {
        report.write(path)?;
    }
    let log = &run.log;
    if let Some(path) = config.picture.as_ref().filter(|_| left_out < LeftOut::Picture) {
        let picture = plot_selection::plot(config, &log.trace, log.trace_hz(), report)?;
        write_whole(path, &picture.png()?)?;
    }
    if let Some(path) = &config.gif {
        animation::write(config, &log.trace, run.plan.lead.mean_s(), report, path)?;
    }
    recorded
}

/// The song for the recording, if there is one; a song that is too long is left out.
fn recorded_song(config: &DanceConfig, progress: &Progress) -> Option<Sound> {
    config.record.as_ref()?;
    if !config.audio.is_recording() {
        return None;
    }
    let song = song_sound(&config.audio);
    let left_out = |error| progress.note(&format!("the recording is without sound: {error:#}"));
    song.map_err(left_out).ok()
}

/// What a dance needs before the buses are opened.
pub(super) struct Prepared {
    source: MotionSource,
    recorder: Option<Recorder>,
    /// For the recording; decoding takes long, so it is done before torque is on.
    song: Option<Sound>,
    progress: Progress,
    shedding: LoadShedding,
    afterwards: OrdinaryAfterwards,
}

/// Opens audio, generator and files; refuses what cannot be used. Live sound is waited for
/// until `stop` is set or `estop` pressed.
pub(super) fn prepare(
    config: &DanceConfig,
    generator: &Generator,
    stop: &AtomicBool,
    estop: &EStop,
) -> anyhow::Result<Prepared> {
    // Each thread inherits the priority that it is started under.
    let afterwards = OrdinaryAfterwards;
    let allowed = raise_in(config.speed, ThreadRole::Capture);
    let audio = AudioInput::open(&config.audio, config.speed)?;
    let _ = raise_in(config.speed, ThreadRole::Model); // a refusal is reported once, below
    let audio_s = audio.duration_s();
    let encodec = config.generator.conditioning.encodec(generator)?;
    let generator = generator.start(config.generator.options(generator)?)?;
    for path in [&config.picture, &config.gif, &config.report] {
        let file = path.as_deref().map(PendingFile::create);
        drop(file.transpose()?); // only to learn early whether it can be written
    }
    let progress = Progress::new(audio_s, config.quiet);
    let record = config.record.as_deref();
    let recorder = open_recorder(record, &config.robot, config.speed, &progress)?;
    let song = recorded_song(config, &progress);
    if let Err(not_allowed) = allowed {
        progress.note(&not_allowed.to_string());
    }
    let notes = progress.clone();
    let on_notice = Box::new(move |notice: &CaptureEvent| notes.note(&notice.to_string()));
    let mut dancer = Dancer::new(audio, generator, encodec.as_ref(), on_notice)?;
    if let Some(tempo) = config.tempo {
        dancer.limit_tempo(tempo);
    }
    let shedding = LoadShedding::default();
    if config.speed == Speed::Realtime {
        let notes = progress.clone();
        let on_change = Box::new(move |text: &str| notes.note(text));
        dancer = dancer.shedding(OverloadWatch::new(shedding.clone(), on_change));
    }
    dancer.prime(stop, estop)?;
    let source = match config.speed {
        Speed::Max => MotionSource::Inline(Box::new(dancer)),
        Speed::Realtime => MotionSource::Thread(DancerThread::start(dancer)?),
    };
    Ok(Prepared { source, recorder, song, progress, shedding, afterwards })
}

fn raise_in(speed: Speed, role: ThreadRole) -> Result<(), NotAllowed> {
    match speed {
        Speed::Max => Ok(()),
        Speed::Realtime => raise(role),
    }
}

/// The recording, if one is asked for, begun with the robot's description.
pub(crate) fn open_recorder(
    record: Option<&Path>,
    robot: &Robot,
    speed: Speed,
    progress: &Progress,
) -> anyhow::Result<Option<Recorder>> {
    let Some(path) = record else {
        return Ok(None);
    };
    let joint_names = robot.servos.iter().map(|s| s.name.clone()).collect();
    let when_behind = match speed {
        Speed::Max => WhenBehind::Wait,
        Speed::Realtime => WhenBehind::LeaveOut,
    };
    let notes = progress.clone();
    let on_error = Box::new(move |text: &str| notes.note(text));
    let mut recorder = Recorder::create(path, joint_names, when_behind, on_error)?;
    recorder.text(RecordingTopic::RobotDescription, 0.0, &robot.urdf_xml);
    Ok(Some(recorder))
}

fn note_safety_events(events: &mut impl Iterator<Item = SafetyEvent>, progress: &Progress) {
    for event in events.by_ref().filter(|event| !event.routine) {
        progress.note(&format!(
            "{:.2} s, {} -> {}: {}",
            event.time_s, event.from, event.to, event.cause
        ));
    }
}
