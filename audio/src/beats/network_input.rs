//! The input of the beat network: two hops of band rises, and the band levels.

use crate::features::ANALYSIS_RATE_HZ;
use crate::features::onset_strength::{BANDS, HOP, Onset, OnsetDetector};
use crate::features::resampler::Resampler;
use crate::features::spectrum::SlidingWindow;

/// Values that one step of the network reads.
pub const INPUTS: usize = 2 * BANDS + BANDS / 2;

/// The input of one step: the older hop's rises, the newer hop's, the levels.
pub(crate) fn input(older: &Onset, newer: &Onset) -> [f32; INPUTS] {
    let mut out = [0.0; INPUTS];
    out[..BANDS].copy_from_slice(&older.rises);
    out[BANDS..2 * BANDS].copy_from_slice(&newer.rises);
    out[2 * BANDS..].copy_from_slice(&newer.levels);
    out
}

/// All inputs of a piece, 80 a second, for training the network. Step `k` depends
/// on the samples before `(k + 1) / 80` seconds, less the resampler's delay.
pub fn inputs_of(samples: &[f32], rate_hz: u32) -> Vec<[f32; INPUTS]> {
    let mut resampler = Resampler::new(rate_hz, ANALYSIS_RATE_HZ);
    let mut recent = SlidingWindow::new(OnsetDetector::LOOK_BACK);
    let mut onsets = OnsetDetector::new(ANALYSIS_RATE_HZ);
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
