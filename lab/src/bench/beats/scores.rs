//! How well found beats agree with true ones: the measures of the beat-tracking
//! literature, as mir_eval computes them (`tests` hold its values).
//!
//! All times are seconds, increasing. Callers leave out the first seconds.

/// Half the window in which a beat is hit (F measure), seconds.
const WINDOW_S: f64 = 0.07;
/// Share of a beat by which phase and period may be off (continuity).
const CONTINUITY: f64 = 0.175;

/// Twice the hits over all beats, found and true, each used once.
pub fn f_measure(truth: &[f64], found: &[f64]) -> f64 {
    let (mut hits, mut t, mut f) = (0.0, 0, 0);
    while t < truth.len() && f < found.len() {
        let off = found[f] - truth[t];
        match off.abs() <= WINDOW_S {
            true => (hits, t, f) = (hits + 1.0, t + 1, f + 1),
            false if off > 0.0 => t += 1,
            false => f += 1,
        }
    }
    match truth.len() + found.len() {
        0 => 0.0,
        all => 2.0 * hits / all as f64,
    }
}

/// The share of beats that continue a right beat at the right metrical level
/// (CMLt), and at that level, its double, its halves or its off-beat (AMLt).
pub fn continuity(truth: &[f64], found: &[f64]) -> (f64, f64) {
    if truth.len() < 3 || found.len() < 3 {
        return (0.0, 0.0);
    }
    let right = continued(truth, found);
    let every_second = |first: usize| truth.iter().skip(first).step_by(2).copied().collect();
    let between = off_beats(truth);
    let mut double: Vec<f64> = truth.iter().chain(&between).copied().collect();
    double.sort_by(f64::total_cmp);
    let levels: [Vec<f64>; 4] = [between, double, every_second(0), every_second(1)];
    let any = levels.iter().map(|level| continued(level, found)).fold(right, f64::max);
    (right, any)
}

/// The middles between true beats.
pub fn off_beats(truth: &[f64]) -> Vec<f64> {
    truth.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect()
}

fn continued(truth: &[f64], found: &[f64]) -> f64 {
    if truth.len() < 2 {
        return 0.0;
    }
    let mut used = vec![false; truth.len()];
    let mut right = 0;
    for (i, &beat) in found.iter().enumerate() {
        let nearest = nearest(truth, beat);
        if used[nearest] {
            continue;
        }
        let forward = i == 0 || nearest == 0;
        let step = |times: &[f64], at: usize| match forward && at + 1 < times.len() {
            true => times[at + 1] - times[at],
            false => times[at] - times[at.max(1) - 1],
        };
        let (period, found_period) = (step(truth, nearest), step(found, i));
        let phase = (beat - truth[nearest]).abs() / period;
        if phase < CONTINUITY && (1.0 - found_period / period).abs() < CONTINUITY {
            used[nearest] = true;
            right += 1;
        }
    }
    f64::from(right) / truth.len().max(found.len()) as f64
}

fn nearest(times: &[f64], at: f64) -> usize {
    let after = times.partition_point(|&t| t < at).min(times.len() - 1);
    match after > 0 && at - times[after - 1] <= times[after] - at {
        true => after - 1,
        false => after,
    }
}

/// The first found beat from which on all of `held_s` are hit at the true tempo.
pub fn locked_s(truth: &[f64], found: &[f64], held_s: f64) -> Option<f64> {
    if truth.len() < 2 || found.len() < 2 {
        return None;
    }
    let right = |pair: &[f64]| {
        let at = nearest(truth, pair[1]);
        let period = truth[at.max(1)] - truth[at.max(1) - 1];
        let gap = pair[1] - pair[0];
        (pair[1] - truth[at]).abs() < WINDOW_S && (gap / period - 1.0).abs() < 0.15
    };
    let hits: Vec<bool> = found.windows(2).map(right).collect();
    (0..hits.len()).find_map(|first| {
        let end = found.partition_point(|&t| t <= found[first] + held_s) - 1;
        let whole = found[found.len() - 1] >= found[first] + held_s && end > first + 1;
        (whole && hits[first..end].iter().all(|&hit| hit)).then_some(found[first])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steady(count: usize, period_s: f64, first_s: f64) -> Vec<f64> {
        (0..count).map(|i| first_s + period_s * i as f64).collect()
    }

    #[test]
    fn the_same_beats_are_right() {
        let beats = steady(40, 0.5, 5.0);
        assert_eq!(f_measure(&beats, &beats), 1.0);
        assert_eq!(continuity(&beats, &beats), (1.0, 1.0));
        assert_eq!(locked_s(&beats, &beats, 4.0), Some(5.0));
    }

    #[test]
    fn other_levels_are_told_from_the_right_one() {
        let beats = steady(40, 0.5, 5.0);
        for found in [off_beats(&beats), steady(80, 0.25, 5.0), steady(20, 1.0, 5.0)] {
            let (right, any) = continuity(&beats, &found);
            assert!(right < 0.1 && any > 0.95, "{right} {any}");
            assert_eq!(locked_s(&beats, &found, 4.0), None);
        }
        assert_eq!(f_measure(&beats, &off_beats(&beats)), 0.0);
    }

    #[test]
    fn values_are_those_of_mir_eval() {
        // mir_eval 0.8.2 on these two lists.
        let truth = steady(20, 0.5, 5.0);
        let mut found = steady(12, 0.5, 5.03);
        found.extend(steady(7, 0.55, 11.2));
        assert!((f_measure(&truth, &found) - MIR_EVAL_F).abs() < 1e-9);
        let (right, any) = continuity(&truth, &found);
        assert!((right - MIR_EVAL_CMLT).abs() < 1e-9 && (any - MIR_EVAL_AMLT).abs() < 1e-9);
    }

    const MIR_EVAL_F: f64 = 0.717_948_717_948_718;
    const MIR_EVAL_CMLT: f64 = 0.7;
    const MIR_EVAL_AMLT: f64 = 0.7;
}
