//! What the beat network hears: two hops of band rises, and the band levels.

use crate::onset::{BANDS, HOP, Onset, OnsetDetector};
use crate::resample::Resampler;
use crate::spectrum::Sliding;

/// Values a step of the network takes.
pub const INPUTS: usize = 2 * BANDS + BANDS / 2;

/// The input of one step: the older hop's rises, the newer hop's, the levels.
pub(crate) fn input(older: &Onset, newer: &Onset) -> [f32; INPUTS] {
    let mut out = [0.0; INPUTS];
    out[..BANDS].copy_from_slice(&older.rises);
    out[BANDS..2 * BANDS].copy_from_slice(&newer.rises);
    out[2 * BANDS..].copy_from_slice(&newer.levels);
    out
}

/// All inputs of a piece, 80 a second, to train the network with. Step `k`
/// knows the samples before `(k + 1) / 80` seconds, less the resampler's delay.
pub fn inputs_of(samples: &[f32], rate_hz: u32) -> Vec<[f32; INPUTS]> {
    let mut resampler = Resampler::new(rate_hz, crate::ANALYSIS_RATE_HZ);
    let mut recent = Sliding::new(OnsetDetector::LOOK_BACK);
    let mut onsets = OnsetDetector::new(crate::ANALYSIS_RATE_HZ);
    let (mut received, mut older, mut out) = (0, None, Vec::new());
    for &sample in samples {
        resampler.push(sample, |s| {
            recent.push(s);
            received += 1;
            if received % HOP == 0 {
                let now = onsets.hop(&recent);
                match older.take() {
                    None => older = Some(now),
                    Some(before) => out.push(input(&before, &now)),
                }
            }
        });
    }
    out
}
