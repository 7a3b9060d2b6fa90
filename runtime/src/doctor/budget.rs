//! Processor time of a dance: hearing, inventing, retargeting, on this machine.

use super::Finding;
use crate::pipeline::feature_extractor::FeatureExtractor;
use crate::robot::Robot;
use servodance_audio::MusicAnalyzer;
use servodance_audio::song::Song;
use servodance_model::conditioning::Encodec;
use servodance_model::{Generator, GeneratorOptions};
use servodance_types::FRAME_RATE_HZ;
use std::time::Instant;

/// Seconds of the built-in song that are danced.
const SONG_S: f64 = 10.0;
/// The first frames fill caches: they do not count.
const WARM_UP: usize = 20;
/// Share of a frame's time that may be used before there is little to spare.
const COMFORTABLE: f64 = 0.5;

/// What a motion frame takes with everything that hangs on it.
pub fn budget(
    robot: &Robot,
    generator: &Generator,
    encodec: Option<&Encodec>,
) -> anyhow::Result<Vec<Finding>> {
    let mut times_ms = frame_times_ms(robot, generator, encodec)?;
    times_ms.drain(..WARM_UP);
    times_ms.sort_by(f64::total_cmp);
    let rank = |share: f64| times_ms[((times_ms.len() - 1) as f64 * share).round() as usize];
    Ok(vec![verdict(&robot.name, rank(0.5), rank(0.99))])
}

fn verdict(robot: &str, median_ms: f64, p99_ms: f64) -> Finding {
    let frame_ms = 1e3 / FRAME_RATE_HZ;
    let what = format!(
        "features, model and {robot} take {median_ms:.1} ms of each {frame_ms:.0} ms (99th percentile {p99_ms:.1} ms)"
    );
    if p99_ms < COMFORTABLE * frame_ms {
        Finding::good("budget", what)
    } else if median_ms < frame_ms {
        Finding::warning(
            "budget",
            what,
            "stop other programs, or grant real-time priority; was it built with --release?",
        )
    } else {
        Finding::bad(
            "budget",
            what,
            "this machine is too slow to dance live: use `--speed max` and play the recording",
        )
    }
}

fn frame_times_ms(
    robot: &Robot,
    generator: &Generator,
    encodec: Option<&Encodec>,
) -> anyhow::Result<Vec<f64>> {
    let song = Song::demo();
    let analyzer = MusicAnalyzer::new(song.sample_rate_hz)?;
    let mut features = FeatureExtractor::new(analyzer, song.sample_rate_hz, encodec)?;
    let mut dance = generator.start(GeneratorOptions::default())?;
    let mut retargeter = robot.servo_retargeter()?;
    let mut targets = retargeter.rest().to_vec();
    let block = (f64::from(song.sample_rate_hz) / FRAME_RATE_HZ) as usize;
    let blocks = (SONG_S * FRAME_RATE_HZ) as usize;
    let mut cycle = 0;
    let mut times_ms = Vec::with_capacity(blocks);
    for samples in song.samples.chunks_exact(block).take(blocks) {
        let start = Instant::now();
        features.push(samples)?;
        while let Some(heard) = features.pop() {
            let frame = dance.step_heard(&heard)?;
            retargeter.push(&frame);
            while cycle as f64 * robot.period_s() + retargeter.lookahead_s() <= frame.time_s {
                retargeter.next(cycle as f64 * robot.period_s(), &mut targets)?;
                cycle += 1;
            }
        }
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(times_ms)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn the_verdict_follows_the_times() {
        for (median_ms, p99_ms, expected) in [
            (4.0, 9.0, Verdict::Good),
            (4.0, 40.0, Verdict::Warning),
            (40.0, 80.0, Verdict::Warning),
            (60.0, 80.0, Verdict::Bad),
        ] {
            let finding = verdict("neck", median_ms, p99_ms);
            assert_eq!(finding.verdict, expected, "{finding:?}");
            assert!(finding.what.contains("neck"));
        }
    }

    #[test]
    fn every_frame_of_the_song_is_timed() {
        let robot = Robot::load("neck").unwrap();
        let times = frame_times_ms(&robot, &Generator::built_in().unwrap(), None).unwrap();
        assert_eq!(times.len(), (SONG_S * FRAME_RATE_HZ) as usize);
        assert!(times.iter().sum::<f64>() > 0.0);
    }
}
