//! What is known of a song beforehand: beats, bars, sections.
//!
//! Beats and bars are those that the dancer hears. A section ends where the bars before and
//! after sound more different than those around (a checkerboard kernel along the diagonal of
//! the bars' similarity, Foote 2000); sections that sound alike have the same letter.

use crate::pipeline::audio_input::{AudioChoice, AudioInput};
use crate::process::speed::Speed;
use serde::Serialize;
use servodance_audio::MusicAnalyzer;
use servodance_types::{FRAME_RATE_HZ, MusicFrame, SPECTRAL_DIM};

/// Bars on each side of a border that are compared.
const AROUND: usize = 4;
/// A border stands out by so many standard deviations of its surroundings.
const STANDS_OUT: f64 = 0.7;
/// Sections are at least so many bars long.
const SHORTEST: usize = 4;
/// Sections at least this similar have the same letter.
const ALIKE: f64 = 0.93;
/// Where no bar is heard, such a stretch counts as one, seconds.
const STRETCH_S: f64 = 2.0;

/// Times in seconds of the music.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SongOutline {
    /// How long the song is; 0 where that is not known.
    pub length_s: f64,
    /// Where beats are.
    pub beats_s: Vec<f64>,
    /// Where bars begin.
    pub bars_s: Vec<f64>,
    /// Where sections begin, and what they are called.
    pub sections: Vec<(f64, String)>,
}

type BarSound = [f64; SPECTRAL_DIM];

impl SongOutline {
    /// Hears a whole recording; takes about a second for two minutes of music.
    pub fn find(song: &AudioChoice) -> anyhow::Result<Self> {
        let mut input = AudioInput::open(song, Speed::Max)?;
        let rate_hz = input.sample_rate_hz();
        let mut analyzer = MusicAnalyzer::keeping_history(rate_hz)?;
        let (mut block, mut samples, mut frames) = (Vec::new(), 0, Vec::new());
        while input.next_block(&mut block)? {
            samples += block.len();
            analyzer.push(&block);
            frames.extend(std::iter::from_fn(|| analyzer.pop()));
        }
        let history = analyzer.history().cloned().unwrap_or_default();
        let live = history.beats.iter().filter(|live| live.time_s >= 0.0);
        let bars_s = live.filter(|live| live.beat.beat_in_bar == Some(0)).map(|live| live.time_s);
        let mut outline = Self {
            length_s: samples as f64 / f64::from(rate_hz),
            beats_s: history.live_track().times_s,
            bars_s: bars_s.collect(),
            sections: Vec::new(),
        };
        outline.sections = sections(&frames, &outline.borders_s());
        Ok(outline)
    }

    /// This outline, with what it does not say as `found`.
    pub fn completed(self, found: Self) -> Self {
        let or = |own: Vec<f64>, other: Vec<f64>| if own.is_empty() { other } else { own };
        Self {
            length_s: if self.length_s > 0.0 { self.length_s } else { found.length_s },
            beats_s: or(self.beats_s, found.beats_s),
            bars_s: or(self.bars_s, found.bars_s),
            sections: if self.sections.is_empty() { found.sections } else { self.sections },
        }
    }

    /// Where a bar begins, counted from 1. The error is one line.
    pub fn bar_s(&self, bar: usize) -> Result<f64, String> {
        let place = bar.checked_sub(1).and_then(|place| self.bars_s.get(place));
        let known = self.bars_s.len();
        place
            .copied()
            .ok_or_else(|| format!("bar {bar}: the song has {known} bars, counted from 1"))
    }

    /// Bars, or stretches of the same length where few are heard.
    fn borders_s(&self) -> Vec<f64> {
        let stretches = (self.length_s / STRETCH_S) as usize;
        match self.bars_s.len() * 3 >= stretches {
            true => self.bars_s.clone(),
            false => (0..stretches).map(|stretch| stretch as f64 * STRETCH_S).collect(),
        }
    }
}

fn sections(frames: &[MusicFrame], borders_s: &[f64]) -> Vec<(f64, String)> {
    let bars = sounds(frames, borders_s);
    let similar = |a: usize, b: usize| similarity(&bars[a], &bars[b]);
    let novelty: Vec<f64> = (0..bars.len()).map(|at| novelty(at, bars.len(), &similar)).collect();
    let mut starts = vec![0];
    let mean = novelty.iter().sum::<f64>() / novelty.len().max(1) as f64;
    let spread = novelty.iter().map(|n| (n - mean).powi(2)).sum::<f64>();
    let least = mean + STANDS_OUT * (spread / novelty.len().max(1) as f64).sqrt();
    for at in SHORTEST..bars.len().saturating_sub(1) {
        let near = at.saturating_sub(AROUND / 2)..(at + AROUND / 2 + 1).min(bars.len());
        let highest = near.map(|other| novelty[other]).fold(0.0, f64::max);
        let long = at - starts.last().copied().unwrap_or(0) >= SHORTEST;
        if long && novelty[at] >= highest && novelty[at] > least.max(1e-6) {
            starts.push(at);
        }
    }
    starts.retain(|start| *start < bars.len());
    name(&bars, &starts, borders_s)
}

/// The mean of the features over each bar, each feature by its own spread.
fn sounds(frames: &[MusicFrame], borders_s: &[f64]) -> Vec<BarSound> {
    let count = frames.len().max(1) as f64;
    let mean_of = |of: &dyn Fn(usize, f64) -> f64| -> BarSound {
        std::array::from_fn(|n| {
            frames.iter().map(|f| of(n, f64::from(f.spectral[n]))).sum::<f64>() / count
        })
    };
    let mean = mean_of(&|_, value| value);
    let spread = mean_of(&|n, value| (value - mean[n]).powi(2));
    let ends_s = borders_s.iter().skip(1).copied().chain([f64::INFINITY]);
    let bars = borders_s.iter().zip(ends_s).map(|(&from_s, to_s)| {
        let from = (from_s * FRAME_RATE_HZ) as usize;
        let to = ((to_s * FRAME_RATE_HZ) as usize).min(frames.len()).max(from);
        let bar = frames.get(from..to).unwrap_or_default();
        std::array::from_fn(|n| {
            let sum: f64 = bar.iter().map(|frame| f64::from(frame.spectral[n]) - mean[n]).sum();
            sum / bar.len().max(1) as f64 / spread[n].sqrt().max(1e-9)
        })
    });
    bars.collect()
}

/// 1 where two bars sound the same, towards 0 where they differ.
fn similarity(one: &BarSound, other: &BarSound) -> f64 {
    let apart: f64 = one.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum();
    (-apart / SPECTRAL_DIM as f64).exp()
}

/// How much the bars before and after `at` differ, and how little each side does in itself.
fn novelty(at: usize, bars: usize, similar: &impl Fn(usize, usize) -> f64) -> f64 {
    let reach = AROUND.min(at).min(bars - at);
    if reach < 2 {
        return 0.0;
    }
    let (mut within, mut across) = (0.0, 0.0);
    for a in at - reach..at + reach {
        for b in at - reach..a {
            match (a < at) == (b < at) {
                true => within += similar(a, b) / (reach * (reach - 1)) as f64,
                false => across += similar(a, b) / (reach * reach) as f64,
            }
        }
    }
    (within - across).max(0.0)
}

fn name(bars: &[BarSound], starts: &[usize], borders_s: &[f64]) -> Vec<(f64, String)> {
    let ends = starts.iter().skip(1).copied().chain([bars.len()]);
    let mut known: Vec<BarSound> = Vec::new();
    let named = starts.iter().zip(ends).map(|(&from, to)| {
        let part = &bars[from..to];
        let sound: BarSound =
            std::array::from_fn(|n| part.iter().map(|bar| bar[n]).sum::<f64>() / part.len() as f64);
        let place = known.iter().position(|other| similarity(other, &sound) > ALIKE);
        let place = place.unwrap_or_else(|| {
            known.push(sound);
            known.len() - 1
        });
        let letter = char::from(b'A' + (place % 26) as u8);
        (if from == 0 { 0.0 } else { borders_s[from] }, letter.to_string())
    });
    named.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_audio::song::{Layers, Section, SongSpec};

    #[test]
    fn a_song_of_two_sounds_that_comes_back_has_its_three_sections() {
        let mut spec = SongSpec::random(64.0, 7).unwrap();
        let all = Section { first_bar: 0, layers: Layers::ALL, intensity: 0.9 };
        let few = Layers { drums: false, bass: false, lead: false, ..Layers::ALL };
        spec.sections = vec![
            all,
            Section { first_bar: 8, layers: few, intensity: 0.4 },
            Section { first_bar: 16, ..all },
        ];
        let song = spec.render().unwrap();
        let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz).unwrap();
        analyzer.push(&song.samples);
        let frames: Vec<_> = std::iter::from_fn(|| analyzer.pop()).collect();
        let bars_s: Vec<f64> = song.beats_s.iter().copied().step_by(4).collect();
        let found = sections(&frames, &bars_s);
        let starts: Vec<f64> = found.iter().map(|section| section.0).collect();
        let bar_s = bars_s[1] - bars_s[0];
        assert_eq!(found.len(), 3, "{found:?}");
        for (start_s, wanted) in starts[1..].iter().zip([bars_s[8], bars_s[16]]) {
            assert!((start_s - wanted).abs() < 1.5 * bar_s, "{found:?}: {wanted}");
        }
        assert!(found[0].1 == found[2].1 && found[0].1 != found[1].1, "{found:?}");
    }

    #[test]
    fn silence_and_a_short_sound_are_one_section() {
        assert_eq!(sections(&[], &[]), []);
        let frames = vec![MusicFrame::default(); 40];
        assert_eq!(sections(&frames, &[0.0, 1.0]), [(0.0, "A".into())]);
    }
}
