//! What a recording gets when it changes, and not in every cycle: temperatures
//! and what the safety layer did.

use super::rig::Rig;
use crate::record::{Notice, Recorder};
use crate::show::snapshot::state_name;
use servodance_drivers::State;

/// What was written down so far.
#[derive(Debug, Default)]
pub struct Chronicle {
    temperatures_c: Vec<Option<f64>>,
    events: usize,
}

impl Chronicle {
    /// Writes what is new. `time_s` is the time in the recording, which began
    /// `stood_s` after torque was on.
    pub fn write(&mut self, recorder: &mut Recorder, rig: &Rig, time_s: f64, stood_s: f64) {
        for (joint, health) in rig.health().enumerate() {
            if self.temperatures_c.len() == joint {
                self.temperatures_c.push(None);
            }
            let told = &mut self.temperatures_c[joint];
            if *told != health.temperature_c {
                *told = health.temperature_c;
                recorder.temperature(joint, time_s, health.temperature_c.unwrap_or(f64::NAN));
            }
        }
        let transitions = rig.transitions();
        for event in &transitions[self.events..] {
            recorder.notice(Notice {
                time_s: event.time_s - stood_s,
                grave: event.to == State::Fault,
                state: state_name(event.to),
                cause: &event.cause,
            });
        }
        self.events = transitions.len();
    }
}
