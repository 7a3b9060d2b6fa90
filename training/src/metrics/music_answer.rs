//! Whether a dance answers its music: more movement where it is louder, another figure
//! where another section begins.

use super::repetition::{BodyPose, distance_m, figure};
use servodance_model::motion::{Clip, mean_joint_speed};

/// Beats of a figure before and after a moment that are compared.
const BEATS: usize = 4;
/// A figure changes where the distance is the largest of so many beats on either side,
const PEAK_BEATS: usize = 2;
/// and so many deviations above the mean.
const PEAK_DEVIATIONS: f64 = 0.5;

/// Mean joint speed of each bar, m/s; bars begin at `bars_s`, seconds, the last time ends the
/// last bar.
pub fn speed_by_bar(clip: &Clip, bars_s: &[f64]) -> Vec<f64> {
    let speed = mean_joint_speed(&clip.poses, clip.fps);
    let frame = |time_s: f64| ((time_s * clip.fps).round().max(0.0) as usize).min(speed.len());
    let bar = |pair: &[f64]| {
        let frames = &speed[frame(pair[0])..frame(pair[1])];
        frames.iter().sum::<f64>() / frames.len().max(1) as f64
    };
    bars_s.windows(2).map(bar).collect()
}

/// Pearson's correlation; `None` where one of the two does not change, or below four values.
pub fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let n = a.len().min(b.len());
    let mean = |values: &[f64]| values[..n].iter().sum::<f64>() / n as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut both, mut of_a, mut of_b) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        both += (x - mean_a) * (y - mean_b);
        of_a += (x - mean_a).powi(2);
        of_b += (y - mean_b).powi(2);
    }
    let spread = (of_a * of_b).sqrt();
    (n >= 4 && spread > 1e-12).then(|| both / spread)
}

/// The beats at which a dance goes over to another figure: where the four beats before and
/// the four after are further apart than at the beats around. Numbers into `beats_s`.
pub fn figure_changes(clip: &Clip, beats_s: &[f64]) -> Vec<usize> {
    let end_s = clip.duration_s();
    let figures: Vec<Option<Vec<BodyPose>>> = (0..beats_s.len())
        .map(|at| {
            let until = *beats_s.get(at + BEATS)?;
            (until <= end_s).then(|| figure(clip, beats_s[at], until))
        })
        .collect();
    let apart = |at: usize| -> Option<f64> {
        let before = figures[at.checked_sub(BEATS)?].as_ref()?;
        Some(distance_m(before, figures[at].as_ref()?))
    };
    peaks(&(0..beats_s.len()).map(apart).collect::<Vec<_>>(), PEAK_BEATS)
}

/// Places that are the largest of `reach` on either side and clearly above the mean.
pub fn peaks(values: &[Option<f64>], reach: usize) -> Vec<usize> {
    let known: Vec<f64> = values.iter().copied().flatten().collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    let variance = known.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    let deviation = (variance / known.len().max(1) as f64).sqrt();
    let is_peak = |at: &usize| {
        let around = &values[at.saturating_sub(reach)..(at + reach + 1).min(values.len())];
        values[*at].is_some_and(|value| {
            value > mean + PEAK_DEVIATIONS * deviation
                && around.iter().flatten().all(|other| *other <= value)
        })
    };
    (0..values.len()).filter(is_peak).collect()
}

/// How many of the changes of section have a change of figure within a beat, and how many
/// would by chance: the share of all beats that have one within a beat. `None` without
/// changes of section.
pub fn section_answer(sections: &[usize], figures: &[usize], beats: usize) -> Option<[f64; 2]> {
    let is_near = |beat: usize| figures.iter().any(|figure| figure.abs_diff(beat) <= 1);
    let hit = sections.iter().filter(|section| is_near(**section)).count();
    let covered = (0..beats).filter(|beat| is_near(*beat)).count();
    (!sections.is_empty() && beats > 0)
        .then(|| [hit as f64 / sections.len() as f64, covered as f64 / beats as f64])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One wrist swings over two beats of half a second; from `change_s` on the other one.
    fn dance(change_s: f64, size: impl Fn(f64) -> f64) -> Clip {
        let pose = |i: usize| {
            let t = i as f64 / 20.0;
            let mut pose: [[f32; 3]; 22] = std::array::from_fn(|j| [0.01 * j as f32, 1.0, 0.0]);
            let wrist = if t < change_s { 20 } else { 21 };
            pose[wrist][1] += (size(t) * (std::f64::consts::TAU * t).sin()) as f32;
            pose
        };
        Clip::of_frames((0..400).map(pose).collect())
    }

    fn beats() -> Vec<f64> {
        (0..40).map(|i| 0.5 * f64::from(i)).collect()
    }

    #[test]
    fn another_wrist_is_another_figure() {
        let changes = figure_changes(&dance(10.0, |_| 0.3), &beats());
        assert_eq!(changes, [20]);
        let answer = section_answer(&[19], &changes, 40).unwrap();
        assert_eq!(answer, [1.0, 3.0 / 40.0]);
        assert_eq!(section_answer(&[10], &changes, 40).unwrap()[0], 0.0);
        assert_eq!(section_answer(&[], &changes, 40), None);
    }

    #[test]
    fn larger_movement_in_louder_bars_correlates() {
        let loud = |t: f64| if ((t / 2.0) as usize).is_multiple_of(2) { 0.1 } else { 0.3 };
        let bars: Vec<f64> = (0..10).map(|i| 2.0 * f64::from(i)).collect();
        let speed = speed_by_bar(&dance(99.0, loud), &bars);
        let loudness: Vec<f64> = (0..9).map(|i| f64::from(i % 2)).collect();
        assert!(correlation(&loudness, &speed).unwrap() > 0.99, "{speed:?}");
        let quiet: Vec<f64> = loudness.iter().map(|v| 1.0 - v).collect();
        assert!(correlation(&quiet, &speed).unwrap() < -0.99);
        assert_eq!(correlation(&[1.0; 9], &speed), None);
    }
}
