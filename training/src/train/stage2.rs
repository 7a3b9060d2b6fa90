//! Training of stage 2: batches, the step, validation, its part of files.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::codebook::Codebook;
use super::data::{Crop, Crops, Data, Norm};
use super::error::TrainError;
use super::layers::{Dropout, Maker};
use super::motionseq::{Inputs, MotionSeq};
use super::nll::{IGNORED, nll};
use super::parameters::Parameters;
use super::settings::{ClipWeights, Settings};
use super::tape::{Batch, Buffers, Tape};
use super::tensors::{Numbers, Tensors, read};
use super::tokens::{ClipCodes, corrupt, corruption, neighbours, shaken, tokenise, veil};
use super::trainer::{Named, Outcome, Stage};
use crate::motion::index::{STYLES, Split};
use servodance_model::motion::representation::{CONTACTS_AT, POSE_DIM, STEPS_AT};
use servodance_model::config::ModelConfig;
use servodance_model::vqvae::VqEncoder;
use servodance_model::weights::Weights;

/// Sequences that are validated on, and the seed that draws them.
const HELD_SEQUENCES: usize = 32;
const HELD_SEED: u64 = 7;
/// Beginnings kept for each style, and how far from a clip's ends they are.
const STARTS: usize = 24;
const AROUND_FRAMES: usize = 60;

/// The weights of stage 1 that stage 2 builds on.
#[derive(Clone, Debug)]
pub struct StageOne {
    config: ModelConfig,
    encoder: VqEncoder,
    tensors: Tensors,
}

impl StageOne {
    /// From a weights file with encoders.
    pub fn open(bytes: &[u8], source: &str) -> Result<Self, TrainError> {
        let weights = Weights::open(bytes, source)?;
        let encoder = VqEncoder::load(&weights)?;
        let tensors = read(bytes, &["vq.", "norm.motion_"])
            .map_err(|e| TrainError::Settings(format!("{source}: {e}")))?;
        Ok(Self {
            config: weights.config().clone(),
            encoder,
            tensors,
        })
    }

    fn floats(&self, name: &str) -> Result<&[f32], TrainError> {
        match self.tensors.get(name) {
            Some((_, Numbers::F32(values))) => Ok(values),
            _ => Err(TrainError::Settings(format!(
                "stage 1 lacks the tensor `{name}`"
            ))),
        }
    }
}

/// Stage 2 and what it learns from.
pub(crate) struct SeqStage {
    settings: Settings,
    data: Data,
    codes: ClipCodes,
    near: Vec<Vec<Vec<u32>>>,
    crops: Crops,
    held: Option<Crops>,
    pub(crate) parameters: Parameters,
    pub(crate) net: MotionSeq,
    norm: Norm,
    stage_one: Tensors,
    starts: (Vec<i32>, Vec<i32>),
    buffers: Buffers,
}

/// What is shown, and the codes to be found: per part [rows].
pub(crate) struct SeqBatch {
    pub inputs: Inputs,
    pub targets: Vec<Vec<u32>>,
}

impl SeqStage {
    pub fn new(
        mut settings: Settings,
        data: Data,
        stage_one: StageOne,
        rng: &mut ChaCha8Rng,
    ) -> Result<(Self, Settings), TrainError> {
        // Codes and parts are those of stage 1.
        settings.model = ModelConfig {
            seq: settings.model.seq.clone(),
            preset: settings.model.preset.clone(),
            music: settings.model.music,
            music_dim: settings.model.music_dim,
            ..stage_one.config.clone()
        };
        data.check_music(settings.model.music)?;
        let [mean, std] =
            ["mean", "std"].map(|name| stage_one.floats(&format!("norm.motion_{name}")));
        let codes = tokenise(&stage_one.encoder, &data, mean?, std?)?;
        let mut near = Vec::new();
        for part in &settings.model.parts {
            let embed = stage_one.floats(&format!("vq.codebook.{part}"))?.to_vec();
            near.push(neighbours(&Codebook::new(embed, settings.model.code_dim)));
        }
        let clips: Vec<usize> = data.of_split(Split::Train).collect();
        let shown = data.shown(&clips, &settings.clips);
        let (run, end) = (&settings.run, usize::from(settings.model.seq.eos));
        let lengths = [run.min_length + 1, run.length + 1];
        let crops = Crops::new(&data, &clips, &shown, lengths, end)
            .ok_or_else(|| TrainError::Settings("no clip to train with has 2 frames".into()))?;
        let mut parameters = Parameters::default();
        let mut make = Maker {
            parameters: &mut parameters,
            rng,
        };
        let net = MotionSeq::new(&mut make, &settings.model);
        let stage = Self {
            held: held(&data, [run.length + 1; 2], end),
            norm: data.music_norm(settings.model.music),
            starts: starts(&data, &codes),
            stage_one: stage_one.tensors,
            buffers: Buffers::default(),
            settings: settings.clone(),
            net,
            parameters,
            data,
            codes,
            near,
            crops,
        };
        Ok((stage, settings))
    }

    /// The crops as they are: no noise, music and style as known.
    fn plain(&self, crops: &[Crop]) -> SeqBatch {
        let (length, parts) = (self.settings.run.length, self.codes[0].len());
        let end = self.settings.model.codes as u32;
        let kind = self.settings.model.music;
        let mut batch = SeqBatch {
            inputs: Inputs {
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
                match clip.heard(kind, frame.min(last)) {
                    Some(row) => inputs.music.extend(self.norm.music(kind, row)),
                    None => inputs.music.extend(std::iter::repeat_n(0.0, kind.dim())),
                }
            }
            inputs.has_music.push(clip.music.is_some());
            inputs.styles.push(clip.style as u32);
        }
        batch
    }

    /// A batch to learn from: past, music and style withheld or spoilt as the
    /// settings say.
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
                [
                    tokens.music_drop,
                    tokens.style_drop,
                    tokens.shake,
                    tokens.veil,
                ]
                .map(&mut happens)
            })
            .collect();
        for (s, (crop, [no_music, no_style, shake, hide])) in crops.iter().zip(dropped).enumerate()
        {
            inputs.has_music[s] &= !no_music;
            if no_style {
                inputs.styles[s] = self.settings.model.seq.styles.len() as u32;
            }
            let rows = s * run.length..(s + 1) * run.length;
            let kind = self.settings.model.music;
            let music = rows.start * kind.dim()..rows.end * kind.dim();
            veil(kind, &mut inputs.music[music], hide, rng);
            if inputs.has_music[s] && shake {
                let frames = crop.frames.start..crop.frames.start + run.length;
                let shaken = shaken(frames, self.data.clips[crop.clip].motion.len(), rng);
                for (part, codes) in self.codes[crop.clip].iter().enumerate() {
                    let past = inputs.previous[part][rows.clone()].iter_mut();
                    past.zip(&shaken)
                        .for_each(|(code, frame)| *code = codes[*frame]);
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

    /// Loss and gradients of one batch.
    pub(crate) fn learn(&mut self, batch: &SeqBatch, rng: &mut ChaCha8Rng) -> Outcome {
        let mut t = Tape::new(&self.parameters, std::mem::take(&mut self.buffers));
        let rate = self.settings.run.dropout;
        let logits = self
            .net
            .logits(&mut t, &batch.inputs, &mut Dropout { rate, rng });
        let (mut terms, mut seeds) = (vec![("loss".to_owned(), 0.0)], Vec::new());
        let parts = self
            .settings
            .model
            .parts
            .iter()
            .zip(logits.iter().zip(&batch.targets));
        for (part, (value, targets)) in parts {
            let (loss, gradient) = nll(t.data(*value), targets, self.settings.tokens.smoothing);
            terms[0].1 += loss;
            terms.push((format!("nll_{part}"), loss));
            seeds.push((*value, gradient));
        }
        let (gradients, buffers) = t.backward(seeds);
        self.buffers = buffers;
        Outcome { terms, gradients }
    }

    /// Likelihood and share of codes guessed right, per part.
    fn score(&mut self, batch: &SeqBatch, rng: &mut ChaCha8Rng) -> Vec<(f64, f64)> {
        let mut t = Tape::new(&self.parameters, std::mem::take(&mut self.buffers));
        let logits = self
            .net
            .logits(&mut t, &batch.inputs, &mut Dropout { rate: 0.0, rng });
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

/// Share of targets that have the largest logit.
fn right(logits: &[f32], targets: &[u32]) -> f64 {
    let classes = logits.len() / targets.len();
    let largest = |row: &[f32]| {
        (0..classes)
            .rev()
            .max_by(|a, b| row[*a].total_cmp(&row[*b]))
    };
    let rows = logits
        .chunks(classes)
        .zip(targets)
        .filter(|(_, t)| **t != IGNORED);
    let (mut hits, mut all) = (0.0, 0.0);
    for (row, target) in rows {
        hits += f64::from(u8::from(largest(row) == Some(*target as usize)));
        all += 1.0;
    }
    hits / f64::max(all, 1.0)
}

/// Held-out clips with music, all alike.
fn held(data: &Data, lengths: [usize; 2], end: usize) -> Option<Crops> {
    let mut clips: Vec<usize> = data
        .of_split(Split::Validation)
        .filter(|c| data.clips[*c].music.is_some())
        .collect();
    clips.truncate(48);
    let shown = data.shown(
        &clips,
        &ClipWeights {
            other: 1.0,
            synthetic: 1.0,
            silent: 1.0,
            balance: 0.0,
        },
    );
    Crops::new(data, &clips, &shown, lengths, end)
}

/// Codes to begin a dance from, and their styles: moments in the middle of the
/// dance (with music where there is some), not faster than half of it.
fn starts(data: &Data, codes: &ClipCodes) -> (Vec<i32>, Vec<i32>) {
    let (mut rows, mut styles) = (Vec::new(), Vec::new());
    for style in 0..STYLES.len() {
        let of_style: Vec<usize> = data
            .of_split(Split::Train)
            .filter(|c| data.clips[*c].style == style)
            .collect();
        let heard = |c: &&usize| data.clips[**c].music.is_some();
        let with_music: Vec<usize> = of_style.iter().filter(heard).copied().collect();
        let clips = if with_music.is_empty() {
            of_style
        } else {
            with_music
        };
        let mut moments: Vec<(f32, usize, usize)> = Vec::new();
        for c in clips {
            let motion = &data.clips[c].motion;
            // Short clips are taken whole.
            let around = if motion.len() > 2 * AROUND_FRAMES {
                AROUND_FRAMES
            } else {
                0
            };
            let frames = around..motion.len() - around;
            moments.extend(frames.map(|f| (mean_speed(&motion[f]), c, f)));
        }
        moments.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (low, high) = (3 * moments.len() / 10, (moments.len() / 2).max(1));
        let Some(middle) = moments.get(low..high).filter(|middle| !middle.is_empty()) else {
            continue;
        };
        for i in 0..STARTS {
            let (_, clip, frame) = middle[i * (middle.len() - 1) / (STARTS - 1)];
            rows.extend(codes[clip].iter().map(|part| part[frame] as i32));
            styles.push(style as i32);
        }
    }
    (rows, styles)
}

/// Mean of the joints' steps.
fn mean_speed(row: &[f32; POSE_DIM]) -> f32 {
    let steps = row[STEPS_AT..CONTACTS_AT].chunks(3);
    steps
        .map(|s| s.iter().map(|v| v * v).sum::<f32>().sqrt())
        .sum()
}

impl Stage for SeqStage {
    fn parameters(&mut self) -> &mut Parameters {
        &mut self.parameters
    }

    fn step(&mut self, _: u64, rng: &mut ChaCha8Rng) -> Outcome {
        let batch = self.draw(rng);
        self.learn(&batch, rng)
    }

    /// Likelihood of held-out clips with their music, with another clip's and
    /// with none: what the music is worth.
    fn validate(&mut self, rng: &mut ChaCha8Rng) -> Option<Named> {
        let held = self.held.as_ref()?;
        let crops = held.draw(HELD_SEQUENCES, &mut ChaCha8Rng::seed_from_u64(HELD_SEED));
        let mut batch = self.plain(&crops);
        let scores = self.score(&batch, rng);
        let sum = |scores: &[(f64, f64)]| scores.iter().map(|s| s.0).sum::<f64>();
        let mut row = vec![("val_nll".to_owned(), sum(&scores))];
        for (part, score) in self.settings.model.parts.iter().zip(&scores) {
            row.push((format!("acc_{part}"), score.1));
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
        let mut tensors = self.stage_one.clone();
        for (name, values) in [("mean", &self.norm.mean), ("std", &self.norm.std)] {
            let numbers = Numbers::F32(values.clone());
            tensors.insert(format!("norm.music_{name}"), (vec![values.len()], numbers));
        }
        let (codes, styles) = &self.starts;
        let rows = styles.len();
        let parts = self.settings.model.parts.len();
        tensors.insert(
            "start.codes".into(),
            (vec![rows, parts], Numbers::I32(codes.clone())),
        );
        tensors.insert(
            "start.styles".into(),
            (vec![rows, 1], Numbers::I32(styles.clone())),
        );
        tensors
    }

    fn default_style(&self) -> usize {
        self.data.usual_style()
    }
}
