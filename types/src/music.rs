//! What the generator hears of the music, 20 times a second.

use std::f32::consts::TAU;

/// The AIST++ feature vector: onset envelope 1, MFCC 20, chroma CENS 12,
/// onset peak 1, beat 1.
pub const SPECTRAL_DIM: usize = 35;

/// The width of [`MusicFrame::vector`]: the 35 features and the beat as
/// `sin`, `cos`, tempo and confidence.
pub const MUSIC_DIM: usize = SPECTRAL_DIM + 4;

/// Whether a beat tracker has the beat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BeatLock {
    /// No beat: silence, noise, or music not yet understood.
    #[default]
    Lost,
    /// The beat is followed.
    Locked,
    /// The music became unclear (a break): the last beat goes on.
    Holding,
}

/// The state of the beat as a causal tracker knows it at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beat {
    /// Position between two beats, 0 (on the beat) up to 1 (the next beat).
    pub phase: f32,
    /// Tempo in beats a minute; 0 while unknown.
    pub tempo_bpm: f32,
    /// How sure the tracker is, 0 to 1. Below a half the phase is a guess.
    pub confidence: f32,
    /// Whether the beat is had, with hysteresis: steadier than `confidence`.
    pub lock: BeatLock,
    /// Which beat of a bar of four the last beat was, 0 being the downbeat: a
    /// guess, `None` while there is none.
    pub beat_in_bar: Option<u8>,
}

/// Music features at one motion frame: everything heard up to `time_s`, and
/// nothing after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MusicFrame {
    /// Seconds since the music began.
    pub time_s: f64,
    /// The 35 features of AIST++, computed causally.
    pub spectral: [f32; SPECTRAL_DIM],
    /// The tracked beat.
    pub beat: Beat,
    /// Whether this is music at all, as against silence, speech or noise:
    /// 0 surely not, 1 surely. Steady over seconds.
    pub presence: f32,
}

/// Silence at the beginning of time.
impl Default for MusicFrame {
    fn default() -> Self {
        Self {
            time_s: 0.0,
            spectral: [0.0; SPECTRAL_DIM],
            beat: Beat::default(),
            presence: 0.0,
        }
    }
}

impl MusicFrame {
    /// What the generator is conditioned on: the 35 features, then the sine
    /// and cosine of the beat phase (both scaled by the confidence), the tempo
    /// as octaves from 120 BPM (0 while unknown), and the confidence.
    pub fn vector(&self) -> [f32; MUSIC_DIM] {
        let mut out = [0.0; MUSIC_DIM];
        out[..SPECTRAL_DIM].copy_from_slice(&self.spectral);
        let Beat {
            phase,
            tempo_bpm,
            confidence,
            ..
        } = self.beat;
        out[SPECTRAL_DIM] = (TAU * phase).sin() * confidence;
        out[SPECTRAL_DIM + 1] = (TAU * phase).cos() * confidence;
        out[SPECTRAL_DIM + 2] = if tempo_bpm > 0.0 {
            (tempo_bpm / 120.0).log2()
        } else {
            0.0
        };
        out[SPECTRAL_DIM + 3] = confidence;
        out
    }

    /// The frame that has this [`MusicFrame::vector`]; what the vector does not
    /// hold is as in [`Beat::default`]. Without confidence there is no beat.
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
            beat: Beat {
                phase: 0.25,
                tempo_bpm: 60.0,
                confidence: 1.0,
                ..Beat::default()
            },
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
