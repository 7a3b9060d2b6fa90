//! A song with known beats, and what can happen to a song before a robot hears it.

use servodance_audio::Resampler;
use servodance_audio::song::noise;
use servodance_training::song_file::{read_beats, read_sound};
use std::path::Path;

/// The room: its share against the sound itself, and how long it takes to die away by 60 dB.
const WET: f32 = 0.5;
const DIES_AWAY_S: f32 = 0.5;
/// How far pink noise and motors are each below the music.
const NOISE_DB: f32 = 10.0;
/// From a beat to the turn of a robot that dances on it.
const TURN_LATE_S: f64 = 0.1;

/// Mono sound and the beats in it.
#[derive(Clone, Debug)]
pub(super) struct KnownSong {
    pub(super) name: String,
    pub(super) samples: Vec<f32>,
    pub(super) rate_hz: u32,
    /// Times of the beats, seconds.
    pub(super) beats_s: Vec<f64>,
    /// Place of each in its bar from 1; 0 is unknown.
    pub(super) places: Vec<u32>,
}

impl KnownSong {
    /// Reads the sound and NAME.beats beside it.
    pub(super) fn open(path: &Path) -> anyhow::Result<Self> {
        let (beats_s, places) = read_beats(path)?;
        let (samples, rate_hz) = read_sound(path)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { name, samples, rate_hz, beats_s, places })
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.samples.len() as f64 / f64::from(self.rate_hz)
    }

    /// The beats alone.
    pub(super) fn silenced(self) -> Self {
        Self { samples: Vec::new(), ..self }
    }

    /// So many seconds of the song from a time on, as far as there are.
    pub(super) fn part(&self, from_s: f64, length_s: f64) -> Self {
        let at = |time_s: f64| (time_s * f64::from(self.rate_hz)).round() as usize;
        let end = at(from_s + length_s).min(self.samples.len());
        let inside = |time_s: f64| (from_s..from_s + length_s).contains(&time_s);
        let beats = self.beats_s.iter().zip(&self.places);
        let kept = beats.filter(|(time_s, _)| inside(**time_s));
        let (beats_s, places) = kept.map(|(time_s, place)| (time_s - from_s, *place)).unzip();
        let samples = self.samples[at(from_s).min(end)..end].to_vec();
        Self { name: self.name.clone(), samples, rate_hz: self.rate_hz, beats_s, places }
    }

    /// This song and without a pause another one, at this one's sample rate.
    pub(super) fn then(mut self, next: &Self) -> Self {
        let joint_s = self.duration_s();
        let mut resampler = Resampler::new(next.rate_hz, self.rate_hz);
        match next.rate_hz == self.rate_hz {
            true => self.samples.extend_from_slice(&next.samples),
            false => next.samples.iter().for_each(|&sample| {
                resampler.push(sample, |s| self.samples.push(s));
            }),
        }
        self.beats_s.extend(next.beats_s.iter().map(|time_s| joint_s + time_s));
        self.places.extend_from_slice(&next.places);
        self
    }

    /// The song as a robot's own microphone may hear it: in a room, with pink noise and
    /// with motors that turn soon after the beat, each 10 dB below the music.
    pub(super) fn in_noise(mut self, seed: u64) -> Self {
        let (length_s, rate_hz) = (self.duration_s(), self.rate_hz);
        let turns_s: Vec<f64> = self.beats_s.iter().map(|time_s| time_s + TURN_LATE_S).collect();
        let room = noise::room(&self.samples, rate_hz, WET, DIES_AWAY_S, seed);
        let motors = noise::motors(&turns_s, length_s, rate_hz, seed);
        let pink = noise::pink(length_s, rate_hz, seed);
        let level = noise::rms(&room) * 10f32.powf(-NOISE_DB / 20.0);
        let noises = pink.iter().zip(&motors).map(|(pink, motors)| level * (pink + motors));
        self.samples = room.iter().zip(noises).map(|(sound, noise)| sound + noise).collect();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn song(seconds: usize) -> KnownSong {
        KnownSong {
            name: "noise".into(),
            samples: noise::pink(seconds as f64, 8000, 1),
            rate_hz: 8000,
            beats_s: (0..2 * seconds).map(|i| 0.5 * i as f64 + 0.1).collect(),
            places: (0..2 * seconds).map(|i| i as u32 % 4 + 1).collect(),
        }
    }

    #[test]
    fn beats_stay_with_the_sound_through_a_cut_and_a_joint() {
        let both = song(10).part(4.0, 3.0).then(&song(10).part(1.0, 2.0));
        assert_eq!(both.samples.len(), 5 * 8000);
        assert_eq!(both.samples[3 * 8000..], song(10).samples[8000..3 * 8000]);
        let times: Vec<String> = both.beats_s.iter().map(|t| format!("{t:.1}")).collect();
        assert_eq!(times, ["0.1", "0.6", "1.1", "1.6", "2.1", "2.6", "3.1", "3.6", "4.1", "4.6"]);
        assert_eq!(both.places[5..8], [2, 3, 4]);
    }

    #[test]
    fn noise_is_added_at_its_level() {
        let clean = song(4);
        let noisy = clean.clone().in_noise(3);
        assert_eq!(noisy.samples.len(), clean.samples.len());
        let room = noise::room(&clean.samples, 8000, WET, DIES_AWAY_S, 3);
        let added: Vec<f32> = noisy.samples.iter().zip(&room).map(|(n, r)| n - r).collect();
        let below_db = 20.0 * (noise::rms(&room) / noise::rms(&added)).log10();
        // Two noises of the same power: 3 dB more than one.
        assert!((below_db - (NOISE_DB - 3.0)).abs() < 0.5, "{below_db}");
    }
}
