//! Pairs of dances for people to vote on: `servodance evaluate --blind DIR` writes a page,
//! `--votes DIR` scores what was voted.
//!
//! Both dances of a pair are to one sound and equally long; which side is which is drawn by the
//! seed and stands in `key.json` alone, which the page does not read.

mod bradley_terry;
mod pairs;
mod votes;

pub use votes::{VoteScores, score_votes};

use super::request::EvaluationRequest;
use anyhow::{Context, ensure};
use pairs::{DancePair, pairs};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use servodance_audio::song::Song;
use servodance_model::motion::Pose;
use servodance_runtime::offline::song_file::write_song;
use servodance_runtime::telemetry::pending_file::write_whole;
use std::fmt::Write;
use std::path::Path;

const PAGE: &str = include_str!("page.html");

/// Which dances a pair shows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PairKey {
    pub pair: usize,
    pub left: String,
    pub right: String,
}

/// Writes `index.html`, the sounds, the motion and `key.json` into a folder; the number of
/// pairs. Fails for: neither --motion nor --against, or nothing in them to pair.
pub fn write_blind(
    request: &EvaluationRequest,
    folder: &Path,
    on_progress: impl Fn(f64) + Sync,
) -> anyhow::Result<usize> {
    let asked = &request.by_song;
    ensure!(
        asked.motion.is_some() || asked.against.is_some(),
        "--blind needs --motion (captured dance) or --against (other weights) for the other side"
    );
    let pairs = pairs(request, &on_progress)?;
    std::fs::create_dir_all(folder).with_context(|| format!("{}", folder.display()))?;
    let mut rng = ChaCha8Rng::seed_from_u64(request.seed);
    let mut keys = Vec::new();
    let mut script = String::from("const PAIRS = [\n");
    for (at, pair) in pairs.iter().enumerate() {
        let DancePair { sound, generated, other, against } = pair;
        let number = at + 1;
        let wav = format!("pair-{number:02}.wav");
        write_song(&folder.join(&wav), &as_song(sound), 0.0)?;
        let swapped = rng.random_bool(0.5);
        let (left, right) = if swapped { (other, generated) } else { (generated, other) };
        let names = ["generated".to_owned(), against.clone()];
        let [a, b] = if swapped { [1, 0] } else { [0, 1] }.map(|i: usize| names[i].clone());
        keys.push(PairKey { pair: number, left: a, right: b });
        // Writing to a String cannot fail.
        let _ = writeln!(
            script,
            "{{\"pair\":{number},\"sound\":\"{wav}\",\"left\":{},\"right\":{}}},",
            millimetres(left),
            millimetres(right)
        );
    }
    script.push_str("];\n");
    write_whole(&folder.join("pairs.js"), script.as_bytes())?;
    write_whole(&folder.join("key.json"), serde_json::to_string_pretty(&keys)?.as_bytes())?;
    write_whole(&folder.join("index.html"), PAGE.as_bytes())?;
    Ok(pairs.len())
}

fn as_song((samples, rate_hz): &(Vec<f32>, u32)) -> Song {
    Song {
        sample_rate_hz: *rate_hz,
        samples: samples.clone(),
        beats_s: Vec::new(),
        downbeats: Vec::new(),
    }
}

/// All coordinates of a dance in a row; nothing in them tells where the dance came from.
fn millimetres(poses: &[Pose]) -> String {
    let [x, _, z] = poses.first().map_or([0.0; 3], |pose| pose[0]);
    let points = poses.iter().flatten().map(|p| [p[0] - x, p[1], p[2] - z]);
    let numbers = points.flatten().map(|v| format!("{:.0}", 1e3 * v));
    format!("[{}]", numbers.collect::<Vec<_>>().join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dance_begins_in_the_middle_in_whole_millimetres() {
        let mut pose = [[1.0, 0.5, -2.0]; 22];
        pose[1] = [1.25, 0.0, -2.0];
        let text = millimetres(&[pose]);
        assert!(text.starts_with("[0,500,0,250,0,0,0,500"), "{text}");
        assert_eq!(text.split(',').count(), 66);
    }
}
