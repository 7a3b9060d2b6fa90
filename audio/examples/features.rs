//! Prints the 35 features of a recording, one frame a line after its time:
//! `cargo run --release -p servodance-audio --example features -- song.wav`.

use std::io::Write;

use servodance_audio::{AudioSource, MusicAnalyzer};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: features FILE")?;
    let mut source = AudioSource::open(path)?;
    let mut analyzer = MusicAnalyzer::new(source.sample_rate_hz())?;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut block = Vec::new();
    while source.next_block(&mut block)? {
        analyzer.push(&block);
        while let Some(frame) = analyzer.pop() {
            write!(out, "{:.3}", frame.time_s)?;
            for value in frame.spectral {
                write!(out, " {value:.6}")?;
            }
            writeln!(out)?;
        }
    }
    Ok(())
}
