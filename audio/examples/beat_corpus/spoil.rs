//! What a sound goes through before a robot hears it: equaliser, room, distance,
//! clipping, telephone, codec.

use std::error::Error;
use std::process::Command;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f32::consts::TAU;

use super::RATE_HZ;
use servodance_audio::song::noise;

/// Spoils the music of one piece by chance; `loud` music is driven more often.
pub fn spoil(sound: &mut Vec<f32>, loud: bool, rng: &mut ChaCha8Rng) -> Result<(), Box<dyn Error>> {
    if rng.random_bool(0.4) {
        tilt(sound, rng.random_range(-15.0..6.0), rng.random_range(-12.0..6.0));
    }
    if rng.random_bool(if loud { 0.5 } else { 0.2 }) {
        let drive = rng.random_range(1.0..10.0);
        sound.iter_mut().for_each(|s| *s = (drive * *s).tanh());
    }
    if rng.random_bool(0.35) {
        let (wet, time_s) = (rng.random_range(0.1..1.2), rng.random_range(0.2..1.6));
        *sound = noise::room(sound, RATE_HZ, wet, time_s, rng.random());
    }
    if rng.random_bool(0.06) {
        telephone(sound, rng.random_range(250.0..500.0), rng.random_range(3000.0..5000.0));
    }
    if rng.random_bool(0.05) {
        *sound = codec(sound, rng)?;
    }
    Ok(())
}

/// A room with pink noise and the motors of a robot that turns at `turns_s`.
pub fn loud_room(sound: &mut Vec<f32>, turns_s: &[f64], rng: &mut ChaCha8Rng) {
    let (wet, time_s) = (rng.random_range(0.2..0.9), rng.random_range(0.25..1.0));
    let duration_s = sound.len() as f64 / f64::from(RATE_HZ);
    *sound = noise::room(sound, RATE_HZ, wet, time_s, rng.random());
    let motors = noise::motors(turns_s, duration_s, RATE_HZ, rng.random());
    *sound = noise::mix(sound, &motors, rng.random_range(4.0..16.0));
    let pink = noise::pink(duration_s, RATE_HZ, rng.random());
    *sound = noise::mix(sound, &pink, rng.random_range(4.0..16.0));
}

fn pole(hz: f32) -> f32 {
    1.0 - (-TAU * hz / RATE_HZ as f32).exp()
}

/// Bass below 200 Hz and treble above 3 kHz by so many decibels.
fn tilt(sound: &mut [f32], low_db: f32, high_db: f32) {
    let gain = |db: f32| 10f32.powf(db / 20.0);
    let (mut low, mut middle) = (0.0f32, 0.0f32);
    for sample in sound {
        low += pole(200.0) * (*sample - low);
        middle += pole(3000.0) * (*sample - middle);
        *sample = gain(low_db) * low + (middle - low) + gain(high_db) * (*sample - middle);
    }
}

fn telephone(sound: &mut [f32], low_hz: f32, high_hz: f32) {
    let (mut low, mut high) = (0.0f32, [0.0f32; 2]);
    for sample in sound {
        low += pole(low_hz) * (*sample - low);
        high[0] += pole(high_hz) * (*sample - low - high[0]);
        high[1] += pole(high_hz) * (high[0] - high[1]);
        *sample = high[1];
    }
}

/// Through Opus at a low rate and back, with ffmpeg.
fn codec(sound: &[f32], rng: &mut ChaCha8Rng) -> Result<Vec<f32>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = |name: &str| folder.path().join(name);
    let loudest = sound.iter().fold(1e-6f32, |m, s| m.max(s.abs()));
    let bytes: Vec<u8> = sound.iter().flat_map(|s| (0.7 * s / loudest).to_le_bytes()).collect();
    std::fs::write(path("in.raw"), bytes)?;
    let rate = RATE_HZ.to_string();
    let raw = ["-f", "f32le", "-ar", &rate, "-ac", "1"];
    let ffmpeg = |arguments: &mut Command| arguments.args(["-v", "error", "-y"]).status();
    let bits = rng.random_range(8..32).to_string() + "k";
    let mut encode = Command::new("ffmpeg");
    encode.args(raw).arg("-i").arg(path("in.raw"));
    encode.args(["-c:a", "libopus", "-b:a", &bits]).arg(path("sound.ogg"));
    let mut decode = Command::new("ffmpeg");
    decode.arg("-i").arg(path("sound.ogg")).args(raw).arg(path("out.raw"));
    if !(ffmpeg(&mut encode)?.success() && ffmpeg(&mut decode)?.success()) {
        return Err("ffmpeg failed".into());
    }
    let bytes = std::fs::read(path("out.raw"))?;
    let value = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]) * loudest / 0.7;
    let mut out: Vec<f32> = bytes.chunks_exact(4).map(value).collect();
    out.resize(sound.len(), 0.0);
    Ok(out)
}
