//! The recording side of the control loop: every frame and every cycle, and,
//! when they change, temperatures and events of the safety layer. Without a
//! recorder all of it does nothing.
//!
//! Times are those of the recording, seconds from its first cycle.

use super::robot_buses::RobotBuses;
use crate::pipeline::dance_step::DanceStep;
use crate::pipeline::step_times::PipelineStep;
use crate::telemetry::recorder::{Recorder, RecordingTopic, SafetyNotice};
use crate::viewer::snapshot::{BANDS, state_name};
use servodance_audio::playback::Sound;
use servodance_drivers::State;
use servodance_retarget::Retargeter;
use servodance_types::FRAME_RATE_HZ;

#[derive(Default)]
pub struct RecorderFeed {
    recorder: Option<Recorder>,
    temperatures_c: Vec<Option<f64>>,
    /// The song, where it is recorded too.
    song: Option<Sound>,
    /// Transitions of the safety layer that are recorded.
    events: usize,
}

/// What only the control loop knows of a cycle.
#[derive(Clone, Copy)]
pub struct CycleDecision<'a> {
    /// What the retargeter asked for, radians.
    pub targets_rad: &'a [f64],
    /// Seconds by which the motion is ahead of the music.
    pub lead_s: f64,
    pub idle_share: f64,
    pub period_s: f64,
    /// For the pose of the root, in cycles that record it.
    pub root: Option<&'a Retargeter>,
}

impl RecorderFeed {
    pub fn new(recorder: Option<Recorder>) -> Self {
        Self { recorder, ..Self::default() }
    }

    /// Records the song too.
    pub fn record_song(&mut self, song: Sound) {
        self.song = Some(song);
    }

    pub fn frame(&mut self, at_s: f64, step: &DanceStep) {
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        recorder.motion(at_s, &step.motion);
        let phase = f64::from(step.music.beat.phase);
        recorder.number(RecordingTopic::BeatPhase, at_s, phase);
        let bands = servodance_audio::bands::<BANDS>(&step.music.spectral);
        recorder.spectrum(at_s, &bands);
        if let Some(song) = &self.song {
            let length_s = 1.0 / FRAME_RATE_HZ;
            let from_s = step.music.time_s - length_s;
            recorder.audio(at_s - length_s, song.piece(from_s, length_s), song.rate_hz);
        }
        recorder.number(RecordingTopic::Stage(PipelineStep::Features), at_s, step.features_ms);
        recorder.number(RecordingTopic::Stage(PipelineStep::Model), at_s, step.model_ms);
    }

    /// A cycle went over the bus; the recording began `stood_s` after torque on.
    pub fn cycle(&mut self, at_s: f64, stood_s: f64, decision: CycleDecision, servos: &RobotBuses) {
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        recorder.positions(RecordingTopic::JointTargets, at_s, decision.targets_rad);
        recorder.number(RecordingTopic::Lead, at_s, decision.lead_s);
        recorder.number(RecordingTopic::Idle, at_s, decision.idle_share);
        recorder.positions(RecordingTopic::JointCommands, at_s, servos.safety().sent_rad());
        recorder.states(RecordingTopic::JointStates, at_s, servos.states());
        if let Some(retargeter) = decision.root {
            let root = servos.root_pose(retargeter);
            recorder.pose(RecordingTopic::Root, at_s, root);
            let joints: Vec<f64> = servos.states().iter().map(|s| s.position_rad).collect();
            recorder.links(at_s, retargeter.model(), root, &joints);
        }
        if let Some(truth) = servos.truth() {
            // The simulation has already gone on to the end of this cycle.
            recorder.states(RecordingTopic::ServoTruth, at_s + decision.period_s, truth);
        }
        let (bytes, packets) = servos.wire_totals();
        recorder.number(RecordingTopic::BusBytes, at_s, bytes as f64);
        recorder.number(RecordingTopic::BusPackets, at_s, packets as f64);
        self.changes(at_s, stood_s, servos);
    }

    /// A step of a cycle took `ms`.
    pub fn step(&mut self, at_s: f64, step: PipelineStep, ms: f64) {
        if let Some(recorder) = &mut self.recorder {
            recorder.number(RecordingTopic::Stage(step), at_s, ms);
        }
    }

    pub fn changes(&mut self, at_s: f64, stood_s: f64, servos: &RobotBuses) {
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        for (joint, health) in servos.safety().health().enumerate() {
            if self.temperatures_c.len() == joint {
                self.temperatures_c.push(None);
            }
            let recorded = &mut self.temperatures_c[joint];
            if *recorded != health.temperature_c {
                *recorded = health.temperature_c;
                recorder.temperature(joint, at_s, health.temperature_c.unwrap_or(f64::NAN));
            }
        }
        let transitions = servos.safety().transitions();
        for event in &transitions[self.events..] {
            recorder.notice(SafetyNotice {
                time_s: event.time_s - stood_s,
                grave: event.to == State::Fault,
                state: state_name(event.to),
                cause: &event.cause,
            });
        }
        self.events = transitions.len();
    }

    /// The recorder, to be finished with what is known only at the end.
    pub fn into_recorder(self) -> Option<Recorder> {
        self.recorder
    }
}
