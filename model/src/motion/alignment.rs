//! Does the dance meet the beat? Kinematic beats against music beats.
//!
//! A kinematic beat is a local minimum of the mean joint speed, order 10 at
//! 60 FPS (lower than every sample within a sixth of a second). It serves
//! human motion and robot joint tracks alike: all it needs is a speed over
//! time. One direction alone can be gamed (few beats, or jitter), so
//! [`Alignment`] always carries both and their F1.

use crate::motion::Pose;

/// The rate at which the literature counts frames, Hz.
const RATE_HZ: f64 = 60.0;
/// A minimum is lower than this many samples on either side.
const ORDER: usize = 10;
/// Tolerance from kinematic to music beats (AIST++/FACT), 3 frames.
const FACT_SIGMA_S: f64 = 3.0 / RATE_HZ;
/// Tolerance from music to kinematic beats (Bailando), 5 frames.
const BAILANDO_SIGMA_S: f64 = 5.0 / RATE_HZ;
/// Two beats this close are the same beat (F1).
const F1_WINDOW_S: f64 = 0.1;

/// How well motion meets the beat; each figure from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Alignment {
    /// Mean over kinematic beats of `exp(-d^2 / 2 sigma^2)`, sigma 3 frames at
    /// 60 FPS, d the distance to the nearest music beat (AIST++/FACT). 0
    /// without kinematic beats. High for motion with few, lucky beats.
    pub fact: f64,
    /// The same mean over music beats, sigma 5 frames (Bailando). 0 without
    /// music beats. High for motion that jitters.
    pub bailando: f64,
    /// Harmonic mean of the shares of kinematic and music beats that have a
    /// partner within 100 ms, each used once.
    pub f1: f64,
}

/// Scores motion whose mean joint speed is `speed[k]` at `k / rate_hz` seconds
/// against beats on the same clock. Beats outside the motion do not count.
pub fn alignment(speed: &[f64], rate_hz: f64, music_beats_s: &[f64]) -> Alignment {
    let end_s = speed.len().saturating_sub(1) as f64 / rate_hz;
    let mut music: Vec<f64> =
        music_beats_s.iter().copied().filter(|beat| (0.0..=end_s).contains(beat)).collect();
    music.sort_by(f64::total_cmp);
    let kinematic = kinematic_beats_s(speed, rate_hz);
    Alignment {
        fact: closeness(&kinematic, &music, FACT_SIGMA_S),
        bailando: closeness(&music, &kinematic, BAILANDO_SIGMA_S),
        f1: f1(&kinematic, &music),
    }
}

/// The times of the local minima of `speed`, seconds, sorted.
pub fn kinematic_beats_s(speed: &[f64], rate_hz: f64) -> Vec<f64> {
    let speed = resampled(speed, rate_hz);
    let lowest_around = |i: usize| {
        let from = i.saturating_sub(ORDER);
        let to = (i + ORDER).min(speed.len() - 1);
        (from..=to).all(|k| k == i || speed[i] < speed[k])
    };
    (1..speed.len().saturating_sub(1))
        .filter(|i| lowest_around(*i))
        .map(|i| i as f64 / RATE_HZ)
        .collect()
}

/// Mean speed of all joints at every frame, metres a second: the mean of the
/// step to the frame and the step from it, so that sample k belongs to the
/// time of frame k. As many values as frames.
pub fn mean_joint_speed(poses: &[Pose], rate_hz: f64) -> Vec<f64> {
    let steps: Vec<f64> = poses
        .windows(2)
        .map(|pair| {
            let moved = pair[0].iter().zip(&pair[1]).map(|(a, b)| {
                let squared = (0..3).map(|k| f64::from(b[k] - a[k]).powi(2));
                squared.sum::<f64>().sqrt()
            });
            moved.sum::<f64>() / pair[0].len() as f64 * rate_hz
        })
        .collect();
    let step = |i: usize| steps.get(i).copied();
    (0..poses.len())
        .map(|i| {
            let before = i.checked_sub(1).and_then(step);
            match (before, step(i)) {
                (Some(a), Some(b)) => (a + b) / 2.0,
                (Some(a), None) | (None, Some(a)) => a,
                (None, None) => 0.0,
            }
        })
        .collect()
}

/// `values` at 60 Hz, by Catmull-Rom splines: a straight line would pull every
/// minimum onto a sample of the slower rate.
fn resampled(values: &[f64], rate_hz: f64) -> Vec<f64> {
    let Some(last) = values.len().checked_sub(1) else {
        return Vec::new();
    };
    let frames = (last as f64 / rate_hz * RATE_HZ + 1e-9).floor() as usize + 1;
    let at = |i: isize| values[i.clamp(0, last as isize) as usize];
    (0..frames)
        .map(|frame| {
            let position = frame as f64 * rate_hz / RATE_HZ;
            let i = (position + 1e-9).floor();
            let t = position - i;
            let i = i as isize;
            let [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
            let (m0, m1) = ((c - a) / 2.0, (d - b) / 2.0);
            let (t2, t3) = (t * t, t * t * t);
            (2.0 * t3 - 3.0 * t2 + 1.0) * b
                + (t3 - 2.0 * t2 + t) * m0
                + (3.0 * t2 - 2.0 * t3) * c
                + (t3 - t2) * m1
        })
        .collect()
}

fn closeness(of: &[f64], to: &[f64], sigma_s: f64) -> f64 {
    if of.is_empty() || to.is_empty() {
        return 0.0;
    }
    let near = |beat: &f64| {
        let distance = to.iter().map(|other| (other - beat).abs()).fold(f64::INFINITY, f64::min);
        (-0.5 * (distance / sigma_s).powi(2)).exp()
    };
    of.iter().map(near).sum::<f64>() / of.len() as f64
}

/// F1 of two sorted lists. Walking both from the left and pairing what fits
/// finds the largest matching, because all windows have one width.
fn f1(kinematic: &[f64], music: &[f64]) -> f64 {
    let (mut i, mut j, mut hits) = (0, 0, 0);
    while let (Some(a), Some(b)) = (kinematic.get(i), music.get(j)) {
        if (a - b).abs() <= F1_WINDOW_S + 1e-9 {
            hits += 1;
            i += 1;
            j += 1;
        } else if a < b {
            i += 1;
        } else {
            j += 1;
        }
    }
    let total = kinematic.len() + music.len();
    if total == 0 { 0.0 } else { 2.0 * f64::from(hits) / total as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten seconds of a speed that is lowest every half second.
    fn bouncing(rate_hz: f64, shift_s: f64) -> Vec<f64> {
        let samples = (10.0 * rate_hz) as usize + 1;
        let speed = |k: usize| {
            let phase = (k as f64 / rate_hz - shift_s) / 0.5;
            1.0 - (std::f64::consts::TAU * phase).cos()
        };
        (0..samples).map(speed).collect()
    }

    fn beats(first: u32) -> Vec<f64> {
        (first..20).map(|i| f64::from(i) * 0.5).collect()
    }

    #[test]
    fn motion_on_the_beat_scores_one_at_any_rate() {
        for rate_hz in [20.0, 60.0, 100.0] {
            let score = alignment(&bouncing(rate_hz, 0.0), rate_hz, &beats(1));
            for figure in [score.fact, score.bailando, score.f1] {
                assert!(figure > 0.999, "{score:?} at {rate_hz} Hz");
            }
        }
    }

    #[test]
    fn three_frames_late_costs_one_sigma() {
        let score = alignment(&bouncing(60.0, 0.05), 60.0, &beats(0));
        assert!((score.fact - (-0.5f64).exp()).abs() < 0.01, "{score:?}");
        assert!((score.bailando - (-0.18f64).exp()).abs() < 0.01, "{score:?}");
        assert!(score.f1 > 0.97, "{score:?}");
    }

    #[test]
    fn motion_off_the_beat_scores_nothing() {
        let score = alignment(&bouncing(20.0, 0.25), 20.0, &beats(1));
        assert!(score.fact < 1e-3 && score.bailando < 0.02 && score.f1 == 0.0, "{score:?}");
    }

    #[test]
    fn twice_as_many_beats_as_music_halves_the_precision() {
        // 20 minima, 10 of them on the 10 music beats: hits 10 of 10 and 20.
        let music: Vec<f64> = (0..10).map(|i| f64::from(i) + 0.5).collect();
        let kinematic: Vec<f64> = (1..=20).map(|i| f64::from(i) * 0.5).collect();
        assert!((f1(&kinematic, &music) - 20.0 / 30.0).abs() < 1e-12);
    }

    #[test]
    fn standing_still_has_no_beats() {
        assert_eq!(alignment(&[0.0; 200], 20.0, &beats(1)), Alignment::default());
        assert_eq!(alignment(&[], 20.0, &[]), Alignment::default());
    }

    #[test]
    fn mean_speed_belongs_to_its_frame() {
        let mut poses = vec![[[0.0; 3]; 22]; 3];
        poses[1] = [[0.1, 0.0, 0.0]; 22];
        poses[2] = [[0.1, 0.0, 0.0]; 22];
        let speed = mean_joint_speed(&poses, 20.0);
        for (actual, wanted) in speed.iter().zip([2.0, 1.0, 0.0]) {
            assert!((actual - wanted).abs() < 1e-6, "{speed:?}");
        }
    }
}
