//! Scores the causal tracker on rendered songs, at the tempi of their styles or
//! spread over a range:
//! `cargo run --release -p servodance-audio --example score_songs -- 96 [64 185]`.
//!
//! A frame is right if tempo and phase are (within 10 % and 70 ms); the downbeat
//! is judged in right frames in which one is guessed. All after the first 5 s.

use servodance_audio::MusicAnalyzer;
use servodance_audio::song::{Grid, SongSpec, TempoStep};

/// What came of one song, and of all.
#[derive(Default)]
struct Score {
    frames: usize,
    right: usize,
    guessed: usize,
    downbeat_right: usize,
    /// Tempo as a multiple of the true one.
    ratios: Vec<f64>,
    errors_ms: Vec<f64>,
}

impl Score {
    fn share(&self) -> f64 {
        self.right as f64 / self.frames as f64
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let count: u64 = arguments.first().map_or(Ok(40), |s| s.parse())?;
    let numbers: Result<Vec<f64>, _> = arguments.iter().skip(1).map(|s| s.parse()).collect();
    let tempi = numbers?;
    let (mut all, mut shares) = (Score::default(), Vec::new());
    for seed in 0..count {
        let mut spec = SongSpec::random(30.0, seed)?;
        if let [low, high] = tempi[..] {
            // Steps of the golden section fill the range evenly.
            let bpm = low + (high - low) * (seed as f64 * 0.618_034).fract();
            spec.grid = Grid::Tempo(vec![TempoStep { beats: 200, bpm }]);
        }
        let song = score(&spec, &mut all)?;
        shares.push(song);
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default()
    };
    println!(
        "mean right {:.3}, failed {}, phase error median {:.1} ms, downbeat guessed in {:.2} of the right frames, right in {:.2} of those",
        shares.iter().sum::<f64>() / shares.len() as f64,
        shares.iter().filter(|share| **share < 0.5).count(),
        median(all.errors_ms),
        all.guessed as f64 / all.right as f64,
        all.downbeat_right as f64 / all.guessed as f64,
    );
    Ok(())
}

/// Listens to one song, prints a line of it and adds it to all.
fn score(spec: &SongSpec, all: &mut Score) -> Result<f64, Box<dyn std::error::Error>> {
    let song = spec.render()?;
    let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz)?;
    let period_s = song.beats_s[1] - song.beats_s[0];
    let mut one = Score::default();
    for block in song.samples.chunks(1024) {
        analyzer.push(block);
        while let Some(frame) = analyzer.pop() {
            if frame.time_s < 5.0 {
                continue;
            }
            let last_beat = frame.time_s / period_s - f64::from(frame.beat.phase);
            let error_s = (last_beat.round() - last_beat) * period_s;
            let ratio = f64::from(frame.beat.tempo_bpm) * period_s / 60.0;
            one.ratios.push(ratio);
            one.frames += 1;
            if error_s.abs() > 0.07 || (ratio - 1.0).abs() > 0.1 {
                continue;
            }
            one.right += 1;
            all.errors_ms.push(error_s * 1e3);
            if let Some(guess) = frame.beat.beat_in_bar {
                one.guessed += 1;
                let beat_in_bar = (last_beat.round() as i64).rem_euclid(4);
                one.downbeat_right += usize::from(beat_in_bar == i64::from(guess));
            }
        }
    }
    one.ratios.sort_by(f64::total_cmp);
    println!(
        "{:3} {:10} {:6.1} BPM  right {:.2}  tempo x{:.2}",
        spec.seed,
        format!("{:?}", spec.style),
        60.0 / period_s,
        one.share(),
        one.ratios[one.ratios.len() / 2],
    );
    all.right += one.right;
    all.guessed += one.guessed;
    all.downbeat_right += one.downbeat_right;
    Ok(one.share())
}
