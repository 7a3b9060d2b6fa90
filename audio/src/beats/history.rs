//! What an analyzer keeps for scoring when asked to; grows with the music
//! unless what is old is let go of.

/// Onset strength over a whole piece, and the beats as they were called live.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Values a second of `onsets`.
    pub onset_rate_hz: f64,
    /// When the first value was audible, seconds; may be a little negative.
    pub first_onset_s: f64,
    /// Onset strength: 0 nothing, 1 strong.
    pub onsets: Vec<f32>,
    /// Beats called by the causal tracker while it had the beat, seconds.
    pub beats_s: Vec<f64>,
}

impl History {
    /// Lets go of what is older than `time_s`, once it is worth the copying.
    pub(crate) fn forget_before(&mut self, time_s: f64) {
        let gone = ((time_s - self.first_onset_s) * self.onset_rate_hz).floor();
        let gone = (gone.max(0.0) as usize).min(self.onsets.len());
        if 2 * gone < self.onsets.len() {
            return;
        }
        self.onsets.drain(..gone);
        self.first_onset_s += gone as f64 / self.onset_rate_hz;
        self.beats_s.retain(|beat| *beat >= time_s);
    }

    /// When value `index` was audible, seconds.
    pub fn onset_time_s(&self, index: usize) -> f64 {
        self.first_onset_s + index as f64 / self.onset_rate_hz
    }
}

/// Notices when the phase of the beat passes zero.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BeatCaller {
    phase: f32,
    last_s: Option<f64>,
}

impl BeatCaller {
    /// The time of a beat that has just passed at `now_s`, if one has. A
    /// correction of the phase across zero does not call a beat twice.
    pub(crate) fn call(&mut self, now_s: f64, phase: f32, tempo_bpm: f32) -> Option<f64> {
        let passed = self.phase - phase > 0.5;
        self.phase = phase;
        if !passed || tempo_bpm <= 0.0 {
            return None;
        }
        let period_s = 60.0 / f64::from(tempo_bpm);
        let beat_s = now_s - f64::from(phase) * period_s;
        let again = self
            .last_s
            .is_some_and(|last| beat_s - last < 0.5 * period_s);
        if again {
            return None;
        }
        self.last_s = Some(beat_s);
        Some(beat_s)
    }
}
