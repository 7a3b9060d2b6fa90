//! What an analyzer keeps for scoring when asked to; grows with the music
//! unless what is old is let go of.

use super::offline::BeatTrack;
use servodance_types::FRAME_RATE_HZ;

/// Frames after which music has been noticed: four seconds.
const NOTICED_FRAMES: usize = 80;

/// The evidence of beats over a whole piece, and the beats as they were called live.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Values a second of `evidence`.
    pub rate_hz: f64,
    /// When the first value was audible, seconds; may be a little negative.
    pub first_s: f64,
    /// Evidence of a beat in each hop, log-odds.
    pub evidence: Vec<f32>,
    /// Presence of music, 20 a second, from `first_presence_s` on.
    pub presence: Vec<f32>,
    /// When the first value of `presence` was known, seconds.
    pub first_presence_s: f64,
    /// Beats called by the causal tracker while it had the beat, seconds.
    pub beats_s: Vec<f64>,
}

impl History {
    /// Lets go of what is older than `time_s`, once it is worth the copying.
    pub(crate) fn forget_before(&mut self, time_s: f64) {
        let gone = ((time_s - self.first_s) * self.rate_hz).floor();
        let gone = (gone.max(0.0) as usize).min(self.evidence.len());
        if 2 * gone < self.evidence.len() {
            return;
        }
        self.evidence.drain(..gone);
        self.first_s += gone as f64 / self.rate_hz;
        let gone = ((time_s - self.first_presence_s).max(0.0) * FRAME_RATE_HZ) as usize;
        let gone = gone.min(self.presence.len());
        self.presence.drain(..gone);
        self.first_presence_s += gone as f64 / FRAME_RATE_HZ;
        self.beats_s.retain(|beat| *beat >= time_s);
    }

    /// When value `index` was audible, seconds.
    pub fn time_s(&self, index: usize) -> f64 {
        self.first_s + index as f64 / self.rate_hz
    }

    /// Whether music was noticed at this time or soon after.
    pub(crate) fn music_at(&self, time_s: f64) -> bool {
        let first = ((time_s - self.first_presence_s).max(0.0) * FRAME_RATE_HZ) as usize;
        let mut soon = self.presence.iter().skip(first).take(NOTICED_FRAMES);
        soon.any(|&presence| presence > 0.5)
    }

    /// The beats as they were called live.
    pub fn live_track(&self) -> BeatTrack {
        let heard = self.beats_s.iter().copied();
        BeatTrack::new(heard.filter(|&time_s| time_s >= 0.0).collect())
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
