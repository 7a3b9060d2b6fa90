//! Data to learn from: motion of other programs comes in ([`import`]), is looked
//! over ([`Report`]), and becomes the training file ([`build`]): motion, the
//! music that it is danced to, splits.
//!
//! Captured motion has no music here, so music is rendered on its beats, or on
//! the beats that a choreography is then made for. The features are those that
//! a live dancer hears: causal, from [`MusicAnalyzer`](servodance_audio::MusicAnalyzer).
//! Same options and data: the same numbers. Offline; minutes of work.

mod captured;
mod import;
mod music;
mod report;
mod sources;
mod synthetic;

pub use import::{Import, Imported, import};
pub use report::Report;

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::motion::corpus::{self, CorpusClip};
use crate::motion::index::STYLES;
use servodance_model::conditioning::Encodec;
use servodance_model::motion::MotionError;
use sources::SOURCES;

/// What to build.
#[derive(Clone, Debug)]
pub struct Options {
    /// A folder with `index.csv` and npz clips, as [`import`] writes it; without
    /// it the file holds choreography alone.
    pub motion: Option<PathBuf>,
    /// The file to write.
    pub out: PathBuf,
    /// How many songs every captured dance with a beat gets.
    pub songs_per_clip: usize,
    /// Minutes of choreography.
    pub choreography_minutes: f64,
    /// Everything random follows from it.
    pub seed: u64,
    /// Writes Encodec latents of all music as well.
    pub encodec: Option<Encodec>,
}

/// What was built: minutes by kind, and what was left out.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Summary {
    /// Clips written.
    pub clips: usize,
    /// Minutes written, by `source / style / split / music or not`.
    pub minutes: BTreeMap<String, f64>,
    /// Minutes of captured dance before copies, and those with a usable beat.
    pub captured_dance_minutes: f64,
    /// Of these, how many have a beat that music was rendered on.
    pub captured_dance_with_beat_minutes: f64,
    /// The terms of every source of captured motion.
    pub terms: BTreeMap<String, String>,
    /// Files that could not be read, with the reason.
    pub left_out: Vec<String>,
}

/// Why no training file was built.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// A motion file or the index is unusable, or the result cannot be written.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// A song cannot be rendered.
    #[error("cannot render music for {clip}: {reason}")]
    Music {
        /// The clip that needs it.
        clip: String,
        /// What the renderer said.
        reason: String,
    },
}

/// Builds the training file. A motion file that cannot be read is left out and
/// named in the summary; an unreadable index is an error. `on_progress` is told
/// the share that is done.
pub fn build(options: &Options, on_progress: &dyn Fn(f64)) -> Result<Summary, DatasetError> {
    let mut summary = Summary::default();
    let mut clips = Vec::new();
    if let Some(folder) = &options.motion {
        let first_half = |share: f64| on_progress(share / 2.0);
        captured::collect(folder, options, &mut clips, &mut summary, &first_half)?;
    }
    synthetic::collect(options, &mut clips, &|share| on_progress(0.5 + share / 2.0))?;
    summary.clips = clips.len();
    for clip in &clips {
        *summary.minutes.entry(kind(clip)).or_default() += clip.motion.len() as f64 / 1200.0;
    }
    let recipe = serde_json::json!({
        "seed": options.seed,
        "songs_per_clip": options.songs_per_clip,
        "choreography_minutes": options.choreography_minutes,
        "music": "all music is synthetic, rendered on the beats of the motion",
        "sources": SOURCES.map(|(source, terms)| serde_json::json!({ "source": source, "terms": terms })),
        "summary": summary,
    });
    corpus::write(&options.out, &clips, &recipe)?;
    Ok(summary)
}

fn kind(clip: &CorpusClip) -> String {
    let source = if clip.synthetic {
        "choreography"
    } else {
        clip.name.split('/').next().unwrap_or("")
    };
    let split = clip.split.name();
    let music = if clip.music.is_some() {
        "music"
    } else {
        "no music"
    };
    format!("{source} / {} / {split} / {music}", STYLES[clip.style])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(folder: &std::path::Path, name: &str) -> Options {
        Options {
            motion: None,
            out: folder.join(name),
            songs_per_clip: 1,
            choreography_minutes: 2.0,
            seed: 3,
            encodec: None,
        }
    }

    #[test]
    fn choreography_alone_needs_no_data_and_is_the_same_every_time() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| options(folder.path(), name));
        let summary = build(&a, &|_| {}).unwrap();
        build(&b, &|_| {}).unwrap();
        assert_eq!(summary.clips, 2);
        assert!((summary.minutes.values().sum::<f64>() - 2.0).abs() < 0.01);
        let bytes = |options: &Options| std::fs::read(&options.out).unwrap();
        assert!(bytes(&a) == bytes(&b), "two builds differ");
    }

    #[test]
    fn captured_motion_gets_music_on_its_beats_and_bad_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let index =
            "clip,source,minutes,dance,label\nswing,home,0.3,yes,swing\nbroken,home,1,yes,x\n";
        std::fs::write(path("index.csv"), index).unwrap();
        std::fs::write(path("broken.npz"), "no archive").unwrap();
        swing().write_npz(path("swing.npz")).unwrap();
        let options = Options {
            motion: Some(folder.path().to_owned()),
            choreography_minutes: 0.0,
            ..options(folder.path(), "out")
        };
        let summary = build(&options, &|_| {}).unwrap();
        // Original and mirror, each with and without music.
        assert_eq!(summary.clips, 4, "{summary:?}");
        assert!(summary.left_out[0].contains("broken.npz"), "{summary:?}");
        assert!((summary.captured_dance_with_beat_minutes - 0.3).abs() < 1e-9);
    }

    /// A body whose arms stop every 0.5 s.
    fn swing() -> servodance_model::motion::Clip {
        use servodance_types::BodyJoint;
        let pose = |i: usize| {
            let swing = 0.3 * (std::f64::consts::TAU * i as f64 / 20.0).cos();
            BodyJoint::ALL.map(|joint| {
                let name = joint.name();
                let side = match name.split_once('_') {
                    Some(("left", _)) => 0.15,
                    Some(_) => -0.15,
                    None => 0.0,
                };
                let arm = name.contains("elbow") || name.contains("wrist");
                let legs = ["knee", "ankle", "foot"]
                    .iter()
                    .position(|leg| name.contains(leg));
                let height = legs.map_or(0.9 + 0.01 * joint as usize as f32, |at| {
                    [0.45, 0.08, 0.02][at]
                });
                [side, height, if arm { swing as f32 } else { 0.0 }]
            })
        };
        servodance_model::motion::Clip {
            name: "swing".into(),
            fps: 20.0,
            poses: (0..360).map(pose).collect(),
        }
    }
}
