//! Scores the causal tracker on rendered songs:
//! `cargo run --release -p servodance-audio --example beats -- 40`.

use servodance_audio::MusicAnalyzer;
use servodance_audio::song::SongSpec;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let count: u64 = std::env::args().nth(1).map_or(Ok(40), |s| s.parse())?;
    let mut errors_ms = Vec::new();
    let (mut sum, mut slips) = (0.0, 0.0);
    for seed in 0..count {
        let spec = SongSpec::random(30.0, seed)?;
        let song = spec.render()?;
        let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz)?;
        let (mut right, mut all, mut ratio) = (0, 0, Vec::new());
        let mut lock_s = None;
        let period = song.beats_s[1] - song.beats_s[0];
        for block in song.samples.chunks(1024) {
            analyzer.push(block);
            while let Some(frame) = analyzer.pop() {
                if lock_s.is_none() && frame.beat.confidence > 0.5 {
                    lock_s = Some(frame.time_s);
                }
                if frame.time_s < 5.0 {
                    continue;
                }
                let error = f64::from(frame.beat.phase) - frame.time_s / period;
                let error_s = (error - error.round()) * period;
                ratio.push(f64::from(frame.beat.tempo_bpm) * period / 60.0);
                all += 1;
                if error_s.abs() < 0.07 && (ratio[ratio.len() - 1] - 1.0).abs() < 0.1 {
                    right += 1;
                    errors_ms.push(error_s * 1e3);
                }
            }
        }
        ratio.sort_by(f64::total_cmp);
        let share = f64::from(right) / f64::from(all);
        sum += share;
        slips += f64::from(u8::from(share < 0.5));
        println!(
            "{seed:3} {:10} {:6.1} BPM  right {share:.2}  tempo x{:.2}  lock {:?}  drums {}",
            format!("{:?}", spec.style),
            60.0 / period,
            ratio[ratio.len() / 2],
            lock_s,
            spec.sections.iter().filter(|s| s.layers.drums).count() * 100 / spec.sections.len(),
        );
    }
    errors_ms.sort_by(f64::total_cmp);
    println!(
        "mean right {:.3}, failed {slips}, phase error median {:.1} ms, 10 % {:.1}, 90 % {:.1}",
        sum / count as f64,
        errors_ms[errors_ms.len() / 2],
        errors_ms[errors_ms.len() / 10],
        errors_ms[errors_ms.len() * 9 / 10],
    );
    Ok(())
}
