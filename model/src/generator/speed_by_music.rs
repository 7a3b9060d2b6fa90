//! Codes that move as fast as the music asks for become likelier: fast ones between beats and in
//! loud music, slow ones on beats and in soft music.
//!
//! A size that follows the loudness within a second ([`super::motion_size`]) moves the beats of
//! the dance and trembles; another choice among the model's own figures does neither. Causal,
//! allocates nothing.

use servodance_types::Beat;

use super::loudness::Loudness;
use super::options::GeneratorOptions;

/// Share of the newest frame in the loudness of now: half a second, for within a beat every drum
/// is louder than what follows.
const LOUDNESS_SHARE: f32 = 0.1;
/// Logits for a loudness of one usual spread above the usual, and a code whose speed is one
/// standard deviation above the mean.
const PER_SPREAD: f32 = 0.5;
/// No music is louder or softer than this, in usual spreads.
const MOST_SPREADS: f32 = 2.0;
/// Frames until the usual loudness is known.
const KNOWN_FRAMES: f32 = 100.0;
/// The motion of a code is seen this much later, for decoder and filter smooth it, seconds.
const LATE_S: f32 = 0.1;
/// A beat that is less sure is a guess.
const LEAST_CONFIDENCE: f32 = 0.5;

/// Follows the beats and the loudness of one song.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedByMusic {
    loudness: Loudness,
    frames: f32,
    /// Logits for one standard deviation of speed.
    wanted: f32,
}

impl Default for SpeedByMusic {
    fn default() -> Self {
        Self { loudness: Loudness::new(LOUDNESS_SHARE), frames: 0.0, wanted: 0.0 }
    }
}

impl SpeedByMusic {
    /// Takes in the beat of a frame and its level, decibels above anything.
    pub fn observe(&mut self, beat: Beat, level_db: f32, options: &GeneratorOptions) {
        self.loudness.push(level_db);
        let known = (self.frames / KNOWN_FRAMES).min(1.0);
        self.frames += 1.0;
        let louder = self.loudness.above_usual().clamp(-MOST_SPREADS, MOST_SPREADS);
        self.wanted = options.beat_emphasis * between_beats(beat)
            + options.dynamics * PER_SPREAD * known * louder;
    }

    /// Adds to the logits of one part, whose codes have these `speeds`, standard scores.
    pub fn favour(&self, speeds: &[f32], logits: &mut [f32]) {
        for (logit, speed) in logits.iter_mut().zip(speeds) {
            *logit += self.wanted * speed;
        }
    }
}

/// -1 where the motion is seen on a beat, 1 halfway between two, 0 where no beat is known.
fn between_beats(beat: Beat) -> f32 {
    let Beat { phase, tempo_bpm, confidence, .. } = beat;
    let seen = phase + LATE_S * tempo_bpm / 60.0;
    let between = -confidence * (std::f32::consts::TAU * seen).cos();
    if confidence >= LEAST_CONFIDENCE && between.is_finite() { between } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is added to the logit of a code of mean speed and one standard deviation above it.
    fn favoured(beat: Beat, levels_db: &[f32], options: &GeneratorOptions) -> [f32; 2] {
        let mut speed = SpeedByMusic::default();
        let mut logits = [0.0; 2];
        for level_db in levels_db {
            speed.observe(beat, *level_db, options);
        }
        speed.favour(&[0.0, 1.0], &mut logits);
        logits
    }

    fn beat(phase: f32, confidence: f32) -> Beat {
        Beat { phase, confidence, tempo_bpm: 120.0, ..Beat::default() }
    }

    #[test]
    fn fast_codes_are_likelier_between_beats_and_less_likely_on_them() {
        // Two frames of 50 ms are a fifth of a beat.
        let at = |phase| favoured(beat(phase, 1.0), &[-20.0; 200], &GeneratorOptions::default());
        let [on_beat, between] = [at(0.8), at(0.3)];
        assert!(on_beat[1] < -0.5 && between[1] > 0.5, "{on_beat:?} {between:?}");
        assert_eq!([on_beat[0], between[0]], [0.0, 0.0]);
    }

    #[test]
    fn fast_codes_are_likelier_in_loud_music_and_less_likely_in_soft() {
        let unsure = beat(0.3, 0.1);
        let after = |level_db| {
            let levels = [vec![-20.0; 300], vec![level_db; 20]].concat();
            favoured(unsure, &levels, &GeneratorOptions::default())[1]
        };
        assert_eq!(after(-20.0), 0.0);
        assert!(after(-10.0) > 0.3 && after(-30.0) < -0.3, "{} {}", after(-10.0), after(-30.0));
    }

    #[test]
    fn strength_zero_and_a_beat_that_is_no_number_change_nothing() {
        let none =
            GeneratorOptions { dynamics: 0.0, beat_emphasis: 0.0, ..GeneratorOptions::default() };
        assert_eq!(favoured(beat(0.3, 1.0), &[-20.0, 0.0, -60.0], &none), [0.0; 2]);
        let broken = favoured(beat(f32::NAN, f32::NAN), &[-20.0; 3], &GeneratorOptions::default());
        assert_eq!(broken, [0.0; 2]);
    }
}
