//! A training run: steps, lines of the curves, checkpoints, weights.
//!
//! What is random in a step follows from the seed and the step's number alone,
//! and checkpoints hold everything else: a run that was stopped and went on has
//! the same bytes as one that was not. Files are the caller's; this makes their
//! bytes.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::checkpoint;
use super::data::Data;
use super::error::TrainError;
use super::optimizer::{AdamSettings, AdamW, learning_rate};
use super::parameters::{ParameterGradients, Parameters};
use super::settings::{Settings, StageKind};
use super::stage1::VqStage;
use super::stage2::{SeqStage, StageOne};
use super::tensors::Tensors;

/// Numbers with names, in order; the first is to be made small.
pub type Named = Vec<(String, f64)>;

/// What a batch taught.
pub(crate) struct Outcome {
    /// Terms of the loss; the first is the loss.
    pub terms: Named,
    pub gradients: ParameterGradients,
}

/// What differs between the stages.
pub(crate) trait Stage {
    fn parameters(&mut self) -> &mut Parameters;
    /// Loss and gradients of the batch of a step.
    fn step(&mut self, step: u64, rng: &mut ChaCha8Rng) -> Outcome;
    /// Scores on held-out clips; none where none are held out.
    fn validate(&mut self, rng: &mut ChaCha8Rng) -> Option<Named>;
    /// What a checkpoint holds beside parameters and optimiser.
    fn state(&self) -> Tensors;
    fn restore(&mut self, tensors: &Tensors) -> Result<(), String>;
    /// What a weights file holds beside parameters.
    fn weights(&self) -> Tensors;
    fn default_style(&self) -> usize;
}

/// What one step did.
#[derive(Clone, Debug)]
pub struct StepReport {
    /// Steps taken so far.
    pub step: u64,
    /// Learning rate of this step.
    pub learning_rate: f64,
    /// Terms of the loss; the first is the loss.
    pub terms: Named,
}

/// One line of the curves.
#[derive(Clone, Debug)]
pub struct CurveRow {
    /// Steps taken so far.
    pub step: u64,
    /// Means since the line before, then scores on held-out clips.
    pub values: Named,
    /// Whether no line before had a better score.
    pub best: bool,
    /// Whether the scores have not improved for as long as the settings allow.
    pub stale: bool,
}

/// What is remembered from line to line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tally {
    /// Sums since the last line, by column.
    pub sums: Named,
    pub count: u64,
    /// The best score so far, and how many lines ago it was.
    pub best: f64,
    pub since_best: u64,
}

/// A run that can be taken step by step.
pub struct Trainer {
    settings: Settings,
    data_sha256: String,
    stage: Box<dyn Stage>,
    adam: AdamW,
    step: u64,
    tally: Tally,
    /// Parameters and weights of the best line.
    styles: Vec<String>,
}

impl Trainer {
    /// A run before its first step. Stage 2 needs the weights of stage 1.
    pub fn new(
        settings: Settings,
        data: Data,
        stage_one: Option<StageOne>,
    ) -> Result<Self, TrainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let data_sha256 = data.sha256.clone();
        let (mut stage, settings): (Box<dyn Stage>, Settings) = match (settings.stage, stage_one) {
            (StageKind::VqVae, _) => (
                Box::new(VqStage::new(settings.clone(), data, &mut rng)?),
                settings,
            ),
            (StageKind::MotionSeq, Some(stage_one)) => {
                let (stage, settings) = SeqStage::new(settings, data, stage_one, &mut rng)?;
                (Box::new(stage), settings)
            }
            (StageKind::MotionSeq, None) => {
                return Err(TrainError::Settings(
                    "stage 2 needs the weights of stage 1".into(),
                ));
            }
        };
        Ok(Self {
            adam: AdamW::new(stage.parameters()),
            styles: settings.model.seq.styles.clone(),
            tally: Tally {
                sums: Vec::new(),
                count: 0,
                best: f64::INFINITY,
                since_best: 0,
            },
            step: 0,
            settings,
            data_sha256,
            stage,
        })
    }

    /// What the run is asked for.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Steps taken so far.
    pub fn steps_taken(&self) -> u64 {
        self.step
    }

    /// Numbers that are learned.
    pub fn parameter_count(&mut self) -> usize {
        self.stage.parameters().iter().map(|p| p.values.len()).sum()
    }

    /// Whether the next line of the curves is due.
    pub fn line_is_due(&self) -> bool {
        self.step.is_multiple_of(self.settings.run.report) || self.step == self.settings.run.steps
    }

    fn rng(&self, purpose: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.settings.seed);
        rng.set_stream(2 * self.step + purpose + 1);
        rng
    }

    /// The next step.
    ///
    /// # Errors
    /// When the loss is not finite; the parameters are as before.
    pub fn step(&mut self) -> Result<StepReport, TrainError> {
        let run = &self.settings.run;
        let rate = learning_rate(run.learning_rate, self.step, run.warm_up, run.steps);
        let adam = AdamSettings {
            betas: [0.9, 0.98],
            weight_decay: run.weight_decay,
            clip: run.clip,
        };
        let mut outcome = self.stage.step(self.step, &mut self.rng(0));
        let parameters = self.stage.parameters();
        let norm = self
            .adam
            .step(parameters, &outcome.gradients, rate as f32, &adam);
        if !norm.is_finite() || !outcome.terms[0].1.is_finite() {
            return Err(TrainError::Diverged { step: self.step });
        }
        self.step += 1;
        outcome.terms.push(("gradient".into(), norm));
        self.tally.add(&outcome.terms);
        Ok(StepReport {
            step: self.step,
            learning_rate: rate,
            terms: outcome.terms,
        })
    }

    /// The line of the curves that is due: means since the last one, and scores
    /// on held-out clips.
    pub fn line(&mut self) -> CurveRow {
        let run = &self.settings.run;
        let rate = learning_rate(
            run.learning_rate,
            self.step.saturating_sub(1),
            run.warm_up,
            run.steps,
        );
        let mut values = vec![("learning_rate".to_owned(), rate)];
        values.extend(self.tally.take_means());
        let mut rng = self.rng(1);
        let scores = self.stage.validate(&mut rng);
        let score = scores
            .as_ref()
            .and_then(|row| row.first())
            .map(|(_, score)| *score);
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

    #[cfg(test)]
    pub(crate) fn stage_mut(&mut self) -> &mut dyn Stage {
        &mut *self.stage
    }

    /// Everything that is needed to go on, as the bytes of a file.
    pub fn checkpoint(&mut self) -> Vec<u8> {
        let fingerprint = self.fingerprint();
        let state = self.stage.state();
        let parameters = self.stage.parameters();
        checkpoint::write(
            &fingerprint,
            parameters,
            &self.adam,
            self.step,
            &self.tally,
            state,
        )
    }

    /// Goes on from a checkpoint of the same run.
    ///
    /// # Errors
    /// When it is not whole, or of another run: then the first setting that
    /// differs is named.
    pub fn resume(&mut self, bytes: &[u8]) -> Result<(), TrainError> {
        let fingerprint = self.fingerprint();
        let parameters = self.stage.parameters();
        let read = checkpoint::read(bytes, &fingerprint, parameters)?;
        self.stage
            .restore(&read.state)
            .map_err(TrainError::Checkpoint)?;
        for (parameter, values) in self.stage.parameters().iter_mut().zip(read.parameters) {
            parameter.values = values;
        }
        self.adam = read.adam;
        self.step = read.step;
        self.tally = read.tally;
        Ok(())
    }

    /// What the numbers follow from.
    fn fingerprint(&self) -> serde_json::Value {
        let mut value = serde_json::json!(self.settings);
        value["data_sha256"] = self.data_sha256.clone().into();
        value
    }

    /// The weights file of what was learned so far, which `servodance_model::weights` loads:
    /// that of stage 1 lacks what belongs to stage 2.
    pub fn weights(&mut self) -> Vec<u8> {
        let mut tensors = self.stage.weights();
        let style = self.styles[self.stage.default_style()].clone();
        let steps = format!(
            "{}_steps",
            if self.settings.stage == StageKind::VqVae {
                "vq"
            } else {
                "seq"
            }
        );
        let mut provenance = serde_json::json!({
            "data_sha256": self.data_sha256, "seed": self.settings.seed, "trained by": "servodance train",
        });
        provenance[steps] = self.step.into();
        checkpoint::insert(&mut tensors, self.stage.parameters());
        checkpoint::weights_file(&self.settings.model, &style, &provenance, &tensors)
    }
}

impl Tally {
    fn add(&mut self, terms: &Named) {
        if self.sums.len() != terms.len() {
            self.sums = terms.iter().map(|(name, _)| (name.clone(), 0.0)).collect();
            self.count = 0;
        }
        for (sum, (_, value)) in self.sums.iter_mut().zip(terms) {
            sum.1 += value;
        }
        self.count += 1;
    }

    fn take_means(&mut self) -> Named {
        let count = self.count.max(1) as f64;
        let means = self
            .sums
            .iter()
            .map(|(name, sum)| (name.clone(), sum / count))
            .collect();
        (self.sums, self.count) = (Vec::new(), 0);
        means
    }
}
