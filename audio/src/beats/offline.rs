//! Beats with the whole piece known: for scoring, never for dancing.
//!
//! A tempo curve by dynamic programming over windowed autocorrelation, then
//! beats by dynamic programming (Ellis 2007): each beat should fall on a strong
//! onset, one local period after the one before.

use super::history::History;
use super::tempo::{TEMPI, fits, period};

/// Length of the window and distance of the looks at the tempo, seconds.
const WINDOW_S: f64 = 10.0;
const STEP_S: f64 = 0.5;
/// Cost of a change of tempo by one of the [`TEMPI`] in one step, and the most.
const CHANGE_COST: f32 = 0.6;
const CHANGE_LIMIT: f32 = 8.0;
/// Cost of an interval that is not the period (Ellis's tightness).
const TIGHTNESS: f32 = 100.0;

/// The beats of a piece.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BeatTrack {
    /// Median tempo, beats a minute; 0 if there are fewer than two beats.
    pub tempo_bpm: f64,
    /// Beat times in seconds, increasing.
    pub times_s: Vec<f64>,
}

/// Finds the beats of a piece from its onsets. No music, no beats.
pub fn track_offline(history: &History) -> BeatTrack {
    let onsets = normalised(&history.onsets);
    let strongest = onsets.iter().fold(0.0f32, |m, &v| m.max(v));
    if strongest <= 0.0 || (onsets.len() as f64) < 2.0 * history.onset_rate_hz {
        return BeatTrack::default();
    }
    let periods = tempo_curve(&onsets, history.onset_rate_hz);
    let beats = best_beats(&onsets, &periods);
    let times_s: Vec<f64> = trimmed(&beats, &onsets)
        .iter()
        .map(|&index| history.onset_time_s(index))
        .filter(|&time| time >= 0.0)
        .collect();
    BeatTrack {
        tempo_bpm: median_tempo_bpm(&times_s),
        times_s,
    }
}

/// Onsets over their standard deviation, smoothed a little.
fn normalised(onsets: &[f32]) -> Vec<f32> {
    let count = onsets.len().max(1) as f32;
    let mean = onsets.iter().sum::<f32>() / count;
    let variance = onsets.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / count;
    let scale = 1.0 / variance.sqrt().max(1e-9);
    let at = |i: usize| onsets.get(i).copied().unwrap_or(0.0);
    (0..onsets.len())
        .map(|i| scale * (0.25 * at(i.wrapping_sub(1)) + 0.5 * at(i) + 0.25 * at(i + 1)))
        .collect()
}

/// The period in hops at every onset value.
fn tempo_curve(onsets: &[f32], rate_hz: f64) -> Vec<f32> {
    let step = (STEP_S * rate_hz) as usize;
    let half = (WINDOW_S * rate_hz / 2.0) as usize;
    let looks = onsets.len() / step + 1;
    let evidence: Vec<[f32; TEMPI]> = (0..looks)
        .map(|look| {
            let centre = look * step;
            let end = (centre + half).min(onsets.len());
            fits(&onsets[centre.saturating_sub(half)..end])
                .likelihood
                .map(f32::ln)
        })
        .collect();
    let path = best_tempi(&evidence);
    (0..onsets.len())
        .map(|i| period(path[i / step]) as f32)
        .collect()
}

/// The path through the tempi with the best evidence and few changes.
fn best_tempi(evidence: &[[f32; TEMPI]]) -> Vec<usize> {
    let change = |a: usize, b: usize| (CHANGE_COST * a.abs_diff(b) as f32).min(CHANGE_LIMIT);
    let mut score = [0.0f32; TEMPI];
    let mut from = Vec::with_capacity(evidence.len());
    for now in evidence {
        let best: [(f32, usize); TEMPI] = std::array::from_fn(|to| {
            (0..TEMPI)
                .map(|old| (score[old] - change(old, to), old))
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((0.0, to))
        });
        score = std::array::from_fn(|to| best[to].0 + now[to]);
        from.push(best.map(|(_, old)| old));
    }
    let mut tempo = (0..TEMPI)
        .max_by(|&a, &b| score[a].total_cmp(&score[b]))
        .unwrap_or(0);
    let mut path = vec![tempo; evidence.len()];
    for look in (1..evidence.len()).rev() {
        tempo = from[look][tempo];
        path[look - 1] = tempo;
    }
    path
}

/// Indices of the beats: the best chain of onsets (Ellis 2007).
fn best_beats(onsets: &[f32], periods: &[f32]) -> Vec<usize> {
    let mut score = vec![0.0f32; onsets.len()];
    let mut from = vec![usize::MAX; onsets.len()];
    for now in 0..onsets.len() {
        let period = periods[now];
        let longest = (2.0 * period) as usize;
        let shortest = (0.5 * period) as usize;
        let mut best = (0.0f32, usize::MAX);
        for lag in shortest..=longest.min(now) {
            let stretch = (lag as f32 / period).ln();
            let value = score[now - lag] - TIGHTNESS * stretch * stretch;
            if value > best.0 {
                best = (value, now - lag);
            }
        }
        score[now] = onsets[now] + best.0;
        from[now] = best.1;
    }
    let tail = onsets.len() - (periods[onsets.len() - 1] as usize).min(onsets.len());
    let last = (tail..onsets.len()).max_by(|&a, &b| score[a].total_cmp(&score[b]));
    let mut beats = Vec::new();
    let mut next = last.unwrap_or(usize::MAX);
    while next != usize::MAX {
        beats.push(next);
        next = from[next];
    }
    beats.reverse();
    beats
}

/// Without the beats before the first and after the last audible one.
fn trimmed<'a>(beats: &'a [usize], onsets: &[f32]) -> &'a [usize] {
    let strength = |&beat: &usize| {
        let near = beat.saturating_sub(4)..(beat + 5).min(onsets.len());
        onsets[near].iter().fold(0.0f32, |m, &v| m.max(v))
    };
    let mean = beats.iter().map(strength).sum::<f32>() / beats.len().max(1) as f32;
    let loud = |beat: &usize| strength(beat) > 0.3 * mean;
    let first = beats.iter().position(loud).unwrap_or(0);
    let last = beats.iter().rposition(loud).map_or(0, |l| l + 1);
    &beats[first..last.max(first)]
}

fn median_tempo_bpm(times_s: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).collect();
    intervals.sort_by(f64::total_cmp);
    intervals.get(intervals.len() / 2).map_or(0.0, |s| 60.0 / s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MusicAnalyzer;
    use crate::song::Song;

    #[test]
    fn beats_of_the_demo_are_found_through_its_tempo_change() {
        let song = Song::demo();
        let mut analyzer = MusicAnalyzer::keeping_history(song.sample_rate_hz).unwrap();
        analyzer.push(&song.samples);
        let track = track_offline(analyzer.history().unwrap());
        let near = |beat: &&f64| track.times_s.iter().any(|t| (t - **beat).abs() < 0.05);
        let hit = song.beats_s.iter().filter(near).count();
        assert!(
            hit * 10 >= song.beats_s.len() * 8 && track.times_s.len() <= song.beats_s.len() + 4,
            "{hit} of {} beats hit by {}",
            song.beats_s.len(),
            track.times_s.len()
        );
        assert!((110.0..130.0).contains(&track.tempo_bpm), "{track:?}");
    }

    #[test]
    fn silence_has_no_beats() {
        let history = History {
            onset_rate_hz: 160.0,
            onsets: vec![0.0; 1600],
            ..History::default()
        };
        assert_eq!(track_offline(&history), BeatTrack::default());
        assert_eq!(track_offline(&History::default()), BeatTrack::default());
    }
}
