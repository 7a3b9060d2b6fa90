//! How well the generator answers songs with known beats, and how rich its dance is:
//! `servodance evaluate --songs DIR`.
//!
//! Every song is danced with every seed to its own music and to controls; the first five
//! seconds are danced and not judged.

mod captured;
mod controls;
mod dance_figures;
mod known_song;
mod report;
mod request;
mod sheet;

pub use report::SongEvaluation;
pub use request::SongArgs;
pub use sheet::write_sheets;

pub(super) use controls::dance;
pub(super) use known_song::WARM_UP_S;

use super::parallel::in_parallel;
use super::request::EvaluationRequest;
use crate::metrics::music_answer::{correlation, figure_changes, section_answer, speed_by_bar};
use crate::song_file;
use anyhow::bail;
use captured::captured_dances;
use controls::{ByMusic, ControlMusic, dance_with_controls};
use dance_figures::DanceFigures;
use known_song::KnownSong;
use serde::Serialize;
use servodance_model::conditioning::Encodec;
use servodance_model::motion::Clip;
use servodance_runtime::pipeline::conditioning::Conditioning;
use servodance_runtime::session::dance::open_generator;
use std::path::Path;

/// Music whose bars differ less in loudness (standard deviation) has no dynamics, decibels.
const DYNAMICS_DB: f64 = 1.5;

/// What a dance of one song and seed shows.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SongDance {
    pub song: String,
    pub seed: u64,
    pub tempo_bpm: f64,
    /// F1 of kinematic beats within 100 ms, against the song's beats.
    pub f1: ByMusic,
    /// The same against the beats that the tracker found.
    pub f1_found: ByMusic,
    #[serde(flatten)]
    pub figures: DanceFigures,
    /// Correlation of the loudness of bars and the speed of the dancer in them; `None` where
    /// the music has no dynamics.
    pub loudness_answer: Option<f64>,
    /// Changes of section with a change of figure within a beat, and how many by chance.
    pub section_answer: Option<[f64; 2]>,
    pub section_changes: usize,
    /// Whether no other song's beats fit the dance better.
    pub retrieved: bool,
}

/// Dances to the songs of a folder and scores. `on_progress` receives the share that is done.
/// Fails for: fewer than two songs, or a song or clip that cannot be read.
pub fn evaluate_songs(
    request: &EvaluationRequest,
    folder: &Path,
    on_progress: impl Fn(f64) + Sync,
) -> anyhow::Result<SongEvaluation> {
    let seconds = request.seconds_of_songs();
    let seeds = request.by_song.seeds.unwrap_or(2);
    let captured = match &request.by_song.motion {
        Some(folder) => {
            captured_dances(folder, seconds)?.iter().filter_map(DanceFigures::of).collect()
        }
        None => Vec::new(),
    };
    let generator = open_generator(request.model.as_deref(), request.engine)?;
    generator.start(request.options(0))?; // an unknown style fails before the work
    let conditioning = Conditioning { encodec: request.encodec.clone(), ..Conditioning::default() };
    let encodec = conditioning.encodec(&generator)?;
    let (songs, music) = open_songs(folder, seconds, encodec.as_ref(), &on_progress)?;
    let clips = in_parallel(songs.len() * seeds, &|share| on_progress(0.2 + 0.8 * share), |at| {
        let (song, seed) = (at % songs.len(), request.seed + (at / songs.len()) as u64);
        let options = request.options(seed);
        let (clip, f1) = dance_with_controls(&generator, &options, &songs[song], &music[song])?;
        Ok((song, seed, clip, f1))
    })?;
    let dances: Vec<SongDance> = clips
        .iter()
        .map(|(song, seed, clip, f1)| judged(&songs, *song, *seed, clip, *f1))
        .collect();
    let style = request.style.clone().unwrap_or_else(|| generator.default_style().to_owned());
    Ok(SongEvaluation::new(style, seeds, dances, &captured))
}

/// The songs and what their controls hear; the sound itself is let go of.
fn open_songs(
    folder: &Path,
    seconds: f64,
    encodec: Option<&Encodec>,
    on_progress: &(impl Fn(f64) + Sync),
) -> anyhow::Result<(Vec<KnownSong>, Vec<ControlMusic>)> {
    let paths = song_file::songs_in(folder)?;
    if paths.len() < 2 {
        bail!("{} holds one song, the controls need another one", folder.display());
    }
    let songs = in_parallel(paths.len(), &|share| on_progress(0.1 * share), |at| {
        KnownSong::open(&paths[at], seconds, encodec)
    })?;
    let music = in_parallel(songs.len(), &|share| on_progress(0.1 + 0.1 * share), |at| {
        ControlMusic::of(&songs, at, encodec)
    })?;
    Ok((songs.into_iter().map(KnownSong::silenced).collect(), music))
}

fn judged(
    songs: &[KnownSong],
    at: usize,
    seed: u64,
    clip: &Clip,
    [f1, f1_found]: [ByMusic; 2],
) -> SongDance {
    let song = &songs[at];
    let speed = speed_by_bar(clip, &song.bar_spans_s());
    let fits = |other: &KnownSong| super::figures::beat_alignment(&clip.poses, &other.beats_s).f1;
    let others = songs.iter().enumerate().filter(|(i, _)| *i != at);
    let best_other = others.map(|(_, other)| fits(other)).fold(0.0, f64::max);
    let changes = figure_changes(clip, &song.beats_s);
    SongDance {
        song: song.name.clone(),
        seed,
        tempo_bpm: song.tempo_bpm,
        f1,
        f1_found,
        figures: DanceFigures::of(clip).unwrap_or_default(),
        loudness_answer: (deviation(&song.loudness_db) >= DYNAMICS_DB)
            .then(|| correlation(&song.loudness_db, &speed))
            .flatten(),
        section_answer: section_answer(&song.sections, &changes, song.beats_s.len()),
        section_changes: song.sections.len(),
        retrieved: f1.own > best_other,
    }
}

fn deviation(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}
