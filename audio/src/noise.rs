//! Sounds that are not music, rendered by code: for tests and for training.
//!
//! All are mono samples of a mean square of one, so that [`mix`] can bring
//! them to any level; the same seed gives the same samples. Not for the audio
//! thread: whole sounds are allocated.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::TAU;

/// `sound` with `noise` added, the sound's power being `snr_db` above the
/// noise's. The shorter one decides the length.
pub fn mix(sound: &[f32], noise: &[f32], snr_db: f32) -> Vec<f32> {
    let gain = rms(sound) / rms(noise).max(1e-9) * 10f32.powf(-snr_db / 20.0);
    sound.iter().zip(noise).map(|(s, n)| s + gain * n).collect()
}

/// The root mean square of samples.
pub fn rms(samples: &[f32]) -> f32 {
    (samples.iter().map(|s| s * s).sum::<f32>() / samples.len().max(1) as f32).sqrt()
}

/// Noise with its treble cut: `colour` 0 is white, 1 nearly brown.
pub fn hiss(duration_s: f64, rate_hz: u32, colour: f32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let pole = 1.0 - 0.99 * colour.clamp(0.0, 1.0);
    let mut low = 0.0;
    levelled((0..length(duration_s, rate_hz)).map(|_| {
        low += pole * (rng.random_range(-1.0..1.0) - low);
        low
    }))
}

/// Knocks at random times, `per_s` a second on average.
pub fn knocks(duration_s: f64, rate_hz: u32, per_s: f64, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = vec![0.0; length(duration_s, rate_hz)];
    let mut at_s = 0.0;
    while at_s < duration_s {
        let tone_hz = rng.random_range(100.0..2000.0);
        let decay_s = rng.random_range(0.003..0.05);
        strike(&mut out, rate_hz, at_s, tone_hz, decay_s, 0.7, &mut rng);
        at_s += -rng.random_range(1e-3f64..1.0).ln() / per_s;
    }
    levelled(out)
}

/// The motors of a robot that turns round at `turns_s` (seconds): servos that
/// whine with their speed, gears that clatter where the motion turns.
pub fn motors(turns_s: &[f64], duration_s: f64, rate_hz: u32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = vec![0.0f32; length(duration_s, rate_hz)];
    for _ in 0..6 {
        let (low_hz, per_speed_hz) = (
            rng.random_range(80.0..300.0),
            rng.random_range(200.0..900.0),
        );
        let late_s = rng.random_range(0.0..0.03);
        let gain = rng.random_range(0.3..1.0);
        let mut turns = 0.0f32;
        let mut hum = 0.0f32;
        for (i, sample) in out.iter_mut().enumerate() {
            let speed = speed_between(turns_s, i as f64 / f64::from(rate_hz) - late_s);
            turns = (turns + (low_hz + per_speed_hz * speed) / rate_hz as f32).fract();
            let whine = (TAU * turns).sin()
                + 0.5 * (2.0 * TAU * turns).sin()
                + 0.4 * (5.0 * TAU * turns).sin();
            hum += 0.3 * (rng.random_range(-1.0..1.0) - hum);
            *sample += gain * speed * (whine + 0.7 * hum);
        }
        for &turn_s in turns_s {
            let loud = rng.random_range(0.3..1.5) * gain;
            for _ in 0..rng.random_range(1..4) {
                let at_s = turn_s + late_s + rng.random_range(0.0..0.02);
                let tone_hz = rng.random_range(900.0..4000.0);
                strike(&mut out, rate_hz, at_s, tone_hz, 0.004, loud, &mut rng);
            }
        }
    }
    levelled(out)
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

/// One who talks: syllables of buzz through moving formants, hissed
/// consonants, pauses between sentences. No words.
pub fn speech(duration_s: f64, rate_hz: u32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = vec![0.0; length(duration_s, rate_hz)];
    let voice_hz = rng.random_range(90.0..230.0);
    let pace = rng.random_range(0.8..1.4);
    let mut talker = Talker::new(rate_hz);
    let mut at = 0;
    let mut left = 0;
    let mut pitch = 1.0f32;
    while at < out.len() {
        if left == 0 {
            left = rng.random_range(4..22);
            pitch = rng.random_range(1.0..1.3);
            at += (rng.random_range(0.15..0.9) * rate_hz as f32) as usize;
        }
        left -= 1;
        if rng.random_bool(0.7) {
            at = talker.consonant(&mut out, at, rng.random_range(0.02..0.11) * pace, &mut rng);
        }
        let glide = rng.random_range(0.85..1.12);
        let hz = voice_hz * pitch * rng.random_range(0.9..1.1);
        at = talker.vowel(
            &mut out,
            at,
            rng.random_range(0.06..0.24) * pace,
            hz,
            glide,
            &mut rng,
        );
        pitch = (pitch * 0.97).max(0.75);
        if rng.random_bool(0.25) {
            at += (rng.random_range(0.02..0.12) * rate_hz as f32) as usize;
        }
    }
    levelled(out)
}

/// A room full of people: many talkers, somebody claps or calls now and then.
pub fn crowd(duration_s: f64, rate_hz: u32, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = hiss(duration_s, rate_hz, 0.8, seed ^ 0xc0);
    out.iter_mut().for_each(|s| *s *= 0.5);
    for talker in 0..10 {
        let far = rng.random_range(0.2..1.0);
        let voice = speech(
            duration_s,
            rate_hz,
            seed.wrapping_mul(31).wrapping_add(talker),
        );
        out.iter_mut().zip(&voice).for_each(|(o, v)| *o += far * v);
    }
    let claps = (duration_s * 2.0) as usize;
    for _ in 0..claps {
        let at_s = rng.random_range(0.0..duration_s);
        let loud = rng.random_range(0.3..4.0);
        strike(
            &mut out,
            rate_hz,
            at_s,
            rng.random_range(700.0..1800.0),
            0.012,
            loud,
            &mut rng,
        );
    }
    levelled(out)
}

/// Two formants and a glottis.
struct Talker {
    rate_hz: f32,
    formants_hz: [f32; 3],
    state: [[f32; 2]; 3],
    turn: f32,
}

impl Talker {
    fn new(rate_hz: u32) -> Self {
        Self {
            rate_hz: rate_hz as f32,
            formants_hz: [500.0, 1500.0, 2500.0],
            state: [[0.0; 2]; 3],
            turn: 0.0,
        }
    }

    fn vowel(
        &mut self,
        out: &mut [f32],
        at: usize,
        seconds: f32,
        hz: f32,
        glide: f32,
        rng: &mut ChaCha8Rng,
    ) -> usize {
        let goal = [
            rng.random_range(280.0..850.0),
            rng.random_range(850.0..2300.0),
            rng.random_range(2300.0..3200.0),
        ];
        let count = (seconds * self.rate_hz) as usize;
        let loud = rng.random_range(0.5..1.2);
        for i in 0..count.min(out.len().saturating_sub(at)) {
            let part = i as f32 / count as f32;
            let edge = (12.0 * part).min(6.0 * (1.0 - part)).min(1.0);
            self.turn += hz * glide.powf(part) / self.rate_hz;
            let pulse = if self.turn >= 1.0 { 1.0 } else { 0.0 };
            self.turn = self.turn.fract();
            for (f, g) in self.formants_hz.iter_mut().zip(goal) {
                *f += (g - *f) * 40.0 / self.rate_hz;
            }
            let breath = 0.02 * rng.random_range(-1.0..1.0);
            out[at + i] += loud * edge * self.resonate(pulse + breath);
        }
        at + count
    }

    fn consonant(
        &mut self,
        out: &mut [f32],
        at: usize,
        seconds: f32,
        rng: &mut ChaCha8Rng,
    ) -> usize {
        let count = (seconds * self.rate_hz) as usize;
        let bright = rng.random_range(0.2..1.0);
        let loud = rng.random_range(0.02..0.25);
        let stop = rng.random_bool(0.4);
        let mut before = 0.0;
        for i in 0..count.min(out.len().saturating_sub(at)) {
            let part = i as f32 / count as f32;
            // A stop is silent at first, then bursts.
            let edge = if stop {
                f32::from(u8::from(part > 0.7)) * 1.5
            } else {
                (8.0 * part).min(1.0)
            };
            let now: f32 = rng.random_range(-1.0..1.0);
            out[at + i] += loud * edge * (now - bright * before);
            before = now;
        }
        at + count
    }

    /// Two-pole resonators in parallel.
    fn resonate(&mut self, input: f32) -> f32 {
        let mut sum = 0.0;
        for ((hz, state), gain) in self
            .formants_hz
            .iter()
            .zip(&mut self.state)
            .zip([1.0, 0.6, 0.3])
        {
            let radius = (-std::f32::consts::PI * 90.0 / self.rate_hz).exp();
            let now = input + 2.0 * radius * (TAU * hz / self.rate_hz).cos() * state[0]
                - radius * radius * state[1];
            *state = [now, state[0]];
            sum += gain * now * (1.0 - radius);
        }
        sum
    }
}

/// Adds a knock: a tone and noise that die away.
fn strike(
    out: &mut [f32],
    rate_hz: u32,
    at_s: f64,
    tone_hz: f32,
    decay_s: f32,
    gain: f32,
    rng: &mut ChaCha8Rng,
) {
    let start = (at_s.max(0.0) * f64::from(rate_hz)) as usize;
    let count = (6.0 * decay_s * rate_hz as f32) as usize;
    for (age, sample) in out.iter_mut().skip(start).take(count).enumerate() {
        let age_s = age as f32 / rate_hz as f32;
        let sound = 0.5 * (TAU * tone_hz * age_s).sin() + 0.5 * rng.random_range(-1.0f32..1.0);
        *sample += gain * sound * (-age_s / decay_s).exp();
    }
}

fn length(duration_s: f64, rate_hz: u32) -> usize {
    (duration_s.max(0.0) * f64::from(rate_hz)).round() as usize
}

/// Brought to a mean square of one.
fn levelled(samples: impl IntoIterator<Item = f32>) -> Vec<f32> {
    let mut out: Vec<f32> = samples.into_iter().collect();
    let scale = 1.0 / rms(&out).max(1e-9);
    out.iter_mut().for_each(|s| *s *= scale);
    out
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
