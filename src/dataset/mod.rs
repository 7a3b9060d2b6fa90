//! Builds the training file: motion, the music that it is danced to, splits.
//!
//! Captured motion has no music here, so music is rendered on its beats, or on
//! the beats that a choreography is then made for. The features are those that
//! a live dancer hears: causal, from [`MusicAnalyzer`](servodance_audio::MusicAnalyzer).
//! Same options and data: the same file. Offline; minutes of work.

mod captured;
mod music;
mod synthetic;

use std::collections::BTreeMap;
use std::path::PathBuf;

use servodance_model::motion::MotionError;
use servodance_model::motion::corpus::{self, CorpusClip};
use servodance_model::motion::index::{STYLES, Split};

/// What to build.
#[derive(Clone, Debug)]
pub struct Options {
    /// A folder with `index.csv` and npz clips; without it the file holds
    /// choreography alone.
    pub motion: Option<PathBuf>,
    /// The file to write.
    pub out: PathBuf,
    /// How many songs every captured dance with a beat gets.
    pub songs_per_clip: usize,
    /// Minutes of choreography.
    pub choreography_minutes: f64,
    /// Everything random follows from it.
    pub seed: u64,
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
/// named in the summary; an unreadable index is an error.
pub fn build(options: &Options) -> Result<Summary, DatasetError> {
    let mut summary = Summary::default();
    let mut clips = Vec::new();
    if let Some(folder) = &options.motion {
        captured::collect(folder, options, &mut clips, &mut summary)?;
    }
    synthetic::collect(options, &mut clips)?;
    summary.clips = clips.len();
    for clip in &clips {
        *summary.minutes.entry(kind(clip)).or_default() += clip.motion.len() as f64 / 1200.0;
    }
    let recipe = serde_json::json!({
        "seed": options.seed,
        "songs_per_clip": options.songs_per_clip,
        "choreography_minutes": options.choreography_minutes,
        "music": "all music is synthetic, rendered on the beats of the motion",
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
    let split = match clip.split {
        Split::Train => "train",
        Split::Validation => "validation",
        Split::Test => "test",
    };
    let music = if clip.music.is_some() {
        "music"
    } else {
        "no music"
    };
    format!("{source} / {} / {split} / {music}", STYLES[clip.style])
}
