//! Music features and beat, 20 times a second: the input of the motion generator.

use std::f32::consts::TAU;

/// The AIST++ feature vector: onset envelope 1, MFCC 20, chroma CENS 12,
/// onset peak 1, beat 1.
pub const SPECTRAL_DIM: usize = 35;

/// The width of [`MusicFrame::vector`]: the 35 features and the beat as
/// `sin`, `cos`, tempo and confidence.
pub const MUSIC_DIM: usize = SPECTRAL_DIM + 4;

/// Lock state of the beat tracker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BeatLock {
    /// No beat: silence, noise, or music whose beat is not found yet.
    #[default]
    Lost,
    /// The tracker follows the beat.
    Locked,
    /// The music became unclear (a break); the last beat is extrapolated.
    Holding,
    /// The tracker follows the beat and hears another, which it follows if that lasts.
    Changing,
}

/// The beat at one moment, estimated from the past alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beat {
    /// Position between two beats, 0 (on the beat) up to 1 (the next beat).
    pub phase: f32,
    /// Tempo in beats a minute; 0 while unknown.
    pub tempo_bpm: f32,
    /// Confidence of the tracker, 0 to 1. Below 0.5 the phase is a guess.
    pub confidence: f32,
    /// Lock state; has hysteresis and changes more slowly than `confidence`.
    pub lock: BeatLock,
    /// Index of the last beat in its bar, 0 being the downbeat; `None` while no
    /// downbeat stands out.
    pub beat_in_bar: Option<u8>,
    /// Beats in a bar; `None` while no downbeat stands out.
    pub beats_in_bar: Option<u8>,
    /// Probability of that place in that bar, 0 to 1.
    pub bar_confidence: f32,
}

/// Music features at one motion frame, computed from the samples before `time_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MusicFrame {
    /// Time since the music began, seconds.
    pub time_s: f64,
    /// The 35 features of AIST++, computed causally.
    pub spectral: [f32; SPECTRAL_DIM],
    /// The tracked beat, extrapolated to `time_s`.
    pub beat: Beat,
    /// Probability of music (not silence, speech or noise), 0 to 1, averaged over seconds.
    pub presence: f32,
}

impl Default for MusicFrame {
    fn default() -> Self {
        Self { time_s: 0.0, spectral: [0.0; SPECTRAL_DIM], beat: Beat::default(), presence: 0.0 }
    }
}

impl MusicFrame {
    /// The generator's conditioning vector: the 35 features, then the sine and
    /// cosine of the beat phase (both scaled by the confidence), the tempo as
    /// octaves from 120 BPM (0 while unknown), and the confidence.
    pub fn vector(&self) -> [f32; MUSIC_DIM] {
        let mut out = [0.0; MUSIC_DIM];
        let (spectral, beat_values) = out.split_at_mut(SPECTRAL_DIM);
        spectral.copy_from_slice(&self.spectral);
        let beat = self.beat;
        let (sine, cosine) = ((TAU * beat.phase).sin(), (TAU * beat.phase).cos());
        let known = beat.tempo_bpm > 0.0;
        let octaves = if known { (beat.tempo_bpm / 120.0).log2() } else { 0.0 };
        let confidence = beat.confidence;
        beat_values.copy_from_slice(&[sine * confidence, cosine * confidence, octaves, confidence]);
        out
    }

    /// The inverse of [`MusicFrame::vector`]; fields that the vector lacks are as
    /// in [`Beat::default`]. Without confidence there is no beat.
    pub fn from_vector(vector: &[f32; MUSIC_DIM], time_s: f64) -> Self {
        let [sine, cosine, octaves, confidence] = std::array::from_fn(|i| vector[SPECTRAL_DIM + i]);
        let heard = confidence > 0.0;
        Self {
            time_s,
            spectral: std::array::from_fn(|i| vector[i]),
            beat: Beat {
                phase: (sine.atan2(cosine) / TAU).rem_euclid(1.0),
                tempo_bpm: if heard { 120.0 * octaves.exp2() } else { 0.0 },
                confidence,
                ..Beat::default()
            },
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vector_carries_the_beat_phase() {
        let frame = MusicFrame {
            spectral: [0.5; SPECTRAL_DIM],
            beat: Beat { phase: 0.25, tempo_bpm: 60.0, confidence: 1.0, ..Beat::default() },
            ..MusicFrame::default()
        };
        let v = frame.vector();
        assert_eq!(v[34], 0.5);
        assert!((v[35] - 1.0).abs() < 1e-6 && v[36].abs() < 1e-6);
        assert_eq!((v[37], v[38]), (-1.0, 1.0));
        let back = MusicFrame::from_vector(&v, 0.0);
        assert!((back.beat.phase - 0.25).abs() < 1e-6);
        assert_eq!((back.beat.tempo_bpm, back.spectral[3]), (60.0, 0.5));
    }
}
