//! How good the generator is: every figure beside its controls, beside real
//! motion, with 95 % intervals over repeats.
//!
//! The reference is the held-out dance of a training file (see [`crate::dataset`]),
//! or, without one, choreography that was never trained on. Minutes of work,
//! on all processors.

mod figures;
mod long;
mod reference;
mod report;
mod texts;

pub use report::{Estimate, Evaluation, LongDance};
pub use texts::{Retrieved, TextFigures};

use crate::metrics::distance_of_dances_m;
use figures::{Features, Scores};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use reference::{HeldOut, Reference, Silence};
use servodance_model::conditioning::HeardFrame;
use servodance_model::motion::mpjpe_m;
use servodance_model::motion::{Clip, Pose};
use servodance_model::engine::EngineOptions;
use servodance_model::{Codec, Generator, GeneratorOptions, ModelError};
use servodance_runtime::conditioning::Conditioning;
use servodance_runtime::dance::open_generator;
use servodance_runtime::generate::open_codec;
use servodance_types::FRAME_RATE_HZ;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is to be evaluated.
#[derive(Clone, Debug)]
pub struct Request {
    /// A training file with held-out dance; choreography if left out.
    pub data: Option<PathBuf>,
    /// Weights, if not the built-in ones.
    pub model: Option<PathBuf>,
    /// Encodec's weights, for a model that hears through it, if they are not in
    /// the user's data folder.
    pub encodec: Option<PathBuf>,
    /// One style for all; that of each clip if left out.
    pub style: Option<String>,
    /// How often everything is danced anew.
    pub repeats: usize,
    /// HumanML3D's folder, to score motions against their texts as well.
    pub texts: Option<PathBuf>,
    /// The folder with the T2M extractors for that, if it is not in the user's
    /// data folder.
    pub extractors: Option<PathBuf>,
    /// Clips of music danced to in each repeat.
    pub clips: usize,
    /// Seconds danced to each.
    pub seconds: f64,
    /// Minutes of one long dance; none if 0.
    pub minutes: usize,
    /// How codes are drawn; its seed and style are not looked at.
    pub sampling: GeneratorOptions,
    /// How the model's steps are computed.
    pub engine: EngineOptions,
    /// Seed of the first repeat.
    pub seed: u64,
}

/// Dances and scores. `on_progress` is told the share that is done.
///
/// # Errors
/// What was asked for that cannot be used; a reference too small to compare with.
pub fn evaluate(request: &Request, on_progress: impl Fn(f64) + Sync) -> anyhow::Result<Evaluation> {
    for (name, value, most) in [
        ("repeats", request.repeats, 1000),
        ("clips", request.clips, 1000),
    ] {
        if !(2..=most).contains(&value) {
            anyhow::bail!("--{name} {value} is outside 2..{most}");
        }
    }
    if !(10.0..=3600.0).contains(&request.seconds) {
        anyhow::bail!("--seconds {} is outside 10..3600", request.seconds);
    }
    if request.minutes > 1000 {
        anyhow::bail!("--minutes {} is outside 0..1000", request.minutes);
    }
    let generator = open_generator(request.model.as_deref(), request.engine)?;
    let conditioning = Conditioning {
        encodec: request.encodec.clone(),
        ..Conditioning::default()
    };
    let encodec = conditioning.encodec(&generator)?;
    generator.start(options(request, 0))?; // an unknown style is told at once
    let Reference { held, real } =
        Reference::open(request, generator.music_kind(), encodec.as_ref())?;
    let frames = (request.seconds * FRAME_RATE_HZ) as usize;
    let silence = Silence::new(encodec.as_ref(), frames)?;
    let codec = open_codec(request.model.as_deref())?;
    // What a user brings is looked at before minutes of work.
    let text = match &request.texts {
        Some(folder) => Some(texts::score(request, folder, &codec, &on_progress)?),
        None => None,
    };
    let codes = codes(&codec, &real, &generator)?;
    let real_windows = Features::of(real.iter().map(Vec::as_slice));
    let repeats = in_parallel(request.repeats, &on_progress, |repeat| {
        one_repeat(
            request,
            &generator,
            (&held, &silence),
            &real_windows,
            repeat,
        )
    })?;
    let long = match request.minutes {
        0 => None,
        minutes => Some(long::long_dance(
            &generator,
            options(request, request.seed),
            &held,
            minutes,
        )?),
    };
    let mut found =
        report::Evaluation::new(request, &codes, &repeats, real.len(), real_windows.len());
    found.long = long;
    found.text = text;
    Ok(found)
}

fn options(request: &Request, seed: u64) -> GeneratorOptions {
    GeneratorOptions {
        seed,
        style: request.style.clone(),
        ..request.sampling.clone()
    }
}

/// What stage 1 makes of the held-out clips.
struct Codes {
    mpjpe_mm: Vec<f64>,
    used: Vec<f64>,
}

fn codes(codec: &Codec, real: &[Vec<Pose>], generator: &Generator) -> anyhow::Result<Codes> {
    let config = generator.config();
    let mut seen = vec![vec![false; config.codes]; config.parts.len()];
    let mut mpjpe_mm = Vec::new();
    for poses in real {
        let original = Clip {
            name: String::new(),
            fps: FRAME_RATE_HZ,
            poses: poses.clone(),
        };
        let codes = codec.encode(&original)?;
        for row in &codes {
            for (seen, code) in seen.iter_mut().zip(row) {
                seen[*code] = true;
            }
        }
        let back = codec.decode("", &codes)?;
        let original = original.normalised().poses;
        let windows = original.chunks(figures::WINDOW_FRAMES);
        let pairs = windows.zip(back.poses.chunks(figures::WINDOW_FRAMES));
        mpjpe_mm.extend(pairs.filter_map(|(a, b)| mpjpe_m(a, b)).map(|m| 1e3 * m));
    }
    let share = |seen: &Vec<bool>| seen.iter().filter(|s| **s).count() as f64 / seen.len() as f64;
    Ok(Codes {
        mpjpe_mm,
        used: seen.iter().map(share).collect(),
    })
}

/// Everything danced once, with its controls.
struct Repeat {
    generated: Scores,
    real: Scores,
    wrong_song: f64,
    shifted: f64,
    silence: f64,
    /// Two dances to one song, metres apart.
    seeds_gap_m: f64,
}

fn one_repeat(
    request: &Request,
    generator: &Generator,
    (held, silence): (&[HeldOut], &Silence),
    real_windows: &Features,
    repeat: usize,
) -> anyhow::Result<Repeat> {
    let seed = request.seed + repeat as u64;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Other clips in every repeat, where there are more than are danced to.
    let mut order: Vec<usize> = (0..held.len()).collect();
    order.shuffle(&mut rng);
    order.truncate(request.clips);
    let (mut danced, mut controls) = (Vec::new(), [const { Vec::new() }; 3]);
    let mut seeds_gap_m = 0.0;
    for (i, &clip) in order.iter().enumerate() {
        let music = &held[clip].music;
        let other = &held[order[(i + 1) % order.len()]];
        let mut options = options(request, seed * 1000 + i as u64);
        if options.style.is_none() && generator.styles().contains(&held[clip].style) {
            options.style = Some(held[clip].style.clone());
        }
        let motion = dance(generator, options.clone(), music)?;
        if i == 0 {
            let mut other_seed = options.clone();
            other_seed.seed += 500;
            let other = dance(generator, other_seed, music)?;
            seeds_gap_m = distance_of_dances_m(&motion, &other).unwrap_or(0.0);
        }
        let deaf = dance(generator, options, &silence.in_place_of(music))?;
        let beats_s = &held[clip].beats_s;
        controls[0].push(figures::f1(&motion, &other.beats_s));
        controls[1].push(figures::f1(&motion, &reference::between(beats_s)));
        controls[2].push(figures::f1(&deaf, beats_s));
        danced.push((motion, beats_s.as_slice()));
    }
    let pairs = |list: &[(Vec<Pose>, &[f64])]| {
        Scores::of(list.iter().map(|(poses, beats)| (poses.as_slice(), *beats)))
    };
    let mut generated = pairs(&danced);
    let chosen = order
        .iter()
        .map(|&c| (held[c].poses.as_slice(), held[c].beats_s.as_slice()));
    let mut real = Scores::of(chosen);
    let windows = Features::of(danced.iter().map(|(poses, _)| poses.as_slice()));
    generated.distances = Some(windows.against(real_windows, real_windows)?);
    let (half, other_half) = real_windows.halves(&mut rng);
    real.distances = Some(half.against(&other_half, real_windows)?);
    let [wrong_song, shifted, silence] = controls.map(|scores| figures::mean(&scores));
    Ok(Repeat {
        generated,
        real,
        wrong_song,
        shifted,
        silence,
        seeds_gap_m,
    })
}

fn dance(
    generator: &Generator,
    options: GeneratorOptions,
    music: &[HeardFrame],
) -> Result<Vec<Pose>, ModelError> {
    let mut dance = generator.start(options)?;
    music
        .iter()
        .map(|frame| Ok(dance.step_heard(frame)?.positions))
        .collect()
}

/// `work(0..count)` on all processors, in order of the numbers.
fn in_parallel<T: Send>(
    count: usize,
    on_progress: &(impl Fn(f64) + Sync),
    work: impl Fn(usize) -> anyhow::Result<T> + Sync,
) -> anyhow::Result<Vec<T>> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let worker = || {
        let mut results = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= count {
                return results;
            }
            results.push((number, work(number)));
            let done = 1 + done.fetch_add(1, Ordering::Relaxed);
            on_progress(done as f64 / count as f64);
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut results = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.min(count))
            .map(|_| scope.spawn(worker))
            .collect();
        let joined = workers.into_iter().map(|worker| {
            worker
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        joined.flatten().collect::<Vec<_>>()
    });
    results.sort_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}
