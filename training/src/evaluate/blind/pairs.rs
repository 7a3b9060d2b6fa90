//! The dances of a blind comparison.

use crate::dataset::{index, rendered_on};
use crate::evaluate::parallel::in_parallel;
use crate::evaluate::request::EvaluationRequest;
use crate::evaluate::songs::{WARM_UP_S, dance};
use crate::motion::tempo;
use crate::song_file::{read_sound, songs_in};
use anyhow::ensure;
use servodance_audio::MusicAnalyzer;
use servodance_model::conditioning::HeardFrame;
use servodance_model::motion::{Clip, Pose};
use servodance_model::{Generator, GeneratorOptions};
use servodance_runtime::session::dance::open_generator;
use servodance_types::FRAME_RATE_HZ;
use std::path::{Path, PathBuf};

/// More would tire people.
const MOST: usize = 12;
/// Captured dance is shown where its beats meet the motion this well (F1).
const USABLE_F1: f64 = 0.6;

pub(super) struct DancePair {
    /// Mono samples and their rate, hertz.
    pub sound: (Vec<f32>, u32),
    pub generated: Vec<Pose>,
    pub other: Vec<Pose>,
    /// What the other is: `captured`, or the name of the weights.
    pub against: String,
}

/// Up to 12 pairs against captured dance and 12 against other weights.
pub(super) fn pairs(
    request: &EvaluationRequest,
    on_progress: &(impl Fn(f64) + Sync),
) -> anyhow::Result<Vec<DancePair>> {
    let generator = open_generator(request.model.as_deref(), request.engine)?;
    generator.start(request.options(0))?; // an unknown style fails before the work
    let (asked, seconds) = (&request.by_song, request.seconds_of_clips());
    let mut all = Vec::new();
    if let Some(folder) = &asked.motion {
        let clips = captured(folder, seconds)?;
        all.extend(in_parallel(clips.len(), &|share| on_progress(share / 2.0), |at| {
            let options = request.options(request.seed + at as u64);
            against_captured(&generator, &options, &clips[at], seconds)
        })?);
    }
    if let (Some(weights), Some(folder)) = (&asked.against, &asked.songs) {
        let other = open_generator(Some(weights), request.engine)?;
        let name = weights.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let paths: Vec<PathBuf> = songs_in(folder)?.into_iter().take(MOST).collect();
        all.extend(in_parallel(paths.len(), &|share| on_progress(0.5 + share / 2.0), |at| {
            let options = request.options(request.seed + at as u64);
            against_weights([&generator, &other], &options, (&paths[at], &name), seconds)
        })?);
    }
    Ok(all)
}

/// Captured dances with a beat that are long enough, spread over the folder.
fn captured(folder: &Path, seconds: f64) -> anyhow::Result<Vec<(Clip, tempo::KinematicTempo)>> {
    let mut usable = Vec::new();
    for entry in index::read(folder)?.iter().filter(|entry| entry.dance) {
        let clip = Clip::read_npz(entry.path(folder))?.normalised();
        let tempo = tempo::estimate(&clip).filter(|tempo| tempo.f1 >= USABLE_F1);
        if let Some(tempo) = tempo.filter(|_| clip.duration_s() >= seconds + 2.0) {
            usable.push((clip, tempo));
        }
    }
    ensure!(
        !usable.is_empty(),
        "{} holds no dance of {seconds} s with a beat that can be seen",
        folder.display()
    );
    let every = usable.len().div_ceil(MOST);
    Ok(usable.into_iter().step_by(every).collect())
}

/// A captured dance with its beats on a steady grid, and the generated one, both to a song
/// that is rendered on that grid.
fn against_captured(
    generator: &Generator,
    options: &GeneratorOptions,
    (clip, tempo): &(Clip, tempo::KinematicTempo),
    seconds: f64,
) -> anyhow::Result<DancePair> {
    let (danced, grid_s) = tempo::onto_grid(clip, tempo, tempo.period_s, 0.0);
    let beats_s: Vec<f64> = grid_s.iter().map(|beat| beat + WARM_UP_S).collect();
    let song = rendered_on(&clip.name, &beats_s, WARM_UP_S + seconds + 0.2, options.seed)?;
    let heard = hear(&song.samples, song.sample_rate_hz)?;
    let rate = f64::from(song.sample_rate_hz);
    let sound = song.samples[(WARM_UP_S * rate) as usize..].to_vec();
    Ok(DancePair {
        sound: (sound, song.sample_rate_hz),
        generated: shown(dance(generator, options, &heard)?.poses, seconds),
        other: shown(danced.poses, seconds),
        against: "captured".into(),
    })
}

fn against_weights(
    generators: [&Generator; 2],
    options: &GeneratorOptions,
    (path, name): (&Path, &str),
    seconds: f64,
) -> anyhow::Result<DancePair> {
    let (mut samples, rate_hz) = read_sound(path)?;
    let length = ((WARM_UP_S + seconds) * f64::from(rate_hz)) as usize;
    ensure!(
        samples.len() >= length,
        "{}: at least {} s of music are needed",
        path.display(),
        WARM_UP_S + seconds
    );
    samples.truncate(length);
    let heard = hear(&samples, rate_hz)?;
    let mut other_options = options.clone();
    other_options.style = options.style.clone().filter(|s| generators[1].styles().contains(s));
    let sound = samples[(WARM_UP_S * f64::from(rate_hz)) as usize..].to_vec();
    Ok(DancePair {
        sound: (sound, rate_hz),
        generated: shown(dance(generators[0], options, &heard)?.poses, seconds),
        other: shown(dance(generators[1], &other_options, &heard)?.poses, seconds),
        against: name.to_owned(),
    })
}

fn shown(mut poses: Vec<Pose>, seconds: f64) -> Vec<Pose> {
    poses.truncate((seconds * FRAME_RATE_HZ) as usize);
    poses
}

fn hear(samples: &[f32], rate_hz: u32) -> anyhow::Result<Vec<HeardFrame>> {
    let mut analyzer = MusicAnalyzer::new(rate_hz)?;
    analyzer.push(samples);
    Ok(std::iter::from_fn(|| analyzer.pop()).map(HeardFrame::from).collect())
}
