//! The Bradley-Terry model: how strong each of several sides is, from who won against whom.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Rounds of the fixed-point iteration (Hunter 2004), which converges from anywhere.
const ROUNDS: usize = 500;
/// Each pair of sides that met begins with so many wins on either side, so that a side that
/// always won is not infinitely strong.
const PRIOR: f64 = 0.5;
const RESAMPLES: usize = 1000;

/// One meeting of two sides: the first one's share of the win (1, 0, or 0.5 for a tie).
pub(super) type Meeting = (usize, usize, f64);

/// Strengths on a logarithmic scale (nats), side 0 at 0: a side that is stronger by `d` wins
/// with the probability 1 / (1 + exp(-d)).
pub(super) fn strengths(sides: usize, meetings: &[Meeting]) -> Vec<f64> {
    let mut wins = vec![vec![0.0; sides]; sides];
    for &(a, b, share) in meetings {
        if wins[a][b] + wins[b][a] == 0.0 {
            wins[a][b] = PRIOR;
            wins[b][a] = PRIOR;
        }
        wins[a][b] += share;
        wins[b][a] += 1.0 - share;
    }
    let mut strength = vec![1.0; sides];
    for _ in 0..ROUNDS {
        let next: Vec<f64> = (0..sides)
            .map(|a| {
                let won: f64 = wins[a].iter().sum();
                let met = (0..sides)
                    .filter(|b| *b != a)
                    .map(|b| (wins[a][b] + wins[b][a]) / (strength[a] + strength[b]));
                let met: f64 = met.sum();
                if met > 0.0 { won / met } else { strength[a] }
            })
            .collect();
        strength = next.iter().map(|s| s / next[0]).collect();
    }
    strength.iter().map(|s| s.ln()).collect()
}

/// 95 % intervals of the strengths over votes drawn again with replacement.
pub(super) fn intervals(sides: usize, meetings: &[Meeting], seed: u64) -> Vec<[f64; 2]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let drawn: Vec<Vec<f64>> = (0..RESAMPLES)
        .map(|_| {
            let again: Vec<Meeting> =
                meetings.iter().map(|_| meetings[rng.random_range(0..meetings.len())]).collect();
            strengths(sides, &again)
        })
        .collect();
    let of_side = |side: usize| {
        let mut values: Vec<f64> = drawn.iter().map(|row| row[side]).collect();
        values.sort_by(f64::total_cmp);
        [values[RESAMPLES / 40], values[RESAMPLES - 1 - RESAMPLES / 40]]
    };
    (0..sides).map(of_side).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sides_have_the_odds_of_their_wins() {
        let meetings: Vec<Meeting> = (0..40).map(|i| (0, 1, f64::from(u8::from(i < 30)))).collect();
        let found = strengths(2, &meetings);
        // 30.5 wins against 10.5, with the prior.
        assert!((found[1] + (30.5f64 / 10.5).ln()).abs() < 1e-9, "{found:?}");
        let [low, high] = intervals(2, &meetings, 1)[1];
        assert!(low < found[1] && found[1] < high && high < 0.0, "{low} {high}");
    }

    #[test]
    fn a_side_that_beats_a_strong_one_is_stronger_than_one_that_beats_a_weak_one() {
        let mut meetings = vec![(0, 1, 1.0); 9];
        meetings.push((0, 1, 0.0));
        meetings.extend([(2, 0, 1.0), (2, 0, 0.5), (3, 1, 1.0), (3, 1, 0.5)]);
        let found = strengths(4, &meetings);
        assert!(found[2] > found[3] + 1.0, "{found:?}");
    }
}
