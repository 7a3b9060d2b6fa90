//! One repeat: everything danced once, with its controls.

use super::figures::{DanceScores, WindowFeatures, beat_alignment, mean};
use super::reference::{self, HeldOutClip, SilentMusic};
use super::request::EvaluationRequest;
use crate::metrics::repetition::distance_of_dances_m;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use servodance_model::conditioning::HeardFrame;
use servodance_model::motion::Pose;
use servodance_model::{Generator, GeneratorOptions, ModelError};

pub(super) struct EvaluationRepeat {
    pub generated: DanceScores,
    pub real: DanceScores,
    pub wrong_song: f64,
    pub shifted: f64,
    pub silence: f64,
    /// Two dances to one song, metres apart.
    pub seeds_gap_m: f64,
}

pub(super) fn one_repeat(
    request: &EvaluationRequest,
    generator: &Generator,
    (held, silence): (&[HeldOutClip], &SilentMusic),
    real_windows: &WindowFeatures,
    repeat: usize,
) -> anyhow::Result<EvaluationRepeat> {
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
        let mut options = request.options(seed * 1000 + i as u64);
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
        controls[0].push(beat_alignment(&motion, &other.beats_s).f1);
        controls[1].push(beat_alignment(&motion, &reference::between(beats_s)).f1);
        controls[2].push(beat_alignment(&deaf, beats_s).f1);
        danced.push((motion, beats_s.as_slice()));
    }
    let pairs = |list: &[(Vec<Pose>, &[f64])]| {
        DanceScores::of(list.iter().map(|(poses, beats)| (poses.as_slice(), *beats)))
    };
    let mut generated = pairs(&danced);
    let chosen = order.iter().map(|&c| (held[c].poses.as_slice(), held[c].beats_s.as_slice()));
    let mut real = DanceScores::of(chosen);
    let windows = WindowFeatures::of(danced.iter().map(|(poses, _)| poses.as_slice()));
    generated.distances = Some(windows.against(real_windows, real_windows)?);
    let (half, other_half) = real_windows.halves(&mut rng);
    real.distances = Some(half.against(&other_half, real_windows)?);
    let [wrong_song, shifted, silence] = controls.map(|scores| mean(&scores));
    Ok(EvaluationRepeat { generated, real, wrong_song, shifted, silence, seeds_gap_m })
}

fn dance(
    generator: &Generator,
    options: GeneratorOptions,
    music: &[HeardFrame],
) -> Result<Vec<Pose>, ModelError> {
    let mut dance = generator.start(options)?;
    music.iter().map(|frame| Ok(dance.step_heard(frame)?.positions)).collect()
}
