//! Sounds that are not music, and rooms that music is heard in, rendered by code: for
//! tests and for training.
//!
//! All noises are mono samples with a mean square of one, so that [`mix`] can bring
//! them to any level; the same seed gives the same samples. Not for the audio
//! thread: whole sounds are allocated.

use rand::distr::uniform::{SampleRange, SampleUniform};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::{PI, TAU};

/// `sound` with `noise` added, the power of `sound` being `snr_db` above that of
/// `noise`. The shorter one decides the length.
pub fn mix(sound: &[f32], noise: &[f32], snr_db: f32) -> Vec<f32> {
    let gain = rms(sound) / rms(noise).max(1e-9) * 10f32.powf(-snr_db / 20.0);
    sound.iter().zip(noise).map(|(s, n)| s + gain * n).collect()
}

/// The root mean square of samples.
pub fn rms(samples: &[f32]) -> f32 {
    (samples.iter().map(|s| s * s).sum::<f32>() / samples.len().max(1) as f32).sqrt()
}

/// Noise with attenuated treble: `colour` 0 is white, 1 nearly brown.
pub fn hiss(duration_s: f64, rate_hz: u32, colour: f32, seed: u64) -> Vec<f32> {
    let mut sound = Sound::silent(duration_s, rate_hz, seed);
    let pole = 1.0 - 0.99 * colour.clamp(0.0, 1.0);
    let mut low = 0.0;
    for sample in &mut sound.samples {
        low += pole * (sound.rng.random_range(-1.0..1.0) - low);
        *sample = low;
    }
    sound.levelled()
}

/// Noise that loses 3 dB an octave: the sum of random values held for 1, 2, 4, ... samples
/// (Voss 1978).
pub fn pink(duration_s: f64, rate_hz: u32, seed: u64) -> Vec<f32> {
    const OCTAVES: usize = 14;
    let mut sound = Sound::silent(duration_s, rate_hz, seed);
    let mut held = [0.0f32; OCTAVES];
    for (i, sample) in sound.samples.iter_mut().enumerate() {
        let octave = (i.trailing_zeros() as usize).min(OCTAVES - 1);
        held[octave] = sound.rng.random_range(-1.0..1.0);
        *sample = held.iter().sum();
    }
    sound.levelled()
}

/// `sound` in a room of eight combs (Schroeder 1962): `wet` of it against the sound
/// itself, dying away by 60 dB in `time_s`.
pub fn room(sound: &[f32], rate_hz: u32, wet: f32, time_s: f32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut heard = sound.to_vec();
    let damping = rng.random_range(0.2..0.8);
    for _ in 0..8 {
        let delay_s = rng.random_range(0.021f32..0.061);
        let feedback = 10f32.powf(-3.0 * delay_s / time_s);
        let mut line = vec![0.0f32; (delay_s * rate_hz as f32) as usize];
        let (delay, mut damped) = (line.len(), 0.0f32);
        for (i, (out, input)) in heard.iter_mut().zip(sound).enumerate() {
            let old = line[i % delay];
            damped += damping * (old - damped);
            line[i % delay] = input + feedback * damped;
            *out += 0.3 * wet * old;
        }
    }
    heard
}

/// Knocks at random times, `per_s` a second on average.
pub fn knocks(duration_s: f64, rate_hz: u32, per_s: f64, seed: u64) -> Vec<f32> {
    let mut sound = Sound::silent(duration_s, rate_hz, seed);
    let mut at_s = 0.0;
    while at_s < duration_s {
        let (tone_hz, decay_s) = (sound.draw(100.0..2000.0), sound.draw(0.003..0.05));
        sound.strike(at_s, tone_hz, decay_s, 0.7);
        at_s += -sound.draw(1e-3f64..1.0).ln() / per_s;
    }
    sound.levelled()
}

/// The motors of a robot that reverses its motion at `turns_s` (seconds): servos
/// that whine with their speed, gears that clatter at each turn.
pub fn motors(turns_s: &[f64], duration_s: f64, rate_hz: u32, seed: u64) -> Vec<f32> {
    let mut sound = Sound::silent(duration_s, rate_hz, seed);
    for _ in 0..6 {
        let (low_hz, per_speed_hz) = (sound.draw(80.0..300.0), sound.draw(200.0..900.0));
        let late_s = sound.draw(0.0..0.03);
        let gain = sound.draw(0.3..1.0);
        let mut turns = 0.0f32;
        let mut hum = 0.0f32;
        for (i, sample) in sound.samples.iter_mut().enumerate() {
            let speed = speed_between(turns_s, i as f64 / f64::from(rate_hz) - late_s);
            turns = (turns + (low_hz + per_speed_hz * speed) / rate_hz as f32).fract();
            let whine = (TAU * turns).sin()
                + 0.5 * (2.0 * TAU * turns).sin()
                + 0.4 * (5.0 * TAU * turns).sin();
            hum += 0.3 * (sound.rng.random_range(-1.0..1.0) - hum);
            *sample += gain * speed * (whine + 0.7 * hum);
        }
        for &turn_s in turns_s {
            let loud = sound.draw(0.3..1.5) * gain;
            for _ in 0..sound.draw(1..4) {
                let at_s = turn_s + late_s + sound.draw(0.0..0.02);
                let tone_hz = sound.draw(900.0..4000.0);
                sound.strike(at_s, tone_hz, 0.004, loud);
            }
        }
    }
    sound.levelled()
}

/// Speed, 0 to 1, of a motion that stands still at each turn.
fn speed_between(turns_s: &[f64], time_s: f64) -> f32 {
    let next = turns_s.partition_point(|&turn| turn <= time_s);
    if next == 0 || next == turns_s.len() {
        return 0.0;
    }
    let (a, b) = (turns_s[next - 1], turns_s[next]);
    (std::f64::consts::PI * (time_s - a) / (b - a)).sin() as f32
}

/// A talker without words: syllables of buzz through moving formants, hissed
/// consonants, pauses between sentences.
pub fn speech(duration_s: f64, rate_hz: u32, seed: u64) -> Vec<f32> {
    let mut talker = Talker::new(Sound::silent(duration_s, rate_hz, seed));
    let voice_hz = talker.sound.draw(90.0..230.0);
    let pace = talker.sound.draw(0.8..1.4);
    let mut left = 0;
    let mut pitch = 1.0f32;
    while talker.at < talker.sound.samples.len() {
        if left == 0 {
            left = talker.sound.draw(4..22);
            pitch = talker.sound.draw(1.0..1.3);
            talker.pause(0.15..0.9);
        }
        left -= 1;
        if talker.sound.rng.random_bool(0.7) {
            let seconds = talker.sound.draw(0.02..0.11) * pace;
            talker.consonant(seconds);
        }
        let glide = talker.sound.draw(0.85..1.12);
        let hz = voice_hz * pitch * talker.sound.draw(0.9..1.1);
        let seconds = talker.sound.draw(0.06..0.24) * pace;
        talker.vowel(seconds, hz, glide);
        pitch = (pitch * 0.97).max(0.75);
        if talker.sound.rng.random_bool(0.25) {
            talker.pause(0.02..0.12);
        }
    }
    talker.sound.levelled()
}

/// A room full of people: ten talkers, and a clap twice a second on average.
pub fn crowd(duration_s: f64, rate_hz: u32, seed: u64) -> Vec<f32> {
    let mut sound = Sound::silent(duration_s, rate_hz, seed);
    sound.samples = hiss(duration_s, rate_hz, 0.8, seed ^ 0xc0);
    sound.samples.iter_mut().for_each(|s| *s *= 0.5);
    for talker in 0..10 {
        let far = sound.draw(0.2..1.0);
        let seed = seed.wrapping_mul(31).wrapping_add(talker);
        let voice = speech(duration_s, rate_hz, seed);
        let samples = sound.samples.iter_mut().zip(&voice);
        samples.for_each(|(o, v)| *o += far * v);
    }
    for _ in 0..(duration_s * 2.0) as usize {
        let at_s = sound.draw(0.0..duration_s);
        let loud = sound.draw(0.3..4.0);
        let tone_hz = sound.draw(700.0..1800.0);
        sound.strike(at_s, tone_hz, 0.012, loud);
    }
    sound.levelled()
}

struct Sound {
    rng: ChaCha8Rng,
    rate_hz: f32,
    samples: Vec<f32>,
}

impl Sound {
    fn silent(duration_s: f64, rate_hz: u32, seed: u64) -> Self {
        let length = (duration_s.max(0.0) * f64::from(rate_hz)).round() as usize;
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            rate_hz: rate_hz as f32,
            samples: vec![0.0; length],
        }
    }

    fn draw<T: SampleUniform>(&mut self, range: impl SampleRange<T>) -> T {
        self.rng.random_range(range)
    }

    /// Adds a knock: a decaying tone with noise.
    fn strike(&mut self, at_s: f64, tone_hz: f32, decay_s: f32, gain: f32) {
        let start = (at_s.max(0.0) * f64::from(self.rate_hz)) as usize;
        let count = (6.0 * decay_s * self.rate_hz) as usize;
        for (age, sample) in self.samples.iter_mut().skip(start).take(count).enumerate() {
            let age_s = age as f32 / self.rate_hz;
            let noise = self.rng.random_range(-1.0f32..1.0);
            let sound = 0.5 * (TAU * tone_hz * age_s).sin() + 0.5 * noise;
            *sample += gain * sound * (-age_s / decay_s).exp();
        }
    }

    fn levelled(mut self) -> Vec<f32> {
        let scale = 1.0 / rms(&self.samples).max(1e-9);
        self.samples.iter_mut().for_each(|s| *s *= scale);
        self.samples
    }
}

struct Talker {
    sound: Sound,
    at: usize,
    formants_hz: [f32; 3],
    state: [[f32; 2]; 3],
    turn: f32,
}

impl Talker {
    fn new(sound: Sound) -> Self {
        Self { sound, at: 0, formants_hz: [500.0, 1500.0, 2500.0], state: [[0.0; 2]; 3], turn: 0.0 }
    }

    fn pause(&mut self, seconds: std::ops::Range<f32>) {
        self.at += (self.sound.draw(seconds) * self.sound.rate_hz) as usize;
    }

    /// The samples of the next `count`, as far as the sound lasts.
    fn span(&self, count: usize) -> std::ops::Range<usize> {
        self.at..self.at + count.min(self.sound.samples.len().saturating_sub(self.at))
    }

    fn vowel(&mut self, seconds: f32, hz: f32, glide: f32) {
        let rate_hz = self.sound.rate_hz;
        let ranges = [280.0..850.0, 850.0..2300.0, 2300.0..3200.0];
        let goal: [f32; 3] = ranges.map(|range| self.sound.draw(range));
        let count = (seconds * rate_hz) as usize;
        let loud = self.sound.draw(0.5..1.2);
        for (i, at) in self.span(count).enumerate() {
            let part = i as f32 / count as f32;
            let edge = (12.0 * part).min(6.0 * (1.0 - part)).min(1.0);
            self.turn += hz * glide.powf(part) / rate_hz;
            let pulse = if self.turn >= 1.0 { 1.0 } else { 0.0 };
            self.turn = self.turn.fract();
            for (f, g) in self.formants_hz.iter_mut().zip(goal) {
                *f += (g - *f) * 40.0 / rate_hz;
            }
            let breath = 0.02 * self.sound.draw(-1.0..1.0);
            self.sound.samples[at] += loud * edge * self.resonate(pulse + breath);
        }
        self.at += count;
    }

    fn consonant(&mut self, seconds: f32) {
        let count = (seconds * self.sound.rate_hz) as usize;
        let bright = self.sound.draw(0.2..1.0);
        let loud = self.sound.draw(0.02..0.25);
        let stop = self.sound.rng.random_bool(0.4);
        let mut before = 0.0;
        for (i, at) in self.span(count).enumerate() {
            let part = i as f32 / count as f32;
            // A stop is silent at first, then bursts.
            let edge =
                if stop { f32::from(u8::from(part > 0.7)) * 1.5 } else { (8.0 * part).min(1.0) };
            let now: f32 = self.sound.draw(-1.0..1.0);
            self.sound.samples[at] += loud * edge * (now - bright * before);
            before = now;
        }
        self.at += count;
    }

    fn resonate(&mut self, input: f32) -> f32 {
        let rate_hz = self.sound.rate_hz;
        let radius = (-PI * 90.0 / rate_hz).exp();
        let formants = self.formants_hz.iter().zip(&mut self.state);
        let mut sum = 0.0;
        for ((hz, state), gain) in formants.zip([1.0, 0.6, 0.3]) {
            let now = input + 2.0 * radius * (TAU * hz / rate_hz).cos() * state[0]
                - radius * radius * state[1];
            *state = [now, state[0]];
            sum += gain * now * (1.0 - radius);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_added_at_the_ratio_asked_for() {
        let (tone, noise) = (hiss(1.0, 8000, 0.0, 1), hiss(1.0, 8000, 0.5, 2));
        let loud: Vec<f32> = tone.iter().map(|s| 0.1 * s).collect();
        let both = mix(&loud, &noise, 10.0);
        let added: Vec<f32> = both.iter().zip(&loud).map(|(b, s)| b - s).collect();
        assert!((20.0 * (rms(&loud) / rms(&added)).log10() - 10.0).abs() < 0.01);
    }

    #[test]
    fn every_noise_sounds_and_is_reproducible() {
        let turns: Vec<f64> = (0..20).map(|i| 0.1 * f64::from(i)).collect();
        let all = |seed| {
            [
                hiss(2.0, 16_000, 0.5, seed),
                pink(2.0, 16_000, seed),
                knocks(2.0, 16_000, 5.0, seed),
                motors(&turns, 2.0, 16_000, seed),
                speech(2.0, 16_000, seed),
                crowd(2.0, 16_000, seed),
            ]
        };
        for sound in all(3) {
            assert!((rms(&sound) - 1.0).abs() < 1e-3 && sound.len() == 32_000);
        }
        assert_eq!(all(5), all(5));
        assert_ne!(all(5), all(6));
    }
}
