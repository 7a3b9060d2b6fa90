//! Kinematic beats and tempo of captured motion.
//!
//! People slow down on the beat. Beat times are the path through the minima of
//! the mean joint speed that keeps a steady interval (dynamic programming, the
//! interval within 15 % of the tempo's). Every tempo is judged against the same
//! search in motion with the same spectrum and random phases, so that a score
//! means something and slow tempi are not favoured for choosing fewer minima.
//!
//! Offline: whole clips. Times in seconds.

use std::f64::consts::{PI, TAU};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use servodance_model::motion::Clip;
use servodance_model::motion::alignment::{alignment, mean_joint_speed};

/// Shorter clips have no tempo, seconds.
const SHORTEST_S: f64 = 5.0;
const RATE_HZ: f64 = 60.0;
/// Tempi that are considered, seconds a beat, and how many.
const PERIODS_S: (f64, f64, usize) = (0.36, 0.86, 32);
/// How strongly an interval is held at the tempo.
const TIGHTNESS: f64 = 60.0;
/// Intervals stay within these shares of the tempo's.
const INTERVAL_SHARES: (f64, f64) = (0.87, 1.15);
/// Noises that the clip is compared with.
const SURROGATES: usize = 40;
/// The usual beat, seconds, and the width of that belief in octaves.
const USUAL: (f64, f64) = (0.52, 0.45);

#[derive(Clone, Debug, PartialEq)]
pub struct KinematicTempo {
    pub period_s: f64,
    pub beats_s: Vec<f64>,
    /// Share of noises with the same broad spectrum and less of a beat: strict, for real dance.
    pub confidence: f64,
    /// How well the beats meet the local minima of the joint speed: F1, 0 to 1.
    pub f1: f64,
}

/// The tempo of a clip; `None` when it is shorter than five seconds.
pub fn estimate(clip: &Clip) -> Option<KinematicTempo> {
    if clip.duration_s() < SHORTEST_S {
        return None;
    }
    let (shortest, longest, count) = PERIODS_S;
    let periods: Vec<f64> = (0..count)
        .map(|i| shortest * (longest / shortest).powf(i as f64 / (count - 1) as f64))
        .collect();
    let hits = hits(clip);
    let scores =
        |hits: &[f64]| -> Vec<f64> { periods.iter().map(|p| path(hits, p * RATE_HZ).0).collect() };
    let mut rng = ChaCha8Rng::seed_from_u64(clip.poses.len() as u64);
    let spectrum = SmoothSpectrum::of(&hits);
    let nulls: Vec<Vec<f64>> = (0..SURROGATES).map(|_| scores(&spectrum.noise(&mut rng))).collect();
    let (mean, spread) = column_statistics(&nulls);
    let best = |scores: &[f64]| {
        let judged = scores.iter().enumerate().map(|(i, score)| {
            let octaves = (periods[i] / USUAL.0).log2() / USUAL.1;
            (i, (score - mean[i]) / spread[i] - 0.5 * octaves * octaves)
        });
        judged.fold((0, f64::NEG_INFINITY), |a, b| if b.1 > a.1 { b } else { a })
    };
    let (index, score) = best(&scores(&hits));
    let beaten = nulls.iter().filter(|null| best(null).1 < score).count();
    let (_, frames) = path(&hits, periods[index] * RATE_HZ);
    let beats_s: Vec<f64> = frames.iter().map(|i| *i as f64 / RATE_HZ).collect();
    let speed = mean_joint_speed(&clip.poses, clip.fps);
    let span = beats_s.last()? - beats_s.first()?;
    Some(KinematicTempo {
        period_s: span / (beats_s.len().max(2) - 1) as f64,
        confidence: beaten as f64 / SURROGATES as f64,
        f1: alignment(&speed, clip.fps, &beats_s).f1,
        beats_s,
    })
}

/// Where in a beat a dancer is who lingers on the beats and hurries between them: a share of
/// the beat for a share of its time, both 0 to 1. `emphasis` 0 is steady, 1 stops on the beats.
pub fn eased(share: f64, emphasis: f64) -> f64 {
    share - emphasis / TAU * (TAU * share).sin()
}

/// The clip with its beats `period_s` apart, and those beats; cut before the first, after the
/// last. What `emphasis` does: [`eased`].
pub fn onto_grid(
    clip: &Clip,
    tempo: &KinematicTempo,
    period_s: f64,
    emphasis: f64,
) -> (Clip, Vec<f64>) {
    let beats = &tempo.beats_s;
    let last = beats.len().saturating_sub(1);
    let at = |i: isize| beats[i.clamp(0, last as isize) as usize];
    let end_s = last as f64 * period_s;
    let times: Vec<f64> = (0..=(end_s * clip.fps).floor() as usize)
        .map(|frame| {
            let position = frame as f64 / clip.fps / period_s;
            let i = position.floor();
            let t = eased(position - i, emphasis);
            let i = i as isize;
            let [b, c] = [at(i), at(i + 1)];
            // One-sided slopes at the ends keep the rate of play steady there.
            let m0 = if i == 0 { c - b } else { (c - at(i - 1)) / 2.0 };
            let m1 = if i + 1 >= last as isize { c - b } else { (at(i + 2) - b) / 2.0 };
            let (t2, t3) = (t * t, t * t * t);
            (2.0 * t3 - 3.0 * t2 + 1.0) * b
                + (t3 - 2.0 * t2 + t) * m0
                + (3.0 * t2 - 2.0 * t3) * c
                + (t3 - t2) * m1
        })
        .collect();
    let grid = (0..=last).map(|i| i as f64 * period_s).collect();
    (clip.at_times(&times, clip.fps), grid)
}

/// Low speed against the second around it; mean 0, deviation 1, at 60 Hz.
fn hits(clip: &Clip) -> Vec<f64> {
    let speed: Vec<f64> =
        mean_joint_speed(&clip.poses, clip.fps).iter().map(|v| -(v + 0.05).ln()).collect();
    let around = smoothed(&speed, 0.6 * clip.fps);
    let near = smoothed(&speed, 0.05 * clip.fps);
    let frames = (clip.duration_s() * RATE_HZ) as usize + 1;
    let mut hits: Vec<f64> = (0..frames)
        .map(|frame| {
            let position = frame as f64 / RATE_HZ * clip.fps;
            let i = (position.floor() as usize).min(near.len() - 1);
            let next = (i + 1).min(near.len() - 1);
            let t = position - i as f64;
            let value = |i: usize| near[i] - around[i];
            value(i) * (1.0 - t) + value(next) * t
        })
        .collect();
    standardise(&mut hits);
    hits
}

fn standardise(values: &mut [f64]) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    for value in values {
        *value = ((*value - mean) / spread.max(1e-9)).clamp(-1.5, 2.5);
    }
}

/// Gaussian mean over `sigma` samples.
pub fn smoothed(values: &[f64], sigma: f64) -> Vec<f64> {
    let reach = (3.0 * sigma).ceil() as isize;
    let last = values.len() as isize - 1;
    (0..=last)
        .map(|i| {
            let (mut sum, mut total) = (0.0, 0.0);
            for k in (i - reach).max(0)..=(i + reach).min(last) {
                let weight = (-0.5 * ((k - i) as f64 / sigma).powi(2)).exp();
                sum += weight * values[k as usize];
                total += weight;
            }
            sum / total
        })
        .collect()
}

/// The best beats about `period` frames apart, and their score: sum of hits / sqrt(count).
fn path(hits: &[f64], period: f64) -> (f64, Vec<usize>) {
    let from = (INTERVAL_SHARES.0 * period).ceil() as usize;
    let until = (INTERVAL_SHARES.1 * period).floor() as usize;
    let cost: Vec<f64> =
        (from..=until).map(|lag| TIGHTNESS * (lag as f64 / period).ln().powi(2)).collect();
    let mut total = hits.to_vec();
    let mut before = vec![usize::MAX; hits.len()];
    for i in from..hits.len() {
        let mut best = if i < until { 0.0 } else { f64::NEG_INFINITY };
        for (k, cost) in cost.iter().enumerate() {
            let Some(previous) = i.checked_sub(from + k) else {
                break;
            };
            if total[previous] - cost > best {
                best = total[previous] - cost;
                before[i] = previous;
            }
        }
        total[i] += best;
    }
    let tail = hits.len().saturating_sub(until)..hits.len();
    let Some(end) = tail.max_by(|a, b| total[*a].total_cmp(&total[*b])) else {
        return (0.0, Vec::new());
    };
    let mut frames = vec![end];
    while before[frames[frames.len() - 1]] != usize::MAX {
        frames.push(before[frames[frames.len() - 1]]);
    }
    frames.reverse();
    (total[end] / (frames.len() as f64).sqrt(), frames)
}

fn column_statistics(rows: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let n = rows.len() as f64;
    (0..rows[0].len())
        .map(|i| {
            let mean = rows.iter().map(|row| row[i]).sum::<f64>() / n;
            let square = rows.iter().map(|row| (row[i] - mean).powi(2)).sum::<f64>() / n;
            (mean, square.sqrt().max(1e-9))
        })
        .unzip()
}

/// The broad spectrum of a signal below 6 Hz (above it, speed carries no
/// beat): lines are smeared out, because a line is what a beat looks like.
struct SmoothSpectrum {
    amplitudes: Vec<f64>,
    length: usize,
}

impl SmoothSpectrum {
    const TOP_HZ: f64 = 6.0;
    const SMEAR_HZ: f64 = 1.0;

    fn of(signal: &[f64]) -> Self {
        let length = signal.len();
        let bins_per_hz = length as f64 / RATE_HZ;
        let power: Vec<f64> = (1..=(Self::TOP_HZ * bins_per_hz) as usize)
            .map(|k| {
                let step = TAU * k as f64 / length as f64;
                let (mut re, mut im) = (0.0, 0.0);
                for (i, value) in signal.iter().enumerate() {
                    let (sin, cos) = (step * i as f64).sin_cos();
                    re += value * cos;
                    im += value * sin;
                }
                (re * re + im * im) * 4.0 / (length as f64).powi(2)
            })
            .collect();
        let broad = smoothed(&power, Self::SMEAR_HZ * bins_per_hz);
        Self { amplitudes: broad.iter().map(|power| power.sqrt()).collect(), length }
    }

    fn noise(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let mut out = vec![0.0; self.length];
        for (k, amplitude) in self.amplitudes.iter().enumerate() {
            let step = TAU * (k + 1) as f64 / self.length as f64;
            let phase = rng.random_range(-PI..PI);
            // Rayleigh: the amplitude of one bin of Gaussian noise.
            let amplitude = amplitude * (-rng.random_range(f64::MIN_POSITIVE..1.0).ln()).sqrt();
            // Rotating a phasor costs no sine a sample.
            let (step_sin, step_cos) = step.sin_cos();
            let (mut sin, mut cos) = phase.sin_cos();
            for value in &mut out {
                *value += amplitude * cos;
                (sin, cos) = (sin * step_cos + cos * step_sin, cos * step_cos - sin * step_sin);
            }
        }
        standardise(&mut out);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Swings that stop every `period_s`, first at `first_s`.
    fn swinging(period_s: f64, first_s: f64) -> Clip {
        let poses = (0..400)
            .map(|i| {
                let phase = (f64::from(i) / 20.0 - first_s) / period_s;
                let swing = 0.2 * (PI * phase).cos();
                std::array::from_fn(|j| [swing as f32, 0.05 * j as f32, 0.0])
            })
            .collect();
        Clip { name: "swing".into(), fps: 20.0, poses }
    }

    #[test]
    fn a_swing_has_its_period_and_its_turning_points() {
        let tempo = estimate(&swinging(0.6, 0.2)).unwrap();
        assert!((tempo.period_s - 0.6).abs() < 0.01, "{tempo:?}");
        for beat in &tempo.beats_s {
            let off = ((beat - 0.2) / 0.6 - ((beat - 0.2) / 0.6).round()).abs() * 0.6;
            assert!(off < 0.05, "beat at {beat} is {off} s off");
        }
    }

    #[test]
    fn a_warped_clip_has_its_beats_on_the_grid() {
        let clip = swinging(0.6, 0.2);
        let tempo = estimate(&clip).unwrap();
        let (warped, grid) = onto_grid(&clip, &tempo, 0.5, 0.0);
        assert_eq!(grid.len(), tempo.beats_s.len());
        let again = estimate(&warped).unwrap();
        assert!((again.period_s - 0.5).abs() < 0.01, "{}", again.period_s);
    }

    #[test]
    fn a_dancer_who_lingers_is_slow_on_the_beats() {
        let clip = Clip::of_frames(
            (0..200).map(|i| [[0.02 * i as f32, 0.0, 0.0]; 22]).collect::<Vec<_>>(),
        );
        let beats_s: Vec<f64> = (0..16).map(|i| 0.6 * f64::from(i)).collect();
        let steady = KinematicTempo { period_s: 0.6, beats_s, confidence: 1.0, f1: 1.0 };
        let (danced, grid) = onto_grid(&clip, &steady, 0.5, 0.4);
        let speed = mean_joint_speed(&danced.poses, danced.fps);
        assert!(alignment(&speed, danced.fps, &grid).f1 > 0.9);
        assert_eq!([0.0, 0.5, 1.0].map(|share| eased(share, 0.4)), [0.0, 0.5, 1.0]);
    }

    #[test]
    fn short_clips_have_no_tempo() {
        let mut clip = swinging(0.6, 0.2);
        clip.poses.truncate(60);
        assert_eq!(estimate(&clip), None);
    }
}
