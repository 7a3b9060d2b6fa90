//! Training of the VQ-VAE: batches, the step, validation, its part of files.

use rand_chacha::ChaCha8Rng;

use super::codebook::{LearnedCodebook, usage};
use super::loss::{MotionLoss, MotionLossTerms, displacements, joints};
use super::network::VqVaeNetwork;
use super::residual_codebooks::ResidualCodebooks;
use super::vqvae_weights::VqVaeWeights;
use crate::dataset::clip_entry::Split;
use crate::train::autodiff::parameters::Parameters;
use crate::train::autodiff::tape::{Batch, BufferPool, Tape, Var};
use crate::train::crops::Crops;
use crate::train::data::{Normalisation, TrainingData};
use crate::train::error::TrainError;
use crate::train::layers::{Dropout, ParamBuilder};
use crate::train::network_training::{BatchOutcome, NamedValues, NetworkTraining};
use crate::train::settings::TrainingSettings;
use crate::train::tensors::{Numbers, Tensors, floats};
use servodance_model::config::{CodePlace, ModelConfig};
use servodance_model::motion::representation::POSE_DIM;
use servodance_model::weights::ENCODERS;

const K_MEANS_BATCHES: usize = 12;
/// Clips that are validated on, and frames of each.
const HELD_CLIPS: usize = 24;
const HELD_FRAMES: usize = 800;
/// What is validated, before the usage of each codebook.
const VALIDATED: [&str; 3] = ["val_loss", "val_mpjpe_mm", "val_move_mm"];

pub(crate) struct VqVaeTraining {
    settings: TrainingSettings,
    data: TrainingData,
    crops: Crops,
    held: Vec<usize>,
    pub(crate) parameters: Parameters,
    pub(crate) net: VqVaeNetwork,
    /// Of each part.
    pub(crate) books: Vec<ResidualCodebooks>,
    pub(crate) ready: bool,
    pub(crate) loss: MotionLoss,
    buffers: BufferPool,
}

pub(crate) struct MotionBatch {
    /// Motion as it is, [rows, 137]; padding repeats the last frame.
    pub real: Vec<f32>,
    pub batch: Batch,
}

impl VqVaeTraining {
    pub fn new(
        settings: TrainingSettings,
        data: TrainingData,
        start: Option<&VqVaeWeights>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, TrainError> {
        let clips: Vec<usize> = data.of_split(Split::Train).collect();
        let shown = data.sampling_weights(&clips, &settings.clips);
        let lengths = [settings.run.min_length, settings.run.length];
        let crops = Crops::new(&data, &clips, &shown, lengths, 0)
            .ok_or_else(|| TrainError::Settings("no clip to train with has 2 frames".into()))?;
        let Normalisation { mean, std } = data.motion_norm();
        let mut parameters = Parameters::default();
        let mut make = ParamBuilder { parameters: &mut parameters, rng };
        let net = VqVaeNetwork::new(&mut make, &settings.model).map_err(TrainError::Settings)?;
        net.begin_with_positions(&mut parameters);
        let config = &settings.model;
        let mut training = Self {
            books: (0..config.parts.len())
                .map(|part| ResidualCodebooks::random(config, part, rng))
                .collect(),
            held: held(&data),
            loss: MotionLoss::new(mean, std, settings.loss),
            parameters,
            net,
            ready: false,
            buffers: BufferPool::default(),
            settings,
            data,
            crops,
        };
        let fixed = training.settings.codebook.fixed;
        match start {
            Some(weights) => training.start_from(weights)?,
            None if fixed => {
                let message = "codebook.fixed needs the weights that hold the codes: stage_one";
                return Err(TrainError::Settings(message.into()));
            }
            None => (),
        }
        Ok(training)
    }

    /// Begins with trained weights: their networks, codes and normalisation.
    fn start_from(&mut self, weights: &VqVaeWeights) -> Result<(), TrainError> {
        for parameter in self.parameters.iter_mut() {
            parameter.values = weights.floats(&parameter.name, parameter.values.len())?;
            // Without a gradient, weight decay is all that would move them.
            let learns = !self.settings.codebook.fixed || !parameter.name.starts_with(ENCODERS);
            parameter.decays &= learns;
        }
        let run = &self.settings.run;
        let rows_of_a_code = (run.batch * run.length) as f32 / self.settings.model.codes as f32;
        for (name, book) in named_books(&self.settings.model, &mut self.books) {
            let embed = weights.floats(&format!("vq.codebook.{name}"), book.embed.len())?;
            *book = LearnedCodebook::with_counts(embed, book.dim(), rows_of_a_code);
        }
        let norm = |name| weights.floats(name, POSE_DIM);
        let (mean, std) = (norm("norm.motion_mean")?, norm("norm.motion_std")?);
        self.loss = MotionLoss::new(mean, std, self.loss.weights);
        self.ready = true;
        Ok(())
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> MotionBatch {
        let length = self.settings.run.length;
        let crops = self.crops.draw(self.settings.run.batch, rng);
        let mut real = Vec::with_capacity(crops.len() * length * POSE_DIM);
        for crop in &crops {
            let motion = &self.data.clips[crop.clip].motion;
            let rows =
                (0..length).map(|i| motion[(crop.frames.start + i).min(crop.frames.end - 1)]);
            rows.for_each(|row| real.extend_from_slice(&row));
        }
        let lengths = crops.iter().map(|crop| crop.frames.len()).collect();
        MotionBatch { real, batch: Batch { length, lengths } }
    }

    fn initialise_codebooks(&mut self, rng: &mut ChaCha8Rng) {
        let mut rows = vec![Vec::new(); self.books.len()];
        for _ in 0..K_MEANS_BATCHES {
            let MotionBatch { real, batch } = self.draw(rng);
            let mut t = Tape::new(&self.parameters, std::mem::take(&mut self.buffers));
            let mut drop = Dropout { rate: 0.0, rng };
            let latents = self.net.latents(&mut t, &self.loss.normalised(&real), &batch, &mut drop);
            for (rows, latent) in rows.iter_mut().zip(latents) {
                rows.extend(real_rows(&t, latent, &batch));
            }
            self.buffers = t.end();
        }
        for (books, rows) in self.books.iter_mut().zip(rows) {
            books.k_means(rows, self.settings.codebook.k_means_rounds, rng);
        }
        self.ready = true;
    }

    /// Loss and gradients of one batch; moves the codes.
    pub(crate) fn learn(
        &mut self,
        MotionBatch { real, batch }: &MotionBatch,
        with_codes: bool,
        rng: &mut ChaCha8Rng,
    ) -> BatchOutcome {
        let mut t = Tape::new(&self.parameters, std::mem::take(&mut self.buffers));
        let rate = self.settings.run.dropout;
        let fixed = self.settings.codebook.fixed || !self.net.has_encoders();
        let mut drop = Dropout { rate: if fixed { 0.0 } else { rate }, rng };
        let normalised = self.loss.normalised(real);
        let latents = self.net.latents(&mut t, &normalised, batch, &mut drop);
        drop.rate = rate;
        let mut seeds = Vec::new();
        let (mut commit, mut used) = (0.0, Vec::new());
        let codes = match with_codes {
            false => t.beside(&latents),
            true => {
                let mut chosen = Vec::new();
                for (books, latent) in self.books.iter_mut().zip(&latents) {
                    let rows: Vec<f32> = real_rows(&t, *latent, batch).collect();
                    let found = books.quantise(&rows, &self.settings, drop.rng);
                    commit += found.commit;
                    used.extend(found.used);
                    if !fixed {
                        let nothing = vec![0.0; t.data(*latent).len()];
                        seeds.push((*latent, placed(&found.gradient, nothing, batch)));
                    }
                    // Padding keeps its latents.
                    chosen.push(placed(&found.vectors, t.data(*latent).to_vec(), batch));
                }
                let wide = self.books.iter().map(ResidualCodebooks::dim).collect::<Vec<_>>();
                let codes = side_by_side(&chosen, &wide);
                match fixed {
                    true => t.constant(codes, wide.iter().sum()),
                    false => t.straight_through(&latents, codes),
                }
            }
        };
        let out = self.net.decode(&mut t, codes, batch, &mut drop);
        let (terms, gradient) = self.loss.evaluate(t.data(out), real, batch);
        seeds.push((out, gradient));
        let (gradients, buffers) = t.backward(seeds);
        self.buffers = buffers;
        let loss =
            terms.weighted(&self.loss.weights) + f64::from(self.loss.weights.commit) * commit;
        let mut named = vec![
            ("loss".into(), loss),
            ("huber".into(), terms.huber),
            ("position".into(), terms.position),
            ("velocity".into(), terms.velocity),
            ("jerk".into(), terms.jerk),
            ("commit".into(), commit),
        ];
        let share = used.iter().sum::<f64>() / used.len().max(1) as f64;
        named.push(("codes_used".into(), share));
        BatchOutcome { terms: named, gradients }
    }

    fn usage_names(&self) -> impl Iterator<Item = String> + use<> {
        let names = |code: String| [format!("{code}_used"), format!("{code}_perplexity")];
        self.settings.model.code_names().into_iter().flat_map(names)
    }

    /// Codes of every part, [part][level][row].
    fn encode(
        &self,
        t: &mut Tape,
        real: &[f32],
        batch: &Batch,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Vec<Vec<u32>>> {
        let mut drop = Dropout { rate: 0.0, rng };
        let latents = self.net.latents(t, &self.loss.normalised(real), batch, &mut drop);
        let books = self.books.iter().zip(latents);
        books.map(|(book, latent)| book.nearest(t.data(latent))).collect()
    }
}

/// Names of all codebooks: part by part, of each all levels.
fn names_of_books(config: &ModelConfig) -> impl Iterator<Item = String> {
    let of_part = |part| (0..config.levels_of(part)).map(move |level| CodePlace { part, level });
    let places = (0..config.parts.len()).flat_map(of_part);
    places.map(|place| config.code_name(place))
}

fn named_books<'a>(
    config: &ModelConfig,
    books: &'a mut [ResidualCodebooks],
) -> impl Iterator<Item = (String, &'a mut LearnedCodebook)> {
    names_of_books(config).zip(books.iter_mut().flat_map(|books| &mut books.0))
}

/// Real rows in their places among the padding.
fn placed(rows: &[f32], mut among: Vec<f32>, batch: &Batch) -> Vec<f32> {
    let wide = among.len() / batch.rows();
    for (row, values) in batch.real_rows().zip(rows.chunks(wide)) {
        among[row * wide..(row + 1) * wide].copy_from_slice(values);
    }
    among
}

/// The rows of a value that are no padding.
fn real_rows<'a>(t: &'a Tape, value: Var, batch: &'a Batch) -> impl Iterator<Item = f32> + 'a {
    let (data, wide) = (t.data(value), t.columns(value));
    let row = move |r: usize| data[r * wide..(r + 1) * wide].iter().copied();
    batch.real_rows().flat_map(row)
}

pub(crate) fn side_by_side(parts: &[Vec<f32>], wide: &[usize]) -> Vec<f32> {
    let rows = parts[0].len() / wide[0];
    let mut out = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    for row in 0..rows {
        for (part, wide) in parts.iter().zip(wide) {
            out.extend_from_slice(&part[row * wide..][..*wide]);
        }
    }
    out
}

/// Held-out clips: captured dance as it was danced, where there is some.
fn held(data: &TrainingData) -> Vec<usize> {
    let all: Vec<usize> =
        data.of_split(Split::Validation).filter(|c| data.clips[*c].motion.len() > 2).collect();
    let danced = |c: &&usize| {
        let clip = &data.clips[**c];
        clip.dance && clip.variant == 0 && !clip.synthetic
    };
    let best: Vec<usize> = all.iter().filter(danced).copied().collect();
    let mut held = if best.is_empty() { all } else { best };
    held.truncate(HELD_CLIPS);
    held
}

impl NetworkTraining for VqVaeTraining {
    fn parameters(&mut self) -> &mut Parameters {
        &mut self.parameters
    }

    fn step(&mut self, step: u64, rng: &mut ChaCha8Rng) -> BatchOutcome {
        // Without an encoder there is nothing to wait for.
        let free = self.net.has_encoders() && step < self.settings.quantise.free_steps;
        let quantise = self.ready || !free;
        if quantise && !self.ready {
            self.initialise_codebooks(rng);
        }
        let batch = self.draw(rng);
        self.learn(&batch, quantise, rng)
    }

    fn validate(&mut self, rng: &mut ChaCha8Rng) -> Option<NamedValues> {
        if self.held.is_empty() {
            return None;
        }
        if !self.ready {
            // Nothing to say before there are codes, in the same columns.
            let names = VALIDATED.map(str::to_owned).into_iter().chain(self.usage_names());
            return Some(names.map(|name| (name, f64::NAN)).collect());
        }
        let mut sum = MotionLossTerms::default();
        let (mut frames, mut pairs) = (0.0, 0.0);
        let (mut apart_mm, mut moved_mm) = (0.0, 0.0);
        let mut codes = vec![Vec::new(); self.settings.model.codes_a_frame()];
        for clip in &self.held {
            let motion = &self.data.clips[*clip].motion;
            let real = motion[..motion.len().min(HELD_FRAMES)].as_flattened();
            let batch = Batch::full(1, real.len() / POSE_DIM);
            let mut t = Tape::new(&self.parameters, std::mem::take(&mut self.buffers));
            let found = self.encode(&mut t, real, &batch, rng);
            let of_part = self.books.iter().zip(&found).map(|(books, codes)| books.vectors(codes));
            let wide: Vec<usize> = self.books.iter().map(ResidualCodebooks::dim).collect();
            let vectors = side_by_side(&of_part.collect::<Vec<_>>(), &wide);
            let vectors = t.constant(vectors, wide.iter().sum());
            let mut drop = Dropout { rate: 0.0, rng };
            let out = self.net.decode(&mut t, vectors, &batch, &mut drop);
            let (terms, _) = self.loss.evaluate(t.data(out), real, &batch);
            let restored = self.loss.restored(t.data(out));
            self.buffers = t.end();
            let weight = batch.length as f64;
            sum.add(&terms, weight);
            frames += weight;
            for (a, b) in restored.chunks(POSE_DIM).zip(real.chunks(POSE_DIM)) {
                apart_mm += 1e3 * mean_apart(&joints(a), &joints(b));
            }
            for (a, b) in displacements(&restored).iter().zip(&displacements(real)) {
                moved_mm += 1e3 * mean_apart(a, b);
                pairs += 1.0;
            }
            for (all, place) in codes.iter_mut().zip(self.settings.model.code_places()) {
                all.extend(&found[place.part][place.level]);
            }
        }
        let mean = MotionLossTerms {
            huber: sum.huber / frames,
            position: sum.position / frames,
            velocity: sum.velocity / frames,
            jerk: sum.jerk / frames,
        };
        let errors =
            [mean.weighted(&self.loss.weights), apart_mm / frames, moved_mm / f64::max(pairs, 1.0)];
        let total = self.settings.model.codes;
        let usages = codes.iter().flat_map(|codes| <[f64; 2]>::from(usage(codes, total)));
        let names = VALIDATED.map(str::to_owned).into_iter().chain(self.usage_names());
        Some(names.zip(errors.into_iter().chain(usages)).collect())
    }

    fn state(&self) -> Tensors {
        let mut tensors = self.weights();
        let config = &self.settings.model;
        for (code, book) in names_of_books(config).zip(self.books.iter().flat_map(|b| &b.0)) {
            let shape = vec![config.codes, config.code_dim];
            let name = |what: &str| format!("state.{what}.{code}");
            tensors.insert(name("embed_avg"), (shape, Numbers::F32(book.embed_avg.clone())));
            let sizes = Numbers::F32(book.cluster_size.clone());
            tensors.insert(name("cluster_size"), (vec![config.codes], sizes));
        }
        let ready = Numbers::I32(vec![i32::from(self.ready)]);
        tensors.insert("state.ready".into(), (vec![1], ready));
        tensors
    }

    fn restore(&mut self, tensors: &Tensors) -> Result<(), String> {
        for (code, book) in named_books(&self.settings.model, &mut self.books) {
            book.embed = floats(tensors, &format!("vq.codebook.{code}"), book.embed.len())?;
            let name = |what: &str| format!("state.{what}.{code}");
            book.embed_avg = floats(tensors, &name("embed_avg"), book.embed_avg.len())?;
            book.cluster_size = floats(tensors, &name("cluster_size"), book.cluster_size.len())?;
        }
        self.ready = match tensors.get("state.ready") {
            Some((_, Numbers::I32(ready))) => ready.first() == Some(&1),
            _ => return Err("tensor `state.ready` is missing".into()),
        };
        Ok(())
    }

    fn weights(&self) -> Tensors {
        let config = &self.settings.model;
        let mut tensors = Tensors::new();
        for (code, book) in names_of_books(config).zip(self.books.iter().flat_map(|b| &b.0)) {
            let shape = vec![config.codes, config.code_dim];
            let embed = Numbers::F32(book.embed.clone());
            tensors.insert(format!("vq.codebook.{code}"), (shape, embed));
        }
        for (name, values) in [("mean", &self.loss.mean), ("std", &self.loss.std)] {
            let numbers = Numbers::F32(values.clone());
            tensors.insert(format!("norm.motion_{name}"), (vec![POSE_DIM], numbers));
        }
        tensors
    }

    fn default_style(&self) -> usize {
        self.data.most_common_style()
    }
}

/// Mean distance of 22 points.
fn mean_apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let distance = |(a, b): (&[f32; 3], &[f32; 3])| {
        let square = |k: usize| f64::from(a[k] - b[k]).powi(2);
        (square(0) + square(1) + square(2)).sqrt()
    };
    a.iter().zip(b).map(distance).sum::<f64>() / a.len() as f64
}
