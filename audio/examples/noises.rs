//! Writes sounds that are not music as wav files:
//! `cargo run --release -p servodance-audio --example noises -- FOLDER [SECONDS]`.

use std::error::Error;

use servodance_audio::song::noise::{crowd, hiss, knocks, motors, speech};

const RATE_HZ: u32 = 22_050;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, rest @ ..] = arguments.as_slice() else {
        return Err("usage: noises FOLDER [SECONDS]".into());
    };
    let seconds: f64 = rest.first().map_or(Ok(30.0), |s| s.parse())?;
    for seed in 0..3 {
        // Half turns of a dance at 100 to 140 BPM, as if to a song long over.
        let turn_s = 60.0 / (100.0 + 20.0 * seed as f64);
        let turns: Vec<f64> =
            (0..).map(|i| f64::from(i) * turn_s).take_while(|t| *t < seconds).collect();
        let colour = 0.45 * seed as f32;
        for (name, sound) in [
            ("speech", speech(seconds, RATE_HZ, seed)),
            ("crowd", crowd(seconds, RATE_HZ, seed)),
            ("hiss", hiss(seconds, RATE_HZ, colour, seed)),
            ("knocks", knocks(seconds, RATE_HZ, 2.0 + 2.0 * seed as f64, seed)),
            ("motors", motors(&turns, seconds, RATE_HZ, seed)),
        ] {
            write(&format!("{folder}/{name}-{seed}.wav"), &sound)?;
        }
    }
    Ok(())
}

fn write(path: &str, sound: &[f32]) -> Result<(), hound::Error> {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: RATE_HZ,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut out = hound::WavWriter::create(path, spec)?;
    for sample in sound {
        out.write_sample((sample * 0.05 * 32_767.0).clamp(-32_767.0, 32_767.0) as i16)?;
    }
    out.finalize()
}
