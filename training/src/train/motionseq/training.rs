//! Training of MotionSeq: batches, the step, validation, its part of files.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::network::{MotionSeqInputs, MotionSeqNetwork};
use super::nll::{IGNORED, nll};
use super::start_codes::starts;
use super::tokens::{
    ClipCodes, corrupt, corruption, drop_features, jittered, neighbours, tokenise,
};
use crate::dataset::clip_entry::Split;
use crate::train::autodiff::parameters::Parameters;
use crate::train::autodiff::tape::{Batch, BufferPool, Tape};
use crate::train::crops::{Crop, Crops};
use crate::train::data::{Normalisation, TrainingData};
use crate::train::error::TrainError;
use crate::train::layers::{Dropout, ParamBuilder};
use crate::train::network_training::{BatchOutcome, NamedValues, NetworkTraining};
use crate::train::settings::{ClipWeights, TrainingSettings};
use crate::train::tensors::{Numbers, Tensors};
use crate::train::vqvae::codebook::LearnedCodebook;
use crate::train::vqvae::vqvae_weights::VqVaeWeights;
use servodance_model::motion::representation::POSE_DIM;

/// Sequences that are validated on, and the seed that draws them.
const HELD_SEQUENCES: usize = 32;
const HELD_SEED: u64 = 7;
pub(crate) struct MotionSeqTraining {
    settings: TrainingSettings,
    data: TrainingData,
    codes: ClipCodes,
    near: Vec<Vec<Vec<u32>>>,
    crops: Crops,
    held: Option<Crops>,
    pub(crate) parameters: Parameters,
    pub(crate) net: MotionSeqNetwork,
    norm: Normalisation,
    vqvae_weights: Tensors,
    starts: (Vec<i32>, Vec<i32>),
    buffers: BufferPool,
}

/// What is shown, and the codes to be found: per code of a frame [rows].
pub(crate) struct SeqBatch {
    pub inputs: MotionSeqInputs,
    pub targets: Vec<Vec<u32>>,
}

impl MotionSeqTraining {
    pub fn new(
        settings: TrainingSettings,
        data: TrainingData,
        vqvae_weights: VqVaeWeights,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, TrainError> {
        data.check_music(settings.model.music)?;
        let [mean, std] =
            ["mean", "std"].map(|it| vqvae_weights.floats(&format!("norm.motion_{it}"), POSE_DIM));
        let codes = tokenise(&vqvae_weights.encoder, &data, &mean?, &std?)?;
        let mut near = Vec::new();
        for name in settings.model.code_names() {
            let count = settings.model.codes * settings.model.code_dim;
            let embed = vqvae_weights.floats(&format!("vq.codebook.{name}"), count)?;
            near.push(neighbours(&LearnedCodebook::new(embed, settings.model.code_dim)));
        }
        let clips: Vec<usize> = data.of_split(Split::Train).collect();
        let shown = data.sampling_weights(&clips, &settings.clips);
        let (run, end) = (&settings.run, usize::from(settings.model.seq.eos));
        let lengths = [run.min_length + 1, run.length + 1];
        let crops = Crops::new(&data, &clips, &shown, lengths, end)
            .ok_or_else(|| TrainError::Settings("no clip to train with has 2 frames".into()))?;
        let mut parameters = Parameters::default();
        let mut make = ParamBuilder { parameters: &mut parameters, rng };
        let net = MotionSeqNetwork::new(&mut make, &settings.model);
        Ok(Self {
            held: held(&data, [run.length + 1; 2], end),
            norm: data.music_norm(settings.model.music),
            starts: starts(&data, &codes),
            vqvae_weights: vqvae_weights.tensors,
            buffers: BufferPool::default(),
            settings,
            net,
            parameters,
            data,
            codes,
            near,
            crops,
        })
    }

    /// The crops as they are: no noise, music and style as known.
    fn plain(&self, crops: &[Crop]) -> SeqBatch {
        let (length, parts) = (self.settings.run.length, self.codes[0].len());
        let end = self.settings.model.codes as u32;
        let kind = self.settings.model.music;
        let mut batch = SeqBatch {
            inputs: MotionSeqInputs {
                batch: Batch {
                    length,
                    lengths: crops.iter().map(|crop| crop.frames.len() - 1).collect(),
                },
                previous: vec![Vec::new(); parts],
                chosen: vec![Vec::new(); parts],
                music: Vec::new(),
                has_music: Vec::new(),
                styles: Vec::new(),
            },
            targets: vec![Vec::new(); parts],
        };
        for crop in crops {
            let clip = &self.data.clips[crop.clip];
            let inputs = &mut batch.inputs;
            let last = clip.motion.len() - 1;
            for i in 0..length {
                let (frame, real) = (crop.frames.start + i + 1, i + 1 < crop.frames.len());
                for (part, codes) in self.codes[crop.clip].iter().enumerate() {
                    inputs.previous[part].push(codes[(frame - 1).min(last)]);
                    inputs.chosen[part].push(codes[frame.min(last)]);
                    batch.targets[part].push(match (real, frame > last) {
                        (true, false) => codes[frame],
                        // The sequence ends: the first part says so.
                        (true, true) if part == 0 => end,
                        _ => IGNORED,
                    });
                }
                match clip.music_row(kind, frame.min(last)) {
                    Some(row) => inputs.music.extend(self.norm.music(kind, row)),
                    None => inputs.music.extend(std::iter::repeat_n(0.0, kind.dim())),
                }
            }
            inputs.has_music.push(clip.music.is_some());
            inputs.styles.push(clip.style as u32);
        }
        batch
    }

    /// A batch to learn from: past, music and style withheld or spoilt as the settings say.
    pub(crate) fn draw(&self, rng: &mut ChaCha8Rng) -> SeqBatch {
        let (run, tokens) = (&self.settings.run, &self.settings.tokens);
        let crops = self.crops.draw(run.batch, rng);
        let mut batch = self.plain(&crops);
        let inputs = &mut batch.inputs;
        let truth = inputs.previous.clone();
        let mut happens = |share: f32| rng.random::<f32>() < share;
        let dropped: Vec<[bool; 4]> = crops
            .iter()
            .map(|_| {
                [tokens.music_drop, tokens.style_drop, tokens.beat_jitter, tokens.feature_dropout]
                    .map(&mut happens)
            })
            .collect();
        for (s, (crop, [no_music, no_style, beat_jitter, hide])) in
            crops.iter().zip(dropped).enumerate()
        {
            inputs.has_music[s] &= !no_music;
            if no_style {
                inputs.styles[s] = self.settings.model.seq.styles.len() as u32;
            }
            let rows = s * run.length..(s + 1) * run.length;
            let kind = self.settings.model.music;
            let music = rows.start * kind.dim()..rows.end * kind.dim();
            drop_features(kind, &mut inputs.music[music], hide, rng);
            if inputs.has_music[s] && beat_jitter {
                let frames = crop.frames.start..crop.frames.start + run.length;
                let jittered = jittered(frames, self.data.clips[crop.clip].motion.len(), rng);
                for (part, codes) in self.codes[crop.clip].iter().enumerate() {
                    let past = inputs.previous[part][rows.clone()].iter_mut();
                    past.zip(&jittered).for_each(|(code, frame)| *code = codes[*frame]);
                }
            }
            let rate = corruption(tokens.noise, rng);
            for (part, elsewhere) in truth.iter().enumerate() {
                let past = &mut inputs.previous[part][rows.clone()];
                corrupt(past, rate, &self.near[part], elsewhere, rng);
            }
        }
        batch
    }

    pub(crate) fn learn(&mut self, batch: &SeqBatch, rng: &mut ChaCha8Rng) -> BatchOutcome {
        let mut t = Tape::new(&self.parameters, std::mem::take(&mut self.buffers));
        let rate = self.settings.run.dropout;
        let logits = self.net.logits(&mut t, &batch.inputs, &mut Dropout { rate, rng });
        let (mut terms, mut seeds) = (vec![("loss".to_owned(), 0.0)], Vec::new());
        let names = self.settings.model.code_names();
        for (name, (value, targets)) in names.iter().zip(logits.iter().zip(&batch.targets)) {
            let (loss, gradient) = nll(t.data(*value), targets, self.settings.tokens.smoothing);
            terms[0].1 += loss;
            terms.push((format!("nll_{name}"), loss));
            seeds.push((*value, gradient));
        }
        let (gradients, buffers) = t.backward(seeds);
        self.buffers = buffers;
        BatchOutcome { terms, gradients }
    }

    /// Likelihood and share of codes guessed right, per code of a frame.
    fn score(&mut self, batch: &SeqBatch, rng: &mut ChaCha8Rng) -> Vec<(f64, f64)> {
        let mut t = Tape::new(&self.parameters, std::mem::take(&mut self.buffers));
        let logits = self.net.logits(&mut t, &batch.inputs, &mut Dropout { rate: 0.0, rng });
        let scores = logits.iter().zip(&batch.targets).map(|(value, targets)| {
            let logits = t.data(*value);
            let right = right(logits, targets);
            (nll(logits, targets, 0.0).0, right)
        });
        let scores = scores.collect();
        self.buffers = t.end();
        scores
    }
}

fn right(logits: &[f32], targets: &[u32]) -> f64 {
    let classes = logits.len() / targets.len();
    let largest = |row: &[f32]| (0..classes).rev().max_by(|a, b| row[*a].total_cmp(&row[*b]));
    let rows = logits.chunks(classes).zip(targets).filter(|(_, t)| **t != IGNORED);
    let (mut hits, mut all) = (0.0, 0.0);
    for (row, target) in rows {
        hits += f64::from(u8::from(largest(row) == Some(*target as usize)));
        all += 1.0;
    }
    hits / f64::max(all, 1.0)
}

fn held(data: &TrainingData, lengths: [usize; 2], end: usize) -> Option<Crops> {
    let mut clips: Vec<usize> =
        data.of_split(Split::Validation).filter(|c| data.clips[*c].music.is_some()).collect();
    clips.truncate(48);
    let shown = data.sampling_weights(
        &clips,
        &ClipWeights { other: 1.0, synthetic: 1.0, silent: 1.0, balance: 0.0 },
    );
    Crops::new(data, &clips, &shown, lengths, end)
}

impl NetworkTraining for MotionSeqTraining {
    fn parameters(&mut self) -> &mut Parameters {
        &mut self.parameters
    }

    fn step(&mut self, _: u64, rng: &mut ChaCha8Rng) -> BatchOutcome {
        let batch = self.draw(rng);
        self.learn(&batch, rng)
    }

    /// With their music, with another clip's and with none: what the music is worth.
    fn validate(&mut self, rng: &mut ChaCha8Rng) -> Option<NamedValues> {
        let held = self.held.as_ref()?;
        let crops = held.draw(HELD_SEQUENCES, &mut ChaCha8Rng::seed_from_u64(HELD_SEED));
        let mut batch = self.plain(&crops);
        let scores = self.score(&batch, rng);
        let sum = |scores: &[(f64, f64)]| scores.iter().map(|s| s.0).sum::<f64>();
        let mut row = vec![("val_nll".to_owned(), sum(&scores))];
        for (name, score) in self.settings.model.code_names().iter().zip(&scores) {
            row.push((format!("acc_{name}"), score.1));
        }
        let of_sequence = self.settings.run.length * self.settings.model.music_dim;
        batch.inputs.music.rotate_right(of_sequence);
        row.push(("wrong_nll".into(), sum(&self.score(&batch, rng))));
        batch.inputs.has_music.fill(false);
        row.push(("silent_nll".into(), sum(&self.score(&batch, rng))));
        Some(row)
    }

    fn state(&self) -> Tensors {
        self.weights()
    }

    fn restore(&mut self, _: &Tensors) -> Result<(), String> {
        Ok(())
    }

    fn weights(&self) -> Tensors {
        let mut tensors = self.vqvae_weights.clone();
        for (name, values) in [("mean", &self.norm.mean), ("std", &self.norm.std)] {
            let numbers = Numbers::F32(values.clone());
            tensors.insert(format!("norm.music_{name}"), (vec![values.len()], numbers));
        }
        let (codes, styles) = &self.starts;
        let rows = styles.len();
        let wide = self.settings.model.codes_a_frame();
        tensors.insert("start.codes".into(), (vec![rows, wide], Numbers::I32(codes.clone())));
        tensors.insert("start.styles".into(), (vec![rows, 1], Numbers::I32(styles.clone())));
        tensors
    }

    fn default_style(&self) -> usize {
        self.data.most_common_style()
    }
}
