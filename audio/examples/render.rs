//! Renders a song by code into a wav file and prints its beats:
//! `cargo run --release -p servodance-audio --example render -- demo out.wav`
//! or with a seed and a duration: `-- 7 out.wav 30`.

use std::error::Error;
use std::time::Instant;

use servodance_audio::song::{Song, SongSpec};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (what, path) = match arguments.as_slice() {
        [what, path, ..] => (what.as_str(), path),
        _ => return Err("usage: render demo|SEED OUT.wav [SECONDS]".into()),
    };
    let begin = Instant::now();
    let song = if what == "demo" {
        Song::demo()
    } else {
        let seconds: f64 = arguments.get(2).map_or(Ok(30.0), |s| s.parse())?;
        let spec = SongSpec::random(seconds, what.parse()?)?;
        eprintln!("{:?}, {:?}", spec.style, spec.grid);
        spec.render()?
    };
    let speed = song.duration_s() / begin.elapsed().as_secs_f64();
    eprintln!("{:.1} s of music, {speed:.0} times real time", song.duration_s());
    let mut out = hound::WavWriter::create(
        path,
        hound::WavSpec {
            channels: 1,
            sample_rate: song.sample_rate_hz,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        },
    )?;
    for sample in &song.samples {
        out.write_sample((sample * 32_767.0) as i16)?;
    }
    out.finalize()?;
    for beat in &song.beats_s {
        println!("{beat:.4}");
    }
    Ok(())
}
