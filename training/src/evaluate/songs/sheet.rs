//! Contact sheets of the generator's styles on songs, beside captured dance.

use super::captured::captured_dances;
use super::controls::dance;
use super::known_song::KnownSong;
use crate::evaluate::parallel::in_parallel;
use crate::evaluate::request::EvaluationRequest;
use crate::song_file::songs_in;
use anyhow::Context;
use servodance_model::motion::Clip;
use servodance_model::{Generator, GeneratorOptions};
use servodance_runtime::session::dance::open_generator;
use servodance_runtime::telemetry::pending_file::write_whole;
use servodance_runtime::telemetry::picture::{ContactSheet, PoseRow, StickFigure};
use servodance_types::FRAME_RATE_HZ;
use std::path::{Path, PathBuf};

/// Styles that are shown below the default one, as far as the weights know them.
const STYLES: [&str; 5] = ["salsa", "hype", "pop", "modern", "street"];
const SONGS: usize = 3;
const CAPTURED: usize = 6;
const POSES: usize = 12;
/// Between two poses, seconds.
const POSE_S: f64 = 0.6;
/// What is danced before the poses that are shown, seconds behind the warm-up.
const BEFORE_S: f64 = 5.0;

/// Draws a sheet for each of the first three songs of a folder; the files written.
pub fn write_sheets(
    request: &EvaluationRequest,
    [songs, motion, out]: [&Path; 3],
    on_progress: impl Fn(f64) + Sync,
) -> anyhow::Result<Vec<PathBuf>> {
    let generator = open_generator(request.model.as_deref(), request.engine)?;
    let seconds = BEFORE_S + POSE_S * POSES as f64;
    let captured = captured_rows(&captured_dances(motion, f64::INFINITY)?);
    let paths: Vec<PathBuf> = songs_in(songs)?.into_iter().take(SONGS).collect();
    std::fs::create_dir_all(out).with_context(|| format!("{}", out.display()))?;
    in_parallel(paths.len(), &on_progress, |at| {
        let song = KnownSong::open(&paths[at], seconds, None)?;
        let mut rows = Vec::new();
        let known =
            STYLES.into_iter().filter(|style| generator.styles().iter().any(|s| s == style));
        for style in std::iter::once(generator.default_style()).chain(known) {
            rows.push(style_row(&generator, &request.options(request.seed), style, &song)?);
        }
        rows.extend(captured.iter().cloned());
        let sheet = ContactSheet {
            title: format!("Styles on {}", song.name),
            subtitle: format!(
                "{:.0} BPM; a pose every {POSE_S} s, seed {}; below: captured dance, to no music",
                song.tempo_bpm, request.seed
            ),
            bars: None,
            rows,
        };
        let file = out.join(format!("{}.png", song.name));
        write_whole(&file, &sheet.png()?)?;
        Ok(file)
    })
}

fn style_row(
    generator: &Generator,
    options: &GeneratorOptions,
    style: &str,
    song: &KnownSong,
) -> anyhow::Result<PoseRow> {
    let options = GeneratorOptions { style: Some(style.to_owned()), ..options.clone() };
    let clip = dance(generator, &options, &song.heard)?;
    Ok(row(vec![style.to_owned(), "generated".into()], &clip, BEFORE_S))
}

/// Captured dances spread over the folder, from their middle.
fn captured_rows(clips: &[Clip]) -> Vec<PoseRow> {
    let long = clips.iter().filter(|clip| clip.duration_s() >= POSE_S * POSES as f64);
    let long: Vec<&Clip> = long.collect();
    let every = long.len().div_ceil(CAPTURED).max(1);
    let shown = long.into_iter().step_by(every);
    let name = |clip: &Clip| clip.name.rsplit('/').next().unwrap_or_default().to_owned();
    let from_s = |clip: &Clip| (clip.duration_s() - POSE_S * POSES as f64) / 2.0;
    shown.map(|clip| row(vec![name(clip), "captured".into()], clip, from_s(clip))).collect()
}

fn row(label: Vec<String>, clip: &Clip, from_s: f64) -> PoseRow {
    let pose = |i: usize| {
        let frame = ((from_s + POSE_S * i as f64) * FRAME_RATE_HZ) as usize;
        StickFigure::dancer(&clip.poses[frame.min(clip.poses.len() - 1)])
    };
    PoseRow { label, figures: (0..POSES).map(pose).collect() }
}
