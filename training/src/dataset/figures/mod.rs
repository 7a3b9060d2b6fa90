//! Long dances to rendered songs, made of figures of captured dance.
//!
//! Captured dance is cut at its kinematic beats into figures of 2, 4 and 8 beats
//! ([`figure`]). A song with sections is rendered ([`song_form`]); a plan answers it bar by
//! bar ([`phrase`]): figures that go on from each other (a motion graph), come back and are
//! answered in a mirror, change with the sections, are as large as the music is loud, and
//! stop in its breaks. [`joined_motion`] places the figures on the song's beats, blends
//! from one to the next and keeps standing feet in their places. Same seed and data: the
//! same numbers.

mod feet;
mod figure;
mod joined_motion;
mod phrase;
mod song_form;

use super::clip_entry::Split;
use super::error::DatasetError;
use super::music;
use super::options::DatasetOptions;
use super::training_file::TrainingClip;
use crate::dataset::index;
use figure::FigureLibrary;
use joined_motion::JoinedMotion;
use phrase::plan;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use servodance_model::conditioning::Encodec;
use servodance_model::motion::{Clip, encode};
use servodance_types::FRAME_RATE_HZ;
use song_form::SongForm;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Length of one dance, seconds.
const CLIP_S: f64 = 60.0;

/// Adds `options.figures` minutes of dances. Figures of a split stay in it: of every 12
/// dances one is for validation and one for test, where those splits have figures.
pub(super) fn collect(
    folder: &Path,
    options: &DatasetOptions,
    encodec: Option<&Encodec>,
    clips: &mut Vec<TrainingClip>,
    on_progress: &(dyn Fn(f64) + Sync),
) -> Result<(), DatasetError> {
    let count = (options.figures * 60.0 / CLIP_S).ceil() as usize;
    if count == 0 {
        return Ok(());
    }
    let entries = index::read(folder)?;
    let libraries = Split::ALL.map(|split| FigureLibrary::cut(folder, &entries, split));
    if libraries[Split::Train as usize].is_empty() {
        return Ok(());
    }
    let done = AtomicUsize::new(0);
    let one = |number: usize| {
        let wanted = match number % 12 {
            5 => Split::Validation,
            11 => Split::Test,
            _ => Split::Train,
        };
        let split = if libraries[wanted as usize].is_empty() { Split::Train } else { wanted };
        let clip = dance(&libraries[split as usize], split, number, options.seed, encodec);
        on_progress(done.fetch_add(1, Ordering::Relaxed) as f64 / count as f64);
        clip
    };
    let made: Vec<Result<TrainingClip, DatasetError>> =
        (0..count).into_par_iter().map(one).collect();
    for clip in made {
        clips.push(clip?);
    }
    Ok(())
}

fn dance(
    library: &FigureLibrary,
    split: Split,
    number: usize,
    seed: u64,
    encodec: Option<&Encodec>,
) -> Result<TrainingClip, DatasetError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003) ^ number as u64);
    let style = library.styles()[number % library.styles().len()];
    let name = format!("figures/{} {number}", super::STYLES[style]);
    let frames = (CLIP_S * FRAME_RATE_HZ) as usize;
    let mut form = SongForm::random(&name, CLIP_S, library.usual_period_s(style), &mut rng)?;
    let mut heard = form.hear(&name, frames)?;
    for _ in 1..music::ATTEMPTS {
        if music::followed(&heard, &form.audible_beats_s()) > music::FOLLOWED {
            break;
        }
        form = SongForm::random(&name, CLIP_S, library.usual_period_s(style), &mut rng)?;
        heard = form.hear(&name, frames)?;
    }
    let steps = plan(library, style, &form, &mut rng);
    let poses = JoinedMotion::of(library, &steps, &form, frames + 1).poses();
    let danced = Clip::of_frames(poses);
    music::add_dynamics(&mut form.song, &danced, 0.0, &mut rng);
    let heard = form.hear(&name, frames)?;
    Ok(TrainingClip {
        latents: music::latents(&name, &form.song, 0, frames, encodec)?,
        name,
        motion: encode(&danced.poses),
        music: Some(heard),
        style,
        split,
        dance: true,
        synthetic: false,
        variant: 1 + rng.random_range(0..2),
    })
}

#[cfg(test)]
mod tests;
