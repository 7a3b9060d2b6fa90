//! The input of the beat network: two hops of band rises, the band levels, and
//! the rises of semitones.

use crate::features::ANALYSIS_RATE_HZ;
use crate::features::note_onset::{NOTES, NoteOnsets};
use crate::features::onset_strength::{BANDS, HOP, Onset, OnsetDetector};
use crate::features::resampler::Resampler;
use crate::features::spectrum::SlidingWindow;

/// Values that one step of the network reads.
pub const INPUTS: usize = 2 * BANDS + BANDS / 2 + NOTES;

/// The input of one step: the older hop's rises, the newer hop's, the levels, the notes.
pub(crate) fn input(older: &Onset, newer: &Onset, notes: &[f32; NOTES]) -> [f32; INPUTS] {
    let mut out = [0.0; INPUTS];
    let parts = [&older.rises[..], &newer.rises, &newer.levels, notes];
    let mut at = 0;
    for part in parts {
        out[at..at + part.len()].copy_from_slice(part);
        at += part.len();
    }
    out
}

/// All inputs of a piece, 80 a second, for training the network. Step `k` depends
/// on the samples before `(k + 1) / 80` seconds, less the resampler's delay.
pub fn inputs_of(samples: &[f32], rate_hz: u32) -> Vec<[f32; INPUTS]> {
    let mut resampler = Resampler::new(rate_hz, ANALYSIS_RATE_HZ);
    let mut recent = SlidingWindow::new(OnsetDetector::LOOK_BACK.max(NoteOnsets::LOOK_BACK));
    let mut onsets = OnsetDetector::new(ANALYSIS_RATE_HZ);
    let mut notes = NoteOnsets::new(ANALYSIS_RATE_HZ);
    let (mut received, mut older, mut out) = (0, None, Vec::new());
    for &sample in samples {
        resampler.push(sample, |s| {
            recent.push(s);
            received += 1;
            if received % HOP == 0 {
                let now = onsets.hop(&recent);
                match older.take() {
                    None => older = Some(now),
                    Some(before) => out.push(input(&before, &now, &notes.step(&recent))),
                }
            }
        });
    }
    out
}
