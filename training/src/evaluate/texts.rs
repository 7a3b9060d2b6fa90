//! How well motions match their texts, before and after the VQ-VAE: R-Precision
//! and MM-Dist on HumanML3D's test set, as the MAGMA paper scores its VQ-VAE
//! (Table 1), with extractors that a user brings.
//!
//! Every repeat pools the pairs anew, 32 at a time, with one of each motion's
//! texts. Beside the figures stand those of the real motions, which bound them,
//! and those of real motions with another's text, which are chance.

use super::estimate::{MeanEstimate, cell};
use super::parallel::in_parallel;
use super::request::EvaluationRequest;
use crate::dataset::index::stays_inside;
use crate::metrics::retrieval::{POOL, Retrieval, retrieval};
use crate::metrics::t2m::{Extractors, FRAMES_A_STEP, MOST_FRAMES};
use crate::motion::humanml::{HumanMlVector, encode, read_vectors, recover};
use anyhow::{Context, ensure};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{SeedableRng, rngs::StdRng};
use serde::Serialize;
use servodance_model::Codec;
use servodance_model::motion::Clip;
use servodance_runtime::pipeline::conditioning::data_folder;
use servodance_types::FRAME_RATE_HZ;
use std::fmt::Write;
use std::path::Path;

/// Frames of the motions that are scored, as T2M's own evaluation.
const FRAMES: std::ops::Range<usize> = 40..200;
/// Motions that go through the extractors at once.
const BATCH: usize = 32;

/// R-Precision and MM-Dist; mean and interval over repeats.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct RetrievalEstimates {
    /// Share of texts whose motion is the nearest of 32.
    pub(crate) r_precision_1: MeanEstimate,
    pub(crate) r_precision_2: MeanEstimate,
    pub(crate) r_precision_3: MeanEstimate,
    pub(crate) mm_dist: MeanEstimate,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct TextFigures {
    pub(crate) pairs: usize,
    /// Motions of the test set that are missing, cannot be read, or are too short or long.
    pub(crate) left_out: usize,
    pub(crate) reconstructed: RetrievalEstimates,
    pub(crate) real: RetrievalEstimates,
    /// The same with the text of another motion: chance.
    pub(crate) other_text: RetrievalEstimates,
}

impl TextFigures {
    pub fn table(&self) -> String {
        let mut text = format!(
            "{} motions and their texts ({} left out)\n{:<36}{:>18}{:>20}{:>20}\n",
            self.pairs, self.left_out, "", "reconstructed", "real", "another's text"
        );
        type RetrievalRow = (&'static str, fn(&RetrievalEstimates) -> MeanEstimate);
        let rows: [RetrievalRow; 4] = [
            ("R-Precision, top 1", |r| r.r_precision_1),
            ("R-Precision, top 2", |r| r.r_precision_2),
            ("R-Precision, top 3", |r| r.r_precision_3),
            ("MM-Dist", |r| r.mm_dist),
        ];
        for (name, figure) in rows {
            let [a, b, c] =
                [&self.reconstructed, &self.real, &self.other_text].map(|r| cell(figure(r)));
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{name:<36}{a:>18}{b:>20}{c:>20}");
        }
        text
    }
}

impl RetrievalEstimates {
    fn over(repeats: &[Retrieval]) -> Self {
        let over = |value: &dyn Fn(&Retrieval) -> f64| {
            MeanEstimate::of(&repeats.iter().map(value).collect::<Vec<_>>())
        };
        Self {
            r_precision_1: over(&|r| r.r_precision[0]),
            r_precision_2: over(&|r| r.r_precision[1]),
            r_precision_3: over(&|r| r.r_precision[2]),
            mm_dist: over(&|r| r.mm_dist),
        }
    }
}

/// A motion and its texts as tokens `word/KIND`.
struct MotionTextPair {
    motion: Vec<HumanMlVector>,
    texts: Vec<Vec<String>>,
}

struct PairPoints {
    real: Vec<f32>,
    reconstructed: Vec<f32>,
    texts: Vec<Vec<f32>>,
}

/// Scores the test set in HumanML3D's folder. Fails on extractors or texts that are not there
/// or of another layout; fewer pairs than one pool.
pub fn score(
    request: &EvaluationRequest,
    folder: &Path,
    codec: &Codec,
    on_progress: &(impl Fn(f64) + Sync),
) -> anyhow::Result<TextFigures> {
    let extractors = open_extractors(request.extractors.as_deref())?;
    let (pairs, left_out) = pairs(folder)?;
    ensure!(
        pairs.len() >= POOL,
        "--texts: {} has {} motions with texts in its test set, at least {POOL} are needed",
        folder.display(),
        pairs.len()
    );
    let batches: Vec<&[MotionTextPair]> = pairs.chunks(BATCH).collect();
    let points = in_parallel(batches.len(), on_progress, |number| {
        points(batches[number], &extractors, codec)
    })?;
    let points: Vec<PairPoints> = points.into_iter().flatten().collect();
    let mut found = [const { Vec::new() }; 3];
    for repeat in 0..request.repeats as u64 {
        let mut rng = StdRng::seed_from_u64(request.seed + repeat);
        for (found, one) in found.iter_mut().zip(score_pools(&points, &mut rng)) {
            found.extend(one);
        }
    }
    let [reconstructed, real, other_text] = found.map(|repeats| RetrievalEstimates::over(&repeats));
    Ok(TextFigures { pairs: points.len(), left_out, reconstructed, real, other_text })
}

/// Pooled once: reconstructed, real, real with another's text.
fn score_pools(points: &[PairPoints], rng: &mut StdRng) -> [Option<Retrieval>; 3] {
    let mut order: Vec<&PairPoints> = points.iter().collect();
    order.shuffle(rng);
    let text = |p: &&'_ PairPoints| p.texts.choose(rng).map_or(&[][..], Vec::as_slice).to_vec();
    let texts: Vec<Vec<f32>> = order.iter().map(text).collect();
    let mut texts: Vec<&[f32]> = texts.iter().map(Vec::as_slice).collect();
    let reconstructed: Vec<&[f32]> = order.iter().map(|p| p.reconstructed.as_slice()).collect();
    let real: Vec<&[f32]> = order.iter().map(|p| p.real.as_slice()).collect();
    let [first, second] = [reconstructed, real.clone()].map(|motions| retrieval(&texts, &motions));
    texts.rotate_left(1);
    [first, second, retrieval(&texts, &real)]
}

/// The T2M extractors in a folder, or in the user's data folder.
fn open_extractors(folder: Option<&Path>) -> anyhow::Result<Extractors> {
    let folder = match folder {
        Some(folder) => folder.to_owned(),
        None => data_folder()?.join("t2m"),
    };
    Extractors::load(&folder).context(
        "--extractors: a folder with model.safetensors and words.json is needed, as \
         model/reference/convert_t2m.py writes it (docs/metrics.md)",
    )
}

fn points(
    pairs: &[MotionTextPair],
    extractors: &Extractors,
    codec: &Codec,
) -> anyhow::Result<Vec<PairPoints>> {
    let reconstructed: Vec<Vec<HumanMlVector>> = pairs
        .iter()
        .map(|pair| through_the_codes(&pair.motion, codec))
        .collect::<anyhow::Result<_>>()?;
    let real: Vec<&[HumanMlVector]> = pairs.iter().map(|pair| pair.motion.as_slice()).collect();
    let reconstructed: Vec<&[HumanMlVector]> = reconstructed.iter().map(Vec::as_slice).collect();
    let mut points = Vec::with_capacity(pairs.len());
    let motions = extractors.motions(&real)?.into_iter();
    for ((pair, real), reconstructed) in
        (pairs.iter().zip(motions)).zip(extractors.motions(&reconstructed)?)
    {
        let tokens: Vec<Vec<&str>> =
            (pair.texts.iter()).map(|text| text.iter().map(String::as_str).collect()).collect();
        let views: Vec<&[&str]> = tokens.iter().map(Vec::as_slice).collect();
        points.push(PairPoints { real, reconstructed, texts: extractors.texts(&views)? });
    }
    Ok(points)
}

/// HumanML3D's vectors of what the VQ-VAE makes of a motion.
fn through_the_codes(
    motion: &[HumanMlVector],
    codec: &Codec,
) -> anyhow::Result<Vec<HumanMlVector>> {
    let clip = Clip::of_frames(recover(motion));
    let back = codec.decode("", &codec.encode(&clip)?)?;
    Ok(encode(&back.poses))
}

/// The pairs of `test.txt`, and how many motions were left out.
fn pairs(folder: &Path) -> anyhow::Result<(Vec<MotionTextPair>, usize)> {
    let list = folder.join("test.txt");
    let names = std::fs::read_to_string(&list).with_context(|| {
        format!(
            "--texts: cannot read {}: HumanML3D's folder is needed, with test.txt, texts and \
             new_joint_vecs in it",
            list.display()
        )
    })?;
    let (mut pairs, mut left_out) = (Vec::new(), 0);
    for name in names.lines().map(str::trim).filter(|name| !name.is_empty()) {
        ensure!(stays_inside(name), "{}: `{name}` leads out of the folder", list.display());
        let motion = read_vectors(&folder.join("new_joint_vecs").join(format!("{name}.npy")));
        let texts = std::fs::read_to_string(folder.join("texts").join(format!("{name}.txt")));
        let before = pairs.len();
        if let (Ok(motion), Ok(texts)) = (motion, texts) {
            pairs.extend(parts(&motion, &texts));
        }
        left_out += usize::from(pairs.len() == before);
    }
    Ok((pairs, left_out))
}

/// Parts of a motion that have texts of their own are pairs of their own.
fn parts(motion: &[HumanMlVector], texts: &str) -> Vec<MotionTextPair> {
    let mut whole = Vec::new();
    let mut pairs = Vec::new();
    for line in texts.lines() {
        // caption # word/KIND word/KIND # from second # to second
        let fields: Vec<&str> = line.trim().split('#').collect();
        let [_, tokens, from, to] = fields[..] else {
            continue;
        };
        let tokens: Vec<String> = tokens.split_whitespace().map(str::to_owned).collect();
        let [from, to] = [from, to].map(|s| s.trim().parse::<f64>().unwrap_or(0.0));
        if from > 0.0 || to > 0.0 {
            let [from, to] = [from, to].map(|s| (s * FRAME_RATE_HZ) as usize);
            let part = motion.get(from..to.min(motion.len()));
            pairs.extend(part.and_then(|part| pair(part, vec![tokens])));
        } else {
            whole.push(tokens);
        }
    }
    pairs.extend(pair(motion, whole));
    pairs
}

fn pair(motion: &[HumanMlVector], texts: Vec<Vec<String>>) -> Option<MotionTextPair> {
    let frames = motion.len().min(MOST_FRAMES) / FRAMES_A_STEP * FRAMES_A_STEP;
    (FRAMES.contains(&motion.len()) && !texts.is_empty())
        .then(|| MotionTextPair { motion: motion[..frames].to_vec(), texts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::humanml::HUMANML_DIM;

    #[test]
    fn texts_of_a_part_make_a_pair_of_their_own() {
        let motion = vec![[0.0; HUMANML_DIM]; 150];
        let texts = "a man walks#a/DET man/NOUN walk/VERB#0.0#0.0\n\
                     he stops#he/PRON stop/VERB#1.0#4.0\n\
                     too short#short/ADJ#1.0#1.5\n\
                     he turns#he/PRON turn/VERB#nan#nan\nnot a line\n";
        let pairs = parts(&motion, texts);
        let seen: Vec<(usize, usize)> =
            pairs.iter().map(|p| (p.motion.len(), p.texts.len())).collect();
        assert_eq!(seen, [(60, 1), (148, 2)]);
        assert_eq!(pairs[0].texts[0], ["he/PRON", "stop/VERB"]);
        assert!(parts(&motion[..39], texts).is_empty());
        assert!(parts(&vec![[0.0; HUMANML_DIM]; 200], "a#a/DET#0.0#0.0").is_empty());
    }
}
