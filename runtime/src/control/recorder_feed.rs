//! What the recording of a run is told: every frame and every cycle, and only
//! when it changes, temperatures and what the safety layer did. Without a
//! recording all of it does nothing.
//!
//! Times are those of the recording, seconds from its first cycle.

use crate::control::robot_buses::Rig;
use crate::pipeline::motion_source::Step;
use crate::pipeline::step_times::Stage;
use crate::telemetry::recorder::{Recorder, RecordingTopic, SafetyNotice};
use crate::viewer::pose_array;
use crate::viewer::snapshot::{BANDS, state_name};
use servodance_drivers::State;
use servodance_retarget::Retargeter;

/// The recording, if there is one, and what was written down so far.
#[derive(Default)]
pub struct Chronicle {
    recorder: Option<Recorder>,
    temperatures_c: Vec<Option<f64>>,
    events: usize,
}

/// What only the control loop knows of a cycle.
#[derive(Clone, Copy)]
pub struct Decided<'a> {
    /// What the retargeter asked for, radians.
    pub targets_rad: &'a [f64],
    /// Seconds by which the motion is ahead of the music.
    pub lead_s: f64,
    /// Share of idle.
    pub idle_share: f64,
    /// Seconds to the next cycle.
    pub period_s: f64,
    /// Knows where the root is, in cycles in which that is told.
    pub root: Option<&'a Retargeter>,
}

impl Chronicle {
    /// For this recording.
    pub fn new(recorder: Option<Recorder>) -> Self {
        Self {
            recorder,
            ..Self::default()
        }
    }

    /// A motion frame came.
    pub fn frame(&mut self, at_s: f64, step: &Step) {
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        recorder.motion(at_s, &step.motion);
        let phase = f64::from(step.music.beat.phase);
        recorder.number(RecordingTopic::BeatPhase, at_s, phase);
        let bands = servodance_audio::bands::<BANDS>(&step.music.spectral);
        recorder.spectrum(at_s, &bands);
        recorder.number(
            RecordingTopic::Stage(Stage::Features),
            at_s,
            step.features_ms,
        );
        recorder.number(RecordingTopic::Stage(Stage::Model), at_s, step.model_ms);
    }

    /// A cycle went over the bus; the recording began `stood_s` after torque
    /// was on.
    pub fn cycle(&mut self, at_s: f64, stood_s: f64, decided: Decided, rig: &Rig) {
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        recorder.positions(RecordingTopic::JointTargets, at_s, decided.targets_rad);
        recorder.number(RecordingTopic::Lead, at_s, decided.lead_s);
        recorder.number(RecordingTopic::Idle, at_s, decided.idle_share);
        recorder.positions(RecordingTopic::JointCommands, at_s, rig.sent_rad());
        recorder.states(RecordingTopic::JointStates, at_s, rig.states());
        if let Some(retargeter) = decided.root {
            let positions: Vec<f64> = rig.states().iter().map(|s| s.position_rad).collect();
            let root = pose_array(&retargeter.world_from_root(&positions));
            recorder.pose(RecordingTopic::Root, at_s, root);
        }
        if let Some(truth) = rig.truth() {
            // The simulation has already gone on to the end of this cycle.
            recorder.states(RecordingTopic::ServoTruth, at_s + decided.period_s, truth);
        }
        let (bytes, packets) = rig.wire_totals();
        recorder.number(RecordingTopic::BusBytes, at_s, bytes as f64);
        recorder.number(RecordingTopic::BusPackets, at_s, packets as f64);
        self.changes(at_s, stood_s, rig);
    }

    /// A stage of a cycle took so long.
    pub fn stage(&mut self, at_s: f64, stage: Stage, ms: f64) {
        if let Some(recorder) = &mut self.recorder {
            recorder.number(RecordingTopic::Stage(stage), at_s, ms);
        }
    }

    /// Temperatures and what the safety layer did, as far as it is new.
    pub fn changes(&mut self, at_s: f64, stood_s: f64, rig: &Rig) {
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        for (joint, health) in rig.health().enumerate() {
            if self.temperatures_c.len() == joint {
                self.temperatures_c.push(None);
            }
            let told = &mut self.temperatures_c[joint];
            if *told != health.temperature_c {
                *told = health.temperature_c;
                recorder.temperature(joint, at_s, health.temperature_c.unwrap_or(f64::NAN));
            }
        }
        let transitions = rig.transitions();
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

    /// The recording, to be ended with facts known only now.
    pub fn into_recorder(self) -> Option<Recorder> {
        self.recorder
    }
}
