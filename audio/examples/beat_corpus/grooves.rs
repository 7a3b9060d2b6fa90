//! Grooves thrown together by chance: where each stroke falls follows how
//! likely real drummers and guitarists strike there, no pattern is fixed.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f32::consts::TAU;

const STEPS: usize = 16;

/// One player: a sound and the chance of a stroke on each step of a bar.
struct Player {
    shot: Vec<f32>,
    pattern: Vec<f32>,
    /// Semitones from the first for each bar of four, pitched players only.
    bars: Option<[Vec<f32>; 4]>,
}

/// Plays on these beats.
pub fn play(
    beats_s: &[f64],
    first_downbeat: usize,
    duration_s: f64,
    rate_hz: u32,
    rng: &mut ChaCha8Rng,
) -> Vec<f32> {
    let mut out = vec![0.0f32; (duration_s * f64::from(rate_hz)).round() as usize];
    let mut players = vec![kick(rate_hz, rng), snare(rate_hz, rng)];
    for _ in 0..rng.random_range(0..3) {
        players.push(cymbal(rate_hz, rng));
    }
    for _ in 0..rng.random_range(0..3) {
        players.push(riff(rate_hz, rng));
    }
    if rng.random_bool(0.15) {
        players.remove(rng.random_range(0..2));
    }
    let gains: Vec<f32> = players.iter().map(|_| rng.random_range(0.2..1.0)).collect();
    let swing = if rng.random_bool(0.2) { rng.random_range(0.1..0.66) } else { 0.0 };
    // Swing of eighths or of sixteenths.
    let swung = if rng.random_bool(0.5) { 2 } else { 1 };
    let mut silent = vec![false; players.len()];
    for (beat, pair) in beats_s.windows(2).enumerate() {
        let in_bar = (beat + 4 - first_downbeat) % 4;
        let bar = (beat + 4 - first_downbeat) / 4;
        if in_bar == 0 && bar.is_multiple_of(4) {
            silent.iter_mut().for_each(|s| *s = rng.random_bool(0.12));
        }
        let fill = in_bar >= 2 && bar % 4 == 3 && rng.random_bool(0.4);
        for quarter in 0..4 {
            let late = if quarter % (2 * swung) >= swung {
                0.25 * swing * f64::from(swung as u8)
            } else {
                0.0
            };
            let at_s = pair[0] + (pair[1] - pair[0]) * (quarter as f64 + late) / 4.0;
            for (p, player) in players.iter().enumerate().filter(|(p, _)| !silent[*p]) {
                let mut chance = player.pattern[(in_bar * 4 + quarter) % player.pattern.len()];
                if fill && p == 1 {
                    chance = 0.7;
                }
                if rng.random_range(0.0..1.0) >= chance.abs() {
                    continue;
                }
                let shot = player.bars.as_ref().map_or(&player.shot, |bars| &bars[bar % 4]);
                // A negative chance is a soft stroke.
                let soft = if chance < 0.0 { 0.4 } else { 1.0 };
                let at_s = at_s + rng.random_range(-0.006..0.006);
                strike(&mut out, rate_hz, at_s, shot, gains[p] * soft * rng.random_range(0.7..1.0));
            }
        }
        // Cymbals open parts.
        if in_bar == 0 && bar.is_multiple_of(4) && rng.random_bool(0.5) {
            let crash = burst(rate_hz, 0.5, 0.9, rng);
            strike(&mut out, rate_hz, pair[0], &crash, 0.7);
        }
    }
    out
}

fn strike(out: &mut [f32], rate_hz: u32, at_s: f64, shot: &[f32], gain: f32) {
    let start = (at_s.max(0.0) * f64::from(rate_hz)) as usize;
    out.iter_mut().skip(start).zip(shot).for_each(|(o, s)| *o += gain * s);
}

fn kick(rate_hz: u32, rng: &mut ChaCha8Rng) -> Player {
    let (low, drop, decay) = (
        rng.random_range(42.0..75.0),
        rng.random_range(50.0..250.0),
        rng.random_range(0.04..0.2f32),
    );
    let click = rng.random_range(0.0..0.5);
    let mut turns = 0.0f32;
    let shot = (0..(4.0 * decay * rate_hz as f32) as usize)
        .map(|i| {
            let age_s = i as f32 / rate_hz as f32;
            turns += (low + drop * (-age_s / 0.02).exp()) / rate_hz as f32;
            (TAU * turns).sin() * (-age_s / decay).exp()
                + click * rng.random_range(-1.0..1.0) * (-age_s / 0.004).exp()
        })
        .collect();
    let mut pattern = vec![0.0; STEPS];
    match rng.random_range(0..10) {
        // Four on the floor; double bass in eighths or sixteenths; syncopated.
        0..3 => (0..4).for_each(|b| pattern[4 * b] = 0.98),
        3 => (0..8).for_each(|e| pattern[2 * e] = if e % 2 == 0 { 0.97 } else { 0.9 }),
        4 => (0..16).for_each(|s| pattern[s] = if s % 4 == 0 { 0.97 } else { 0.9 }),
        _ => {
            pattern[0] = 0.97;
            let often = [
                0.0, 0.1, 0.15, 0.12, 0.1, 0.05, 0.35, 0.15, 0.6, 0.15, 0.4, 0.1, 0.1, 0.05, 0.25,
                0.12,
            ];
            for (step, often) in often.into_iter().enumerate().skip(1) {
                pattern[step] = if rng.random_bool(often) { 0.93 } else { 0.0 };
            }
        }
    }
    Player { shot, pattern, bars: None }
}

fn snare(rate_hz: u32, rng: &mut ChaCha8Rng) -> Player {
    let (tone_hz, decay) = (rng.random_range(150.0..330.0), rng.random_range(0.03..0.16f32));
    let body = rng.random_range(0.2..0.9);
    let shot = burst(rate_hz, decay, rng.random_range(0.2..0.9), rng)
        .iter()
        .enumerate()
        .map(|(i, n)| {
            n + body
                * (TAU * tone_hz * i as f32 / rate_hz as f32).sin()
                * (-(i as f32) / rate_hz as f32 / 0.06).exp()
        })
        .collect();
    let mut pattern = vec![0.0; STEPS];
    match rng.random_range(0..20) {
        // Back beat, half time, every beat, off-beats, one drop.
        0..12 => [4, 12].iter().for_each(|&s| pattern[s] = 0.98),
        12..14 => pattern[8] = 0.98,
        14..16 => (0..4).for_each(|b| pattern[4 * b] = 0.95),
        16 => (0..4).for_each(|b| pattern[4 * b + 2] = 0.95),
        17 => [3, 6, 12].iter().for_each(|&s| pattern[s] = 0.95),
        _ => [4, 10, 12].iter().for_each(|&s| pattern[s] = 0.9),
    }
    if rng.random_bool(0.4) {
        for step in 0..STEPS {
            if pattern[step] == 0.0 && rng.random_bool(0.2) {
                pattern[step] = -0.6;
            }
        }
    }
    Player { shot, pattern, bars: None }
}

fn cymbal(rate_hz: u32, rng: &mut ChaCha8Rng) -> Player {
    let shot = burst(rate_hz, rng.random_range(0.01..0.25), rng.random_range(0.8..0.99), rng);
    let mut pattern = vec![0.0f32; STEPS];
    let every = [1, 2, 2, 2, 4, 4][rng.random_range(0..6)];
    let accent = rng.random_range(0..5);
    for step in (0..STEPS).step_by(every) {
        let strong = match accent {
            0 => step % 4 == 2,
            1 | 2 => step % 4 == 0,
            _ => true,
        };
        pattern[step] = if strong { 0.97 } else { -0.93 };
    }
    // Only the off-beats, as in house and polka.
    if rng.random_bool(0.15) {
        pattern.iter_mut().enumerate().for_each(|(s, p)| *p = if s % 4 == 2 { 0.97 } else { 0.0 });
    }
    Player { shot, pattern, bars: None }
}

/// A bass or a driven guitar: short or long notes, a pitch for each bar.
fn riff(rate_hz: u32, rng: &mut ChaCha8Rng) -> Player {
    let root_hz = 55.0 * 2f32.powf(rng.random_range(-0.5..2.0));
    let drive = if rng.random_bool(0.6) { rng.random_range(2.0..20.0) } else { 0.5 };
    let (hold_s, fifth) = (rng.random_range(0.05..0.4f32), rng.random_bool(0.6));
    let tone = |hz: f32| -> Vec<f32> {
        (0..(1.3 * hold_s * rate_hz as f32) as usize)
            .map(|i| {
                let age_s = i as f32 / rate_hz as f32;
                let saw = |hz: f32| 2.0 * (hz * age_s).fract() - 1.0;
                let raw = saw(hz) + if fifth { saw(1.5 * hz) } else { 0.0 };
                let end = ((1.3 * hold_s - age_s) / 0.02).min(1.0);
                (drive * raw).tanh()
                    * (age_s / 0.004).min(1.0)
                    * end
                    * (-age_s / (2.0 * hold_s)).exp()
            })
            .collect()
    };
    let degrees = [-4.0, -2.0, 0.0, 0.0, 3.0, 5.0, 7.0];
    let bars = std::array::from_fn(|_| {
        tone(root_hz * 2f32.powf(degrees[rng.random_range(0..degrees.len())] / 12.0))
    });
    let mut pattern = vec![0.0f32; STEPS];
    let every = [1, 2, 2, 4, 8, 16][rng.random_range(0..6)];
    for step in 0..STEPS {
        let on_grid = step % every == 0;
        pattern[step] = if on_grid {
            0.95
        } else if rng.random_bool(0.08) {
            0.9
        } else {
            0.0
        };
        if step > 0 && rng.random_bool(0.2) {
            pattern[step] = 0.0;
        }
    }
    // Skank: chords on the off-beats.
    if rng.random_bool(0.12) {
        pattern.iter_mut().enumerate().for_each(|(s, p)| *p = if s % 4 == 2 { 0.97 } else { 0.0 });
    }
    Player { shot: tone(root_hz), pattern, bars: Some(bars) }
}

/// Noise that dies away; `bright` 0 to 1 cuts its bass.
fn burst(rate_hz: u32, decay_s: f32, bright: f32, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let mut before = 0.0;
    (0..(5.0 * decay_s * rate_hz as f32) as usize)
        .map(|i| {
            let now: f32 = rng.random_range(-1.0..1.0);
            let sharp = now - bright * before;
            before = now;
            sharp * (-(i as f32) / rate_hz as f32 / decay_s).exp()
        })
        .collect()
}
