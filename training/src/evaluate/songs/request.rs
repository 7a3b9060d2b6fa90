//! What `servodance evaluate` is asked about songs and for people's eyes.

use servodance_runtime::process::number_range::within;
use std::path::PathBuf;

/// Songs to dance to in place of clips, and what people judge.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct SongArgs {
    /// A folder of songs with their beats (NAME.wav and NAME.beats, a line a beat:
    /// seconds, place in the bar) to dance to, beside controls, in place of clips.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["data", "texts", "minutes"])]
    pub songs: Option<PathBuf>,
    /// A folder of captured motion (`dataset import`) to compare with.
    #[arg(long, value_name = "DIR")]
    pub motion: Option<PathBuf>,
    /// Dances to each song (2 if left out).
    #[arg(long, value_name = "N", requires = "songs", value_parser = within(1..=100_usize))]
    pub seeds: Option<usize>,
    /// Draw contact sheets into this folder, one a song: styles beside captured dance.
    #[arg(long, value_name = "DIR", requires_all = ["songs", "motion"])]
    pub sheet: Option<PathBuf>,
    /// Write a page of pairs of dances with sound to vote on: generated against captured
    /// (--motion), and against other weights (--against, --songs).
    #[arg(long, value_name = "DIR", conflicts_with = "sheet")]
    pub blind: Option<PathBuf>,
    /// With --blind: weights whose dances are the other side.
    #[arg(long, value_name = "FILE.safetensors", requires_all = ["blind", "songs"])]
    pub against: Option<PathBuf>,
    /// Score the votes (votes*.json) that were saved into a folder of --blind.
    #[arg(long, value_name = "DIR", exclusive = true)]
    pub votes: Option<PathBuf>,
}
