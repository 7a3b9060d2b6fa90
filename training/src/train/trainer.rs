//! A training run: steps, lines of the curves, checkpoints, weights.
//!
//! What is random in a step follows from the seed and the step's number alone,
//! and checkpoints hold everything else: a run that was stopped and went on has
//! the same bytes as one that was not. Files are the caller's; this makes their
//! bytes.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::checkpoint;
use super::curve_tally::CurveTally;
use super::data::TrainingData;
use super::error::TrainError;
use super::network_training::{NamedValues, NetworkTraining};
use super::optimizer::{AdamSettings, AdamW, learning_rate};
use super::settings::{TrainedNetwork, TrainingSettings};
use crate::train::motionseq::training::MotionSeqTraining;
use crate::train::vqvae::training::VqVaeTraining;
use crate::train::vqvae::vqvae_weights::VqVaeWeights;

/// Loss and learning rate of one step.
#[derive(Clone, Debug)]
pub struct StepReport {
    /// Steps taken, this one among them.
    pub step: u64,
    /// The learning rate of this step.
    pub learning_rate: f64,
    /// Terms of the loss; the first is the loss.
    pub terms: NamedValues,
}

/// One line of the curves, with what the trainer concludes from it.
#[derive(Clone, Debug)]
pub struct CurveRow {
    /// Steps taken when the row was made.
    pub step: u64,
    /// Means since the line before, then scores on held-out clips.
    pub values: NamedValues,
    /// Whether no line before had a better score.
    pub best: bool,
    /// Whether the scores have not improved for as long as the settings allow.
    pub stale: bool,
}

/// A run that can be taken step by step.
pub struct Trainer {
    settings: TrainingSettings,
    data_sha256: String,
    /// Of the VQ-VAE's weights that the run was given.
    vqvae_sha256: Option<String>,
    pub(super) training: Box<dyn NetworkTraining>,
    adam: AdamW,
    step: u64,
    tally: CurveTally,
}

impl Trainer {
    /// A run before its first step. MotionSeq needs the weights of a VQ-VAE; a VQ-VAE begins with
    /// them, or with random ones.
    pub fn new(
        mut settings: TrainingSettings,
        data: TrainingData,
        vqvae_weights: Option<VqVaeWeights>,
    ) -> Result<Self, TrainError> {
        settings.model.seq.styles = data.styles();
        if let Some(weights) = &vqvae_weights {
            settings = weights.with_own_sizes(settings);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let data_sha256 = data.sha256.clone();
        let vqvae_sha256 = vqvae_weights.as_ref().map(|weights| weights.sha256.clone());
        let of_run = settings.clone();
        let mut training: Box<dyn NetworkTraining> = match (settings.network, vqvae_weights) {
            (TrainedNetwork::VqVae, start) => {
                Box::new(VqVaeTraining::new(of_run, data, start.as_ref(), &mut rng)?)
            }
            (TrainedNetwork::MotionSeq, Some(weights)) => {
                Box::new(MotionSeqTraining::new(of_run, data, weights, &mut rng)?)
            }
            (TrainedNetwork::MotionSeq, None) => {
                return Err(TrainError::Settings("stage 2 needs the weights of stage 1".into()));
            }
        };
        Ok(Self {
            adam: AdamW::new(training.parameters()),
            tally: CurveTally { sums: Vec::new(), count: 0, best: f64::INFINITY, since_best: 0 },
            step: 0,
            settings,
            data_sha256,
            vqvae_sha256,
            training,
        })
    }

    /// The settings of the run, with everything filled in.
    pub fn settings(&self) -> &TrainingSettings {
        &self.settings
    }

    /// Steps taken so far, over all starts.
    pub fn steps_taken(&self) -> u64 {
        self.step
    }

    /// Whether the next line of the curves is due.
    pub fn curve_row_is_due(&self) -> bool {
        self.step.is_multiple_of(self.settings.run.report) || self.step == self.settings.run.steps
    }

    fn rng(&self, purpose: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.settings.seed);
        rng.set_stream(2 * self.step + purpose + 1);
        rng
    }

    /// Takes the next step. Fails where the loss is not finite, parameters as before.
    pub fn step(&mut self) -> Result<StepReport, TrainError> {
        let run = &self.settings.run;
        let rate = learning_rate(run.learning_rate, self.step, run.warm_up, run.steps);
        let adam =
            AdamSettings { betas: [0.9, 0.98], weight_decay: run.weight_decay, clip: run.clip };
        let mut outcome = self.training.step(self.step, &mut self.rng(0));
        let parameters = self.training.parameters();
        let norm = self.adam.step(parameters, &outcome.gradients, rate as f32, &adam);
        if !norm.is_finite() || !outcome.terms[0].1.is_finite() {
            return Err(TrainError::Diverged { step: self.step });
        }
        self.step += 1;
        outcome.terms.push(("gradient".into(), norm));
        self.tally.add(&outcome.terms);
        Ok(StepReport { step: self.step, learning_rate: rate, terms: outcome.terms })
    }

    /// The line that is due: means since the last one, and scores on held-out clips.
    pub fn curve_row(&mut self) -> CurveRow {
        let run = &self.settings.run;
        let rate =
            learning_rate(run.learning_rate, self.step.saturating_sub(1), run.warm_up, run.steps);
        let mut values = vec![("learning_rate".to_owned(), rate)];
        values.extend(self.tally.take_means());
        let mut rng = self.rng(1);
        let scores = self.training.validate(&mut rng);
        let score = scores.as_ref().and_then(|row| row.first()).map(|(_, score)| *score);
        // Without held-out clips the last weights are the best.
        let best = score.is_none_or(|score| score < self.tally.best);
        match score {
            Some(score) if score < self.tally.best => {
                (self.tally.best, self.tally.since_best) = (score, 0)
            }
            Some(score) if score.is_finite() => self.tally.since_best += 1,
            _ => {}
        }
        values.extend(scores.unwrap_or_default());
        let patience = self.settings.run.patience;
        CurveRow {
            step: self.step,
            values,
            best,
            stale: patience > 0 && self.tally.since_best >= patience,
        }
    }

    /// Everything that is needed to go on, as the bytes of a file.
    pub fn checkpoint(&mut self) -> Vec<u8> {
        let fingerprint = self.fingerprint();
        let state = self.training.state();
        let parameters = self.training.parameters();
        checkpoint::write(&fingerprint, parameters, &self.adam, self.step, &self.tally, state)
    }

    /// Goes on from a checkpoint. Fails on a torn one, or with the first setting that differs.
    pub fn resume(&mut self, bytes: &[u8]) -> Result<(), TrainError> {
        let fingerprint = self.fingerprint();
        let parameters = self.training.parameters();
        let read = checkpoint::read(bytes, &fingerprint, parameters)?;
        self.training.restore(&read.state).map_err(TrainError::Checkpoint)?;
        for (parameter, values) in self.training.parameters().iter_mut().zip(read.parameters) {
            parameter.values = values;
        }
        self.adam = read.adam;
        self.step = read.step;
        self.tally = read.tally;
        Ok(())
    }

    fn fingerprint(&self) -> serde_json::Value {
        let mut value = serde_json::json!(self.settings);
        value["data_sha256"] = self.data_sha256.clone().into();
        if let Some(sha256) = &self.vqvae_sha256 {
            value["stage_one_sha256"] = sha256.clone().into();
        }
        value
    }

    /// The weights file for `servodance_model::weights`; of the VQ-VAE without MotionSeq's part.
    pub fn weights(&mut self) -> Vec<u8> {
        let mut tensors = self.training.weights();
        let style = self.settings.model.seq.styles[self.training.default_style()].clone();
        let steps = format!(
            "{}_steps",
            if self.settings.network == TrainedNetwork::VqVae { "vq" } else { "seq" }
        );
        let mut provenance = serde_json::json!({
            "data_sha256": self.data_sha256, "seed": self.settings.seed, "trained by": "servodance train",
        });
        provenance[steps] = self.step.into();
        if let Some(sha256) = &self.vqvae_sha256 {
            provenance["stage_one_sha256"] = sha256.clone().into();
        }
        checkpoint::insert(&mut tensors, self.training.parameters());
        checkpoint::weights_file(&self.settings.model, &style, &provenance, &tensors)
    }
}
