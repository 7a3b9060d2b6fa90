//! The beats of a recording, for people and for scoring programs.

use serde::Serialize;
use servodance_audio::beats::track_offline;
use servodance_audio::{AudioSource, MusicAnalyzer, TempoRange};
use servodance_types::Beat;
use std::path::Path;

/// Samples in a block of those that are all there.
const BLOCK: usize = 4096;

/// The two ways of beat tracking.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BeatTracker {
    /// As in a live dance: each beat is called from what came before it.
    Causal,
    /// With the whole recording known.
    Offline,
}

/// The beats of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Beats {
    /// Which tracker found them.
    pub tracker: BeatTracker,
    /// Length of the audio, seconds.
    pub audio_s: f64,
    /// Median tempo; 0 where there are fewer than two beats.
    pub tempo_bpm: f64,
    /// Beat times in seconds, increasing.
    pub times_s: Vec<f64>,
    /// Beats a bar of most of the music; none for the offline tracker, which knows
    /// no bars, and where no bar stood out.
    pub meter: Option<u8>,
    /// Place of each beat in its bar from 1, 0 where it was not known; empty for the
    /// offline tracker, like the two below.
    pub places: Vec<u8>,
    /// How sure the tracker was of each beat, 0 to 1.
    pub confidence: Vec<f32>,
    /// How sure it was of each place, 0 to 1.
    pub bar_confidence: Vec<f32>,
}

impl Beats {
    /// Tracks the beats of an audio file; the causal tracker follows no other tempi than
    /// those of `tempo`.
    pub fn find(
        path: &Path,
        tracker: BeatTracker,
        tempo: Option<TempoRange>,
    ) -> anyhow::Result<Self> {
        let mut source = AudioSource::open(path)?;
        let rate_hz = source.sample_rate_hz();
        Self::of_blocks(|block| Ok(source.next_block(block)?), rate_hz, tracker, tempo)
    }

    /// The same of mono samples, -1 to 1.
    pub fn of_samples(
        samples: &[f32],
        sample_rate_hz: u32,
        tracker: BeatTracker,
        tempo: Option<TempoRange>,
    ) -> anyhow::Result<Self> {
        let mut blocks = samples.chunks(BLOCK);
        let next = |block: &mut Vec<f32>| {
            block.clear();
            block.extend_from_slice(blocks.next().unwrap_or_default());
            Ok(!block.is_empty())
        };
        Self::of_blocks(next, sample_rate_hz, tracker, tempo)
    }

    fn of_blocks(
        mut next: impl FnMut(&mut Vec<f32>) -> anyhow::Result<bool>,
        sample_rate_hz: u32,
        tracker: BeatTracker,
        tempo: Option<TempoRange>,
    ) -> anyhow::Result<Self> {
        let mut analyzer = MusicAnalyzer::keeping_history(sample_rate_hz)?;
        if let Some(tempo) = tempo {
            analyzer.limit_tempo(tempo);
        }
        let (mut block, mut samples) = (Vec::new(), 0);
        while next(&mut block)? {
            samples += block.len();
            analyzer.push(&block);
            while analyzer.pop().is_some() {}
        }
        let history = analyzer.history().cloned().unwrap_or_default();
        let track = match tracker {
            BeatTracker::Causal => history.live_track(),
            BeatTracker::Offline => track_offline(&history),
        };
        let live: Vec<Beat> = match tracker {
            BeatTracker::Causal => {
                let heard = history.beats.iter().filter(|live| live.time_s >= 0.0);
                heard.map(|live| live.beat).collect()
            }
            BeatTracker::Offline => Vec::new(),
        };
        Ok(Self {
            tracker,
            audio_s: samples as f64 / f64::from(sample_rate_hz),
            tempo_bpm: track.tempo_bpm,
            times_s: track.times_s,
            meter: match tracker {
                BeatTracker::Causal => history.live_meter().map(|(meter, _)| meter),
                BeatTracker::Offline => None,
            },
            places: live.iter().map(|beat| beat.beat_in_bar.map_or(0, |place| place + 1)).collect(),
            confidence: live.iter().map(|beat| beat.confidence).collect(),
            bar_confidence: live.iter().map(|beat| beat.bar_confidence).collect(),
        })
    }

    /// One beat a line, in seconds: what `mir_eval.io.load_events` reads.
    pub fn to_lines(&self) -> String {
        let lines = self.times_s.iter().map(|time_s| format!("{time_s:.4}\n"));
        lines.collect()
    }

    /// The same with each beat's place in its bar from 1, 0 where it is not known.
    pub fn to_placed_lines(&self) -> String {
        let placed = self.times_s.iter().zip(&self.places);
        placed.map(|(time_s, place)| format!("{time_s:.4} {place}\n")).collect()
    }

    /// The beats as one JSON object and a newline.
    pub fn to_json(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string(self)? + "\n")
    }
}
