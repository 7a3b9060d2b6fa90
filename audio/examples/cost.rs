//! Prints what listening costs: processor time for 50 ms of audio, features,
//! presence and beat together.
//! `cargo run --release -p servodance-audio --example cost`.

use std::error::Error;
use std::time::Instant;

use servodance_audio::MusicAnalyzer;
use servodance_audio::song::Song;

fn main() -> Result<(), Box<dyn Error>> {
    let song = Song::demo();
    for block in [480, 2205] {
        let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz)?;
        let mut times_ms = Vec::new();
        let before_s = processor_s();
        let begin = Instant::now();
        for samples in song.samples.chunks(block) {
            let start = Instant::now();
            analyzer.push(samples);
            while analyzer.pop().is_some() {}
            times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let wall_s = begin.elapsed().as_secs_f64();
        let spent_s = before_s.zip(processor_s()).map_or(wall_s, |(a, b)| b - a);
        times_ms.sort_by(f64::total_cmp);
        println!(
            "blocks of {block}: {:.3} ms of processor time for 50 ms of audio; a block takes {:.3} ms (median), {:.3} ms (99 %)",
            spent_s * 1e3 / (song.duration_s() * 20.0),
            times_ms[times_ms.len() / 2],
            times_ms[times_ms.len() * 99 / 100],
        );
    }
    Ok(())
}

/// Processor seconds of this thread, where the system tells.
fn processor_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds * 1e-9)
}
