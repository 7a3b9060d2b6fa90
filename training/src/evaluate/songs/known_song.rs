//! A song with known beats, and what a dancer hears of it.

use crate::evaluate::reference::tracked_beats_s;
use crate::metrics::music_answer::peaks;
use crate::song_file::{read_beats, read_sections, read_sound};
use anyhow::{Context, ensure};
use servodance_audio::MusicAnalyzer;
use servodance_model::conditioning::{Encodec, HeardFrame};
use servodance_runtime::pipeline::feature_extractor::FeatureExtractor;
use servodance_types::{FRAME_RATE_HZ, SPECTRAL_DIM};
use std::path::Path;

/// The beginning of each song is danced to and not judged, seconds.
pub const WARM_UP_S: f64 = 5.0;
const SHORTEST_S: f64 = 15.0;
/// Bars before and after a bar that tell whether a section begins with it.
const SECTION_BARS: usize = 4;
/// Sections are no nearer to each other than this, bars.
const SECTION_REACH: usize = 3;
const BEATS_IN_BAR: usize = 4;
/// Softer than this is silence, decibels below full scale.
const SILENCE_DB: f64 = -80.0;

/// A song with known beats. Times are seconds from [`WARM_UP_S`] on.
pub struct KnownSong {
    pub name: String,
    samples: Vec<f32>,
    rate_hz: u32,
    pub tempo_bpm: f64,
    /// Frames that are danced to, with the warm-up.
    pub frames: usize,
    pub beats_s: Vec<f64>,
    /// Beats that begin a bar.
    bars: Vec<usize>,
    /// Beats that begin a section.
    pub sections: Vec<usize>,
    /// Loudness of each bar, decibels.
    pub loudness_db: Vec<f64>,
    /// What a dancer hears, from the start on.
    pub heard: Vec<HeardFrame>,
    /// Beats that the tracker finds live.
    pub found_s: Vec<f64>,
}

impl KnownSong {
    /// Reads a song and hears its first `seconds` after the warm-up, or all there is.
    pub fn open(path: &Path, seconds: f64, encodec: Option<&Encodec>) -> anyhow::Result<Self> {
        let (mut samples, rate_hz) = read_sound(path)?;
        let length_s = (samples.len() as f64 / f64::from(rate_hz)).min(WARM_UP_S + seconds);
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        ensure!(
            length_s >= SHORTEST_S,
            "{}: {length_s:.1} s of music, at least {SHORTEST_S} are needed",
            path.display()
        );
        samples.truncate((length_s * f64::from(rate_hz)) as usize);
        let (all_s, places) = read_beats(path)?;
        let judged = |time_s: &f64| (WARM_UP_S..length_s).contains(time_s);
        let kept = all_s.iter().zip(&places).filter(|(time_s, _)| judged(time_s));
        let (beats_s, places): (Vec<f64>, Vec<u32>) =
            kept.map(|(time_s, place)| (time_s - WARM_UP_S, *place)).unzip();
        let tempo_bpm = tempo_bpm(&beats_s)
            .with_context(|| format!("{}: no beats behind {WARM_UP_S} s", path.display()))?;
        let frames = (length_s * FRAME_RATE_HZ) as usize;
        let mut song = Self {
            name,
            tempo_bpm,
            frames,
            bars: bars(&places),
            sections: Vec::new(),
            loudness_db: Vec::new(),
            heard: Vec::new(),
            found_s: Vec::new(),
            samples,
            rate_hz,
            beats_s,
        };
        song.heard = song.hear(0.0, 1.0, frames, encodec)?;
        song.frames = song.heard.len();
        song.found_s = judged_s(&tracked_beats_s(&song.heard));
        song.loudness_db = song.bar_spans_s().windows(2).map(|bar| song.loudness(bar)).collect();
        song.sections = match read_sections(path)? {
            Some(times_s) => {
                judged_s(&times_s).iter().map(|t| nearest(&song.beats_s, *t)).collect()
            }
            None => song.sections_by_novelty(),
        };
        Ok(song)
    }

    /// What a dancer hears who comes `late_s` late to the song played `faster` times as fast:
    /// `frames` frames, or as many as there are. A faster song is also higher.
    pub fn hear(
        &self,
        late_s: f64,
        faster: f64,
        frames: usize,
        encodec: Option<&Encodec>,
    ) -> anyhow::Result<Vec<HeardFrame>> {
        let rate_hz = (f64::from(self.rate_hz) * faster).round() as u32;
        let analyzer = MusicAnalyzer::new(rate_hz).context(self.name.clone())?;
        let mut ears = FeatureExtractor::new(analyzer, rate_hz, encodec)?;
        let from = ((late_s * f64::from(rate_hz)) as usize).min(self.samples.len());
        // Played on from its beginning where it is too short.
        let around = self.samples[from..].iter().chain(self.samples.iter().cycle());
        let needed = ((frames + 2) as f64 / FRAME_RATE_HZ * f64::from(rate_hz)) as usize;
        let samples: Vec<f32> = around.take(needed).copied().collect();
        ears.push(&samples)?;
        Ok(std::iter::from_fn(|| ears.pop()).take(frames).collect())
    }

    /// Lets go of the sound.
    pub fn silenced(self) -> Self {
        Self { samples: Vec::new(), ..self }
    }

    /// Beginnings of the bars, and the end of the last one.
    pub fn bar_spans_s(&self) -> Vec<f64> {
        self.bars.iter().map(|beat| self.beats_s[*beat]).collect()
    }

    /// Seconds of half a beat.
    pub fn half_beat_s(&self) -> f64 {
        30.0 / self.tempo_bpm
    }

    fn loudness(&self, bar: &[f64]) -> f64 {
        let at = |time_s: f64| {
            (((time_s + WARM_UP_S) * f64::from(self.rate_hz)) as usize).min(self.samples.len())
        };
        let samples = &self.samples[at(bar[0])..at(bar[1])];
        let squares: f64 = samples.iter().map(|s| f64::from(*s).powi(2)).sum();
        (10.0 * (squares / samples.len().max(1) as f64).log10()).max(SILENCE_DB)
    }

    /// Where the bars before and the bars after sound most differently.
    fn sections_by_novelty(&self) -> Vec<usize> {
        let frame = |time_s: f64| ((time_s + WARM_UP_S) * FRAME_RATE_HZ) as usize;
        let bar = |span: &[f64]| {
            let frames = &self.heard
                [frame(span[0]).min(self.heard.len())..frame(span[1]).min(self.heard.len())];
            let mut mean = [0.0; SPECTRAL_DIM];
            for heard in frames {
                for (mean, value) in mean.iter_mut().zip(&heard.frame.spectral) {
                    *mean += f64::from(*value) / frames.len() as f64;
                }
            }
            mean
        };
        let means: Vec<_> = self.bar_spans_s().windows(2).map(bar).collect();
        let scales = deviations(&means);
        let apart = |at: usize| -> Option<f64> {
            let before = average(&means[at.checked_sub(SECTION_BARS)?..at]);
            let after = average(means.get(at..at + SECTION_BARS)?);
            let squares = (0..SPECTRAL_DIM).map(|i| ((after[i] - before[i]) / scales[i]).powi(2));
            Some(squares.sum::<f64>().sqrt())
        };
        let novelty: Vec<Option<f64>> = (0..means.len()).map(apart).collect();
        peaks(&novelty, SECTION_REACH).into_iter().map(|bar| self.bars[bar]).collect()
    }
}

fn average(rows: &[[f64; SPECTRAL_DIM]]) -> [f64; SPECTRAL_DIM] {
    std::array::from_fn(|i| rows.iter().map(|row| row[i]).sum::<f64>() / rows.len() as f64)
}

fn deviations(rows: &[[f64; SPECTRAL_DIM]]) -> [f64; SPECTRAL_DIM] {
    let mean = average(rows);
    std::array::from_fn(|i| {
        let squares: f64 = rows.iter().map(|row| (row[i] - mean[i]).powi(2)).sum();
        (squares / rows.len().max(1) as f64).sqrt().max(1e-6)
    })
}

fn judged_s(times_s: &[f64]) -> Vec<f64> {
    times_s.iter().filter(|t| **t >= WARM_UP_S).map(|t| t - WARM_UP_S).collect()
}

/// Beats at place 1; every fourth where no place is known.
fn bars(places: &[u32]) -> Vec<usize> {
    let first: Vec<usize> = (0..places.len()).filter(|i| places[*i] == 1).collect();
    match first.is_empty() {
        true => (0..places.len()).step_by(BEATS_IN_BAR).collect(),
        false => first,
    }
}

fn nearest(times_s: &[f64], time_s: f64) -> usize {
    let after = times_s.partition_point(|t| *t < time_s).min(times_s.len().saturating_sub(1));
    match after > 0 && time_s - times_s[after - 1] < times_s[after] - time_s {
        true => after - 1,
        false => after,
    }
}

fn tempo_bpm(beats_s: &[f64]) -> Option<f64> {
    let mut gaps_s: Vec<f64> = beats_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps_s.sort_by(f64::total_cmp);
    gaps_s.get(gaps_s.len() / 2).filter(|gap| **gap > 0.0).map(|gap| 60.0 / gap)
}
