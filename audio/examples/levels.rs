//! Prints what the choice of the beat's level is fitted to, a line a second: the
//! reading that is right, then for each reading its values (`-` for one that
//! nobody dances):
//! `cargo run --release -p servodance-audio --example levels -- rendered COUNT [LOW HIGH]`
//! or `-- recording FILE BEATS`, a file with the time of a beat a line.
//! `audio/reference/fit_level.py` reads it. Songs end with an empty line.

use servodance_audio::song::{Grid, SongSpec, TempoStep};
use servodance_audio::{AudioSource, MusicAnalyzer};

/// A reading is right if its tempo and phase are.
const TEMPO_OFF: f64 = 0.06;
const PHASE_OFF: f64 = 0.12;
/// Seeds of the songs begin here, so that none is one that the score is of.
const FIRST_SEED: u64 = 10_000;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["rendered", count] => rendered(count.parse()?, None),
        ["rendered", count, low, high] => {
            rendered(count.parse()?, Some((low.parse()?, high.parse()?)))
        }
        ["recording", path, beats] => recording(path, beats),
        _ => Err("usage: levels rendered COUNT [LOW HIGH] | recording FILE BEATS".into()),
    }
}

fn rendered(count: u64, tempi: Option<(f64, f64)>) -> Result<(), Failure> {
    for seed in 0..count {
        let mut spec = SongSpec::random(30.0, FIRST_SEED + seed)?;
        if let Some((low, high)) = tempi {
            let bpm = low + (high - low) * (seed as f64 * 0.618_034).fract();
            spec.grid = Grid::Tempo(vec![TempoStep { beats: 200, bpm }]);
        }
        let song = spec.render()?;
        let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz)?;
        for (i, second) in song.samples.chunks(song.sample_rate_hz as usize).enumerate() {
            hear(&mut analyzer, second, (i + 1) as f64, &song.beats_s);
        }
        println!();
    }
    Ok(())
}

fn recording(path: &str, beats: &str) -> Result<(), Failure> {
    let lines = std::fs::read_to_string(beats)?;
    let beats_s: Result<Vec<f64>, _> = lines.lines().map(str::parse).collect();
    let beats_s = beats_s?;
    let mut source = AudioSource::open(path)?;
    let mut analyzer = MusicAnalyzer::new(source.sample_rate_hz())?;
    let (mut block, mut waiting, mut time_s) = (Vec::new(), Vec::new(), 0.0);
    let chunk = source.sample_rate_hz() as usize;
    while source.next_block(&mut block)? {
        waiting.extend_from_slice(&block);
        while waiting.len() >= chunk {
            time_s += 1.0;
            hear(&mut analyzer, &waiting[..chunk], time_s, &beats_s);
            waiting.drain(..chunk);
        }
    }
    println!();
    Ok(())
}

/// Takes the second before `time_s`; prints a line of the beat at its end.
fn hear(analyzer: &mut MusicAnalyzer, second: &[f32], time_s: f64, beats_s: &[f64]) {
    analyzer.push(second);
    while analyzer.pop().is_some() {}
    let Some((phase, bpm)) = true_beat(beats_s, time_s).filter(|_| time_s >= 4.0) else {
        return;
    };
    let readings = analyzer.beat_readings();
    let right = readings.iter().position(|reading| {
        let off = reading.phase - phase;
        (reading.tempo_bpm / bpm).log2().abs() < TEMPO_OFF && (off - off.round()).abs() < PHASE_OFF
    });
    let Some(right) = right else { return };
    let values = readings.iter().map(|reading| match &reading.values {
        Some(values) => values.iter().map(|v| format!("{v:.4}")).collect(),
        None => vec!["-".to_owned()],
    });
    let values: Vec<String> = values.map(|v| v.join(",")).collect();
    println!("{right} {}", values.join(" "));
}

/// Phase and tempo of the music at a time, seconds.
fn true_beat(beats_s: &[f64], time_s: f64) -> Option<(f64, f64)> {
    let next = beats_s.partition_point(|beat| *beat <= time_s);
    let (last_s, next_s) = (*beats_s.get(next.checked_sub(1)?)?, *beats_s.get(next)?);
    let period_s = next_s - last_s;
    Some(((time_s - last_s) / period_s, 60.0 / period_s))
}
