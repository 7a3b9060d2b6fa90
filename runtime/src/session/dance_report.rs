//! The report of a dance, and the facts that end its recording.

use super::beat_scores::JointSpeed;
use super::config::DanceConfig;
use super::uncompensated_replay;
use crate::control::bus_choice;
use crate::control::control_loop::LoopRecord;
use crate::control::robot_buses::RobotBuses;
use crate::pipeline::dance_step::MusicSummary;
use crate::pipeline::step_times::PipelineStep;
use crate::robot::Robot;
use crate::telemetry::recorder::Recorder;
use crate::telemetry::report::{
    AlignmentReport, BeatReport, CaptureReport, CompensationReport, DanceReport, KinematicBeats,
    PipelineTimes, StepFigures,
};
use servodance_retarget::Stance;
use std::collections::BTreeMap;

/// All figures of a dance, without the model and without what was left out.
pub fn dance_report(
    config: &DanceConfig,
    run: &LoopRecord,
    servos: &RobotBuses,
    music: &MusicSummary,
    wall_s: f64,
) -> anyhow::Result<DanceReport> {
    let asked = &config.generator;
    let times = |step| run.log.steps.times(step);
    let mut report = DanceReport {
        version: DanceReport::version_string(),
        audio_s: music.audio_s,
        frames: run.input.frames,
        tokens: run.input.frames * music.tokens_per_frame,
        seed: asked.seed,
        model: String::new(),
        style: asked.style.clone().or(asked.conditioning.style_text.clone()),
        robot: config.robot.name.clone(),
        bus: bus_choice::names(&config.robot, &config.buses),
        wall_s,
        realtime_factor: music.audio_s / wall_s.max(1e-9),
        stages: PipelineTimes {
            features: times(PipelineStep::Features),
            model: times(PipelineStep::Model),
            retarget: times(PipelineStep::Retarget),
            control: times(PipelineStep::Control),
            bus: times(PipelineStep::Bus),
        },
        bus_stats: servos.bus_report(),
        cycle_gaps: servos.cycle_gaps(),
        servo_errors: servos.servo_errors(),
        following: servos.following(),
        violations: servos.violations(),
        body: servos.body_report(),
        alignment: AlignmentReport::default(),
        beats: BeatReport {
            tempo_bpm: music.beats.tempo_bpm,
            times_s: music.beats.times_s.clone(),
            meter: music.meter.map(|(meter, _)| meter),
            meter_confidence: music.meter.map_or(0.0, |(_, sure)| sure),
        },
        late_frames: run.input.late_frames,
        left_out: Vec::new(),
        latency_ms: run.log.latency.report(),
        capture: music.capture.map(CaptureReport::from),
        interventions: servos.interventions(),
        effort: run.plan.retargeter.torque_report().into(),
        steps: steps(config, run),
        safety: servos.safety_log(),
        replaced_music_frames: music.replaced_music_frames,
        lead_s: run.plan.lead.mean_s(),
        idled_s: run.plan.idle.idled_s(),
        compensation: CompensationReport::default(),
        kinematic_beats_s: KinematicBeats::default(),
    };
    score_beats(config, run, &mut report)?;
    Ok(report)
}

fn steps(config: &DanceConfig, run: &LoopRecord) -> Option<StepFigures> {
    let counts = run.plan.retargeter.counts();
    let figures = StepFigures { made: counts.steps, refused: counts.refused_steps };
    (config.robot.retarget.stance == Stance::Stepping).then_some(figures)
}

/// How well motion, targets and servos met the beat; without compensation too,
/// if a report of it is asked for.
fn score_beats(
    config: &DanceConfig,
    run: &LoopRecord,
    report: &mut DanceReport,
) -> anyhow::Result<()> {
    let music_s = &report.beats.times_s;
    let (trace, trace_hz) = (&run.log.trace, run.log.trace_hz());
    let generator = JointSpeed::of_dancer(&trace.motion);
    let targets = JointSpeed::of_joints(&trace.targets, trace_hz);
    let servos = JointSpeed::of_joints(&trace.servos, trace_hz);
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
    report.compensation.pace = run.plan.paces();
    if config.compensation && config.report.is_some() {
        let replay = uncompensated_replay::replay(
            &config.robot,
            &trace.motion,
            run.plan.lead.even_s(),
            run.log.decimation(),
        )?;
        let targets = JointSpeed::of_joints(&replay.targets, trace_hz);
        let servos = JointSpeed::of_joints(&replay.servos, trace_hz);
        report.compensation.off_targets = Some(targets.scores(music_s));
        report.compensation.off_servos = Some(servos.scores(music_s));
        report.kinematic_beats_s.off_servos = servos.beats_s();
    }
    Ok(())
}

/// Writes the beats and the facts that a reader needs to check the report.
pub fn finish_recording(
    config: &DanceConfig,
    recorder: Option<Recorder>,
    report: &DanceReport,
    music_start_s: f64,
) -> anyhow::Result<()> {
    let Some(mut recorder) = recorder else {
        return Ok(());
    };
    for time_s in &report.beats.times_s {
        recorder.beat(time_s + music_start_s, report.beats.tempo_bpm);
    }
    let mut facts = recording_facts(&config.robot, music_start_s)?;
    facts.extend([
        ("audio_s".to_owned(), report.audio_s.to_string()),
        ("model".to_owned(), report.model.clone()),
        ("seed".to_owned(), report.seed.to_string()),
    ]);
    recorder.metadata(facts);
    recorder.finish()
}

/// What a reader of a recording needs to know of the robot and of the music's beginning.
pub fn recording_facts(
    robot: &Robot,
    music_start_s: f64,
) -> anyhow::Result<BTreeMap<String, String>> {
    let servos = robot.servos.iter();
    let limits: Vec<serde_json::Value> = servos
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
    Ok(BTreeMap::from([
        ("music_start_s".to_owned(), music_start_s.to_string()),
        ("control_hz".to_owned(), robot.control_hz.to_string()),
        ("robot".to_owned(), robot.name.clone()),
        ("joints".to_owned(), serde_json::to_string(&limits)?),
    ]))
}
