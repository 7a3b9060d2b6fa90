//! What is danced to in a soak: recordings if there are any, else music, breaks,
//! noise and silence, made here. Each piece is as long as the others, so that
//! memory can be compared.

use anyhow::Context;
use servodance_audio::AudioSource;
use servodance_audio::song::noise;
use servodance_audio::song::{DEFAULT_RATE_HZ, Song, SongSpec};
use std::path::PathBuf;

/// Loudness of what is no music (root mean square of full scale).
const NOISE_RMS: f32 = 0.1;
const ABOVE_CROWD_DB: f32 = 6.0;

/// Names of the kinds of pieces that are made here, in their order.
pub const KINDS: [&str; 7] = [
    "song",
    "song with a break",
    "song in a crowd",
    "silence",
    "another song",
    "hiss and knocks",
    "speech",
];

/// Pieces one after another.
#[derive(Clone, Debug)]
pub struct SoakMusic {
    files: Vec<PathBuf>,
    piece_s: f64,
    seed: u64,
}

impl SoakMusic {
    /// From these recordings, or made here if there are none.
    pub fn new(files: Vec<PathBuf>, piece_s: f64, seed: u64) -> Self {
        Self { files, piece_s, seed }
    }

    /// The piece of a round.
    /// Fails for: a recording that cannot be read.
    pub fn piece(&self, round: usize) -> anyhow::Result<Song> {
        match self.files.is_empty() {
            true => self.made(round),
            false => self.read(&self.files[round % self.files.len()]),
        }
    }

    fn made(&self, round: usize) -> anyhow::Result<Song> {
        let seed = self.seed.wrapping_add(round as u64);
        let mut song = SongSpec::random(self.piece_s, seed)?.render()?;
        let third = song.samples.len() / 3;
        let noisy = |sound: Vec<f32>| sound.into_iter().map(|s| s * NOISE_RMS).collect();
        match round % KINDS.len() {
            1 => song.samples[third..2 * third].fill(0.0),
            2 => {
                let crowd = noise::crowd(self.piece_s, DEFAULT_RATE_HZ, seed);
                song.samples = noise::mix(&song.samples, &crowd, ABOVE_CROWD_DB);
            }
            3 => song.samples.fill(0.0),
            5 => {
                let knocks = noise::knocks(self.piece_s, DEFAULT_RATE_HZ, 4.0, seed);
                let hiss = noise::hiss(self.piece_s, DEFAULT_RATE_HZ, 0.3, seed);
                song.samples = noisy(noise::mix(&knocks, &hiss, 10.0));
            }
            6 => song.samples = noisy(noise::speech(self.piece_s, DEFAULT_RATE_HZ, seed)),
            _ => {}
        }
        Ok(song)
    }

    fn read(&self, file: &PathBuf) -> anyhow::Result<Song> {
        let unreadable = || format!("cannot listen to {}", file.display());
        let mut source = AudioSource::open(file).with_context(unreadable)?;
        let sample_rate_hz = source.sample_rate_hz();
        let wanted = (self.piece_s * f64::from(sample_rate_hz)) as usize;
        let (mut samples, mut block) = (Vec::with_capacity(wanted), Vec::new());
        while samples.len() < wanted && source.next_block(&mut block).with_context(unreadable)? {
            samples.extend_from_slice(&block);
        }
        samples.truncate(wanted);
        Ok(Song { sample_rate_hz, samples, beats_s: Vec::new(), downbeats: Vec::new() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_as_long_as_each_other_and_of_every_kind() {
        let music = SoakMusic::new(Vec::new(), 3.0, 7);
        let pieces: Vec<Song> = (0..KINDS.len()).map(|i| music.piece(i).unwrap()).collect();
        let loudness = |song: &Song| noise::rms(&song.samples);
        for (kind, piece) in KINDS.iter().zip(&pieces) {
            assert!((piece.duration_s() - 3.0).abs() < 0.01, "{kind}");
            assert_eq!(loudness(piece) == 0.0, *kind == "silence", "{kind}");
            assert!(piece.samples.iter().all(|s| s.is_finite()), "{kind}");
        }
        assert_ne!(pieces[0].samples, pieces[4].samples);
        assert_eq!(music.piece(0).unwrap(), pieces[0], "the seed repeats it");
    }
}
