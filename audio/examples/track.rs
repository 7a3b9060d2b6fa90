//! Prints what the causal tracker hears in a recording, one frame a line:
//! time, phase, tempo, confidence:
//! `cargo run --release -p servodance-audio --example track -- song.ogg`.

use std::io::Write;

use servodance_audio::{AudioSource, MusicAnalyzer};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: track FILE")?;
    let mut source = AudioSource::open(path)?;
    let mut analyzer = MusicAnalyzer::new(source.sample_rate_hz())?;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut block = Vec::new();
    while source.next_block(&mut block)? {
        analyzer.push(&block);
        while let Some(frame) = analyzer.pop() {
            let beat = frame.beat;
            writeln!(
                out,
                "{:.3} {:.4} {:.2} {:.3}",
                frame.time_s, beat.phase, beat.tempo_bpm, beat.confidence
            )?;
        }
    }
    eprintln!("{} packets skipped", source.skipped_packets());
    Ok(())
}
