//! Prints the beats of a recording, one a line in seconds, and the tempo; without
//! a file those of the built-in song:
//! `cargo run --release -p servodance-audio --example beats -- [song.wav]`.

use servodance_audio::beats::track_offline;
use servodance_audio::song::Song;
use servodance_audio::{AudioSource, MusicAnalyzer};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let analyzer = match std::env::args().nth(1) {
        Some(path) => {
            let mut source = AudioSource::open(path)?;
            let mut analyzer = MusicAnalyzer::keeping_history(source.sample_rate_hz())?;
            let mut block = Vec::new();
            while source.next_block(&mut block)? {
                analyzer.push(&block);
                while analyzer.pop().is_some() {}
            }
            analyzer
        }
        None => {
            let song = Song::demo();
            let mut analyzer = MusicAnalyzer::keeping_history(song.sample_rate_hz)?;
            analyzer.push(&song.samples);
            analyzer
        }
    };
    let track = track_offline(analyzer.history().ok_or("no history")?);
    for time_s in &track.times_s {
        println!("{time_s:.3}");
    }
    eprintln!("{:.1} beats a minute", track.tempo_bpm);
    Ok(())
}
