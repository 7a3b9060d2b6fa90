//! The beats of a recording, for people and for scoring programs.

use serde::Serialize;
use servodance_audio::beats::track_offline;
use servodance_audio::{AudioSource, MusicAnalyzer};
use std::path::Path;

/// Which of the two trackers is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Hearing {
    /// As it is heard live: each beat called from what came before it.
    Causal,
    /// With the whole recording known.
    Offline,
}

/// The beats of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Beats {
    /// Which tracker found them.
    pub tracker: Hearing,
    /// Seconds of audio.
    pub audio_s: f64,
    /// Median tempo; 0 where there are fewer than two beats.
    pub tempo_bpm: f64,
    /// Beat times in seconds, increasing.
    pub times_s: Vec<f64>,
}

impl Beats {
    /// Listens to a recording.
    ///
    /// # Errors
    /// A file that cannot be read, or that holds no sound.
    pub fn find(path: &Path, tracker: Hearing) -> anyhow::Result<Self> {
        let mut source = AudioSource::open(path)?;
        let mut analyzer = MusicAnalyzer::keeping_history(source.sample_rate_hz())?;
        let (mut block, mut samples) = (Vec::new(), 0);
        while source.next_block(&mut block)? {
            samples += block.len();
            analyzer.push(&block);
            while analyzer.pop().is_some() {}
        }
        let history = analyzer.history().cloned().unwrap_or_default();
        let track = match tracker {
            Hearing::Causal => history.live_track(),
            Hearing::Offline => track_offline(&history),
        };
        Ok(Self {
            tracker,
            audio_s: samples as f64 / f64::from(source.sample_rate_hz()),
            tempo_bpm: track.tempo_bpm,
            times_s: track.times_s,
        })
    }

    /// One beat a line, in seconds: what `mir_eval.io.load_events` reads.
    pub fn to_lines(&self) -> String {
        let lines = self.times_s.iter().map(|time_s| format!("{time_s:.4}\n"));
        lines.collect()
    }

    /// One JSON object.
    pub fn to_json(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string(self)? + "\n")
    }
}
