//! Prints the beats of a recording, one a line in seconds, as the causal
//! tracker calls them live or as the offline tracker finds them:
//! `cargo run --release -p servodance-audio --example track -- song.ogg [offline|bars|frames]`.
//! `bars` prints after each live beat its place in the bar from 1, 0 where it is not known.
//! `frames` prints time, phase, tempo and confidence 20 times a second.

use std::io::Write;

use servodance_audio::beats::track_offline;
use servodance_audio::{AudioSource, MusicAnalyzer};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let path = arguments.first().ok_or("usage: track FILE [offline|bars|frames]")?;
    let what = arguments.get(1).map_or("causal", String::as_str);
    let mut source = AudioSource::open(path)?;
    let mut analyzer = MusicAnalyzer::keeping_history(source.sample_rate_hz())?;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut block = Vec::new();
    while source.next_block(&mut block)? {
        analyzer.push(&block);
        while let Some(frame) = analyzer.pop() {
            if what == "frames" {
                let (time_s, beat) = (frame.time_s, frame.beat);
                writeln!(
                    out,
                    "{time_s:.3} {:.4} {:.2} {:.3} {:.3} {:?} {:?}",
                    beat.phase,
                    beat.tempo_bpm,
                    beat.confidence,
                    frame.presence,
                    beat.lock,
                    beat.beat_in_bar
                )?;
            }
        }
    }
    let history = analyzer.history().ok_or("no history")?;
    if what == "onsets" {
        for (i, value) in history.evidence.iter().enumerate() {
            writeln!(out, "{:.5} {value:.4}", history.time_s(i))?;
        }
    }
    if what == "both" {
        for live in &history.beats {
            writeln!(out, "{:.4}", live.time_s)?;
        }
        writeln!(out, "--")?;
        for t in track_offline(history).times_s {
            writeln!(out, "{t:.4}")?;
        }
    }
    if what == "bars" {
        for live in &history.beats {
            let place = live.beat.beat_in_bar.map_or(0, |place| place + 1);
            writeln!(out, "{:.4} {place}", live.time_s)?;
        }
    }
    let times_s = match what {
        "causal" => history.live_track().times_s,
        "offline" => track_offline(history).times_s,
        _ => Vec::new(),
    };
    for time_s in times_s {
        writeln!(out, "{time_s:.4}")?;
    }
    Ok(())
}
