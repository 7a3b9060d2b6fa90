//! Note onsets 80 times a second: the rise of each semitone over 50 ms.
//!
//! A window of 100 ms tells the notes above 200 Hz apart, so that a change of
//! chord is seen where no drum marks the bar; below, semitones share bins. Levels
//! are logarithmic and relative to the running loudest, so that gain does not
//! matter. Causal, no allocation after the start. Timing is
//! [`onset_strength`](super::onset_strength)'s work: this window is twice as long.

use super::filter_bank::FilterBank;
use super::spectrum::{PowerSpectrum, SlidingWindow};

/// Samples of one window: 100 ms.
const WINDOW: usize = 2048;
/// Semitones, from A2 (110 Hz) up four octaves.
pub(crate) const NOTES: usize = 48;
const LOWEST_HZ: f32 = 110.0;
/// Steps between the two spectra that are compared: 50 ms.
const LAG: usize = 4;
const COMPRESSION: f32 = 100.0;

pub(crate) struct NoteOnsets {
    spectrum: PowerSpectrum,
    semitones: FilterBank,
    /// Levels of the last steps, newest first.
    levels: [[f32; NOTES]; LAG + 1],
    reference: f32,
}

impl NoteOnsets {
    pub(crate) const LOOK_BACK: usize = WINDOW;

    pub(crate) fn new(rate_hz: u32) -> Self {
        let bin_hz = rate_hz as f32 / WINDOW as f32;
        let weight = |note: usize, bin: usize| {
            let hz = LOWEST_HZ * (note as f32 / 12.0).exp2();
            // Triangles of a semitone to each side, at least one bin.
            let width = (hz * 0.059_463).max(bin_hz);
            (1.0 - (bin as f32 * bin_hz - hz).abs() / width).max(0.0)
        };
        Self {
            spectrum: PowerSpectrum::new(WINDOW),
            semitones: FilterBank::from_weights(NOTES, WINDOW / 2 + 1, weight),
            levels: [[0.0; NOTES]; LAG + 1],
            reference: 0.0,
        }
    }

    /// The rises at the newest sample of `recent`.
    pub(crate) fn step(&mut self, recent: &SlidingWindow) -> [f32; NOTES] {
        let power = self.spectrum.power(recent.newest(WINDOW));
        self.levels.rotate_right(1);
        let now = &mut self.levels[0];
        self.semitones.apply(power, now);
        let loudest = now.iter().fold(0.0f32, |m, &p| m.max(p)).sqrt();
        // Falls by 2 dB a second.
        self.reference = (self.reference * 0.997_12).max(loudest).max(0.16);
        for level in now.iter_mut() {
            *level = (1.0 + COMPRESSION * level.sqrt() / self.reference).ln();
        }
        let (now, before) = (&self.levels[0], &self.levels[LAG]);
        std::array::from_fn(|note| {
            let low = before[note.saturating_sub(1)];
            let high = before[(note + 1).min(NOTES - 1)];
            (now[note] - before[note].max(low).max(high)).max(0.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::ANALYSIS_RATE_HZ;

    #[test]
    fn a_tone_that_begins_rises_at_its_semitone() {
        let mut recent = SlidingWindow::new(NoteOnsets::LOOK_BACK);
        let mut notes = NoteOnsets::new(ANALYSIS_RATE_HZ);
        let mut loudest = [0.0f32; NOTES];
        for i in 0..20_480 {
            let on = i > 10_240;
            let tone = (std::f64::consts::TAU * 440.0 * f64::from(i) / 20_480.0).sin() as f32;
            recent.push(if on { 0.3 * tone } else { 0.0 });
            if (i + 1) % 256 == 0 {
                let rises = notes.step(&recent);
                loudest.iter_mut().zip(rises).for_each(|(l, r)| *l = l.max(r));
            }
        }
        let best = (0..NOTES).max_by(|&a, &b| loudest[a].total_cmp(&loudest[b]));
        assert_eq!(best, Some(24), "A4 is 24 semitones above A2: {loudest:?}");
    }
}
