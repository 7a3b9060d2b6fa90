//! How good the generator is: every figure beside its controls, beside real
//! motion, with 95 % intervals over repeats.
//!
//! The reference is the held-out dance of a training file (see [`crate::dataset`]),
//! or, without one, choreography that was never trained on. Minutes of work,
//! on all processors.

mod blind;
mod estimate;
mod figures;
mod long;
mod parallel;
mod reconstruction;
mod reference;
mod repeat;
mod report;
mod request;
mod songs;
mod texts;

pub use blind::{VoteScores, score_votes, write_blind};
pub(crate) use estimate::MeanEstimate;
pub use report::Evaluation;
pub use request::EvaluationRequest;
pub use songs::{SongArgs, SongEvaluation, evaluate_songs, write_sheets};

use figures::WindowFeatures;
use parallel::in_parallel;
use reference::{EvaluationReference, SilentMusic};
use repeat::one_repeat;
use servodance_runtime::offline::generate::open_codec;
use servodance_runtime::pipeline::conditioning::Conditioning;
use servodance_runtime::session::dance::open_generator;
use servodance_types::FRAME_RATE_HZ;

/// Dances and scores. `on_progress` receives the share that is done, 0 to 1. Fails on a request
/// that cannot be used, or a reference too small to compare with.
pub fn evaluate(
    request: &EvaluationRequest,
    on_progress: impl Fn(f64) + Sync,
) -> anyhow::Result<Evaluation> {
    let seconds = request.seconds_of_clips();
    let generator = open_generator(request.model.as_deref(), request.engine)?;
    let conditioning = Conditioning { encodec: request.encodec.clone(), ..Conditioning::default() };
    let encodec = conditioning.encodec(&generator)?;
    generator.start(request.options(0))?; // an unknown style fails before the work
    let EvaluationReference { held, real } =
        EvaluationReference::open(request, generator.music_kind(), encodec.as_ref())?;
    let frames = (seconds * FRAME_RATE_HZ) as usize;
    let silence = SilentMusic::new(encodec.as_ref(), frames)?;
    let codec = open_codec(request.model.as_deref())?;
    // What a user brings is looked at before minutes of work.
    let text = match &request.texts {
        Some(folder) => Some(texts::score(request, folder, &codec, &on_progress)?),
        None => None,
    };
    let codes = reconstruction::codes(&codec, &real, &generator)?;
    let real_windows = WindowFeatures::of(real.iter().map(Vec::as_slice));
    let repeats = in_parallel(request.repeats, &on_progress, |repeat| {
        one_repeat(request, &generator, (&held, &silence), &real_windows, repeat)
    })?;
    let long = match request.minutes {
        0 => None,
        minutes => {
            Some(long::long_dance(&generator, request.options(request.seed), &held, minutes)?)
        }
    };
    let mut found =
        report::Evaluation::new(request, &codes, &repeats, real.len(), real_windows.len());
    found.long = long;
    found.text = text;
    Ok(found)
}
