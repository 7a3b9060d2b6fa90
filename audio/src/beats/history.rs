//! The history that an analyzer keeps for scoring: beat evidence, presence of
//! music, and the beats called live. Grows with the music unless old parts are
//! dropped.

use servodance_types::{Beat, FRAME_RATE_HZ};

/// Frames within which the detector notices music: four seconds.
const NOTICED_FRAMES: usize = 80;

/// Beat evidence over a whole piece, and the beats as they were called live.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BeatHistory {
    /// Values a second of `evidence`.
    pub rate_hz: f64,
    /// Time of the first value, seconds; may be a little negative.
    pub first_s: f64,
    /// Evidence of a beat in each hop, log-odds.
    pub evidence: Vec<f32>,
    /// Presence of music, 20 a second, from `first_presence_s` on.
    pub presence: Vec<f32>,
    /// Time of the first value of `presence`, seconds.
    pub first_presence_s: f64,
    /// Beats called by the causal tracker while it had the beat.
    pub beats: Vec<LiveBeat>,
}

/// A beat as the causal tracker called it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveBeat {
    /// When it was audible, seconds.
    pub time_s: f64,
    /// What the tracker knew then: confidence, place in the bar, meter.
    pub beat: Beat,
}

impl BeatHistory {
    /// Drops values older than `time_s`, once at least half of them are.
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
        self.beats.retain(|beat| beat.time_s >= time_s);
    }

    /// Time at which value `index` of the evidence was audible, seconds.
    pub fn time_s(&self, index: usize) -> f64 {
        self.first_s + index as f64 / self.rate_hz
    }

    /// Whether music is detected at this time or soon after.
    pub(crate) fn music_at(&self, time_s: f64) -> bool {
        let first = ((time_s - self.first_presence_s).max(0.0) * FRAME_RATE_HZ) as usize;
        let mut soon = self.presence.iter().skip(first).take(NOTICED_FRAMES);
        soon.any(|&presence| presence > 0.5)
    }

    /// The beats that the causal tracker called live.
    pub fn live_track(&self) -> BeatTrack {
        let times_s = self.beats.iter().map(|beat| beat.time_s);
        BeatTrack::new(times_s.filter(|&time_s| time_s >= 0.0).collect())
    }

    /// Beats a bar of most of them, and how sure of it the tracker was, 0 to 1, over
    /// all of them; none where no bar stood out.
    pub fn live_meter(&self) -> Option<(u8, f32)> {
        let sure_of = |meter: u8| -> f32 {
            let of_it = self.beats.iter().filter(|live| live.beat.beats_in_bar == Some(meter));
            of_it.map(|live| live.beat.bar_confidence).sum()
        };
        let best = (2..=7).max_by(|&a, &b| sure_of(a).total_cmp(&sure_of(b)))?;
        let sure = sure_of(best) / self.beats.len().max(1) as f32;
        (sure > 0.0).then_some((best, sure))
    }

    /// Those of them that open a bar.
    pub fn live_downbeats_s(&self) -> Vec<f64> {
        let first = |live: &&LiveBeat| live.time_s >= 0.0 && live.beat.beat_in_bar == Some(0);
        self.beats.iter().filter(first).map(|live| live.time_s).collect()
    }
}

/// Beat times and tempo of a piece.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BeatTrack {
    /// Median tempo, beats a minute; 0 if there are fewer than two beats.
    pub tempo_bpm: f64,
    /// Beat times in seconds, increasing.
    pub times_s: Vec<f64>,
}

impl BeatTrack {
    pub(super) fn new(times_s: Vec<f64>) -> Self {
        let mut intervals: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).collect();
        intervals.sort_by(f64::total_cmp);
        let median_s = intervals.get(intervals.len() / 2);
        let tempo_bpm = median_s.map_or(0.0, |s| 60.0 / s);
        Self { tempo_bpm, times_s }
    }
}

/// Calls a beat when the phase wraps from one to zero.
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
        if { self.last_s }.is_some_and(|last| beat_s - last < 0.5 * period_s) {
            return None;
        }
        self.last_s = Some(beat_s);
        Some(beat_s)
    }
}
