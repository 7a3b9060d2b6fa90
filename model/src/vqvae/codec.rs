//! Motion to codes and back: stage 1 by itself.
//!
//! For researchers who want to know what the codes lose, and for a dance that
//! goes on from a motion ([`crate::Dance::follow`]). Works on files, not on
//! streams: the encoders see some frames ahead.

use std::path::Path;

use super::{VqDecoder, VqEncoder};
use crate::engine::{Engine, EngineOptions};
use crate::error::ModelError;
use crate::motion::representation::{POSE_DIM, PoseVector, Recovery};
use crate::motion::{Clip, Pose, encode, skeleton};
use crate::weights::{BUILT_IN, Weights};

/// Encoders, codebooks and decoder of a weights file.
#[derive(Clone, Debug)]
pub struct Codec {
    encoder: VqEncoder,
    engine: Engine,
    decoder: VqDecoder,
    mean: Vec<f32>,
    std: Vec<f32>,
}

impl Codec {
    /// Of the weights that ship inside this library, and the encoders that ship beside it.
    pub fn built_in() -> Result<Self, ModelError> {
        let dance = Weights::open(BUILT_IN, "built-in weights")?;
        Self::of(&dance, &Weights::open(servodance_encoders::ENCODERS, "built-in encoders")?)
    }

    /// Of a weights file; one without encoders is refused with the name of the
    /// tensor that is missing.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        Self::from_bytes(&Weights::read(path)?, &path.display().to_string())
    }

    /// From memory; `source` names the weights in errors.
    pub fn from_bytes(bytes: &[u8], source: &str) -> Result<Self, ModelError> {
        let weights = Weights::open(bytes, source)?;
        Self::of(&weights, &weights)
    }

    fn of(dance: &Weights, encoders: &Weights) -> Result<Self, ModelError> {
        let engine = Engine::new(dance, EngineOptions::default())?;
        Ok(Self {
            encoder: VqEncoder::load(encoders)?,
            decoder: VqDecoder::load(dance, &engine)?,
            engine,
            mean: dance.floats("norm.motion_mean", &[POSE_DIM])?,
            std: dance.floats("norm.motion_std", &[POSE_DIM])?,
        })
    }

    /// The codes of each frame but the last (a frame's numbers
    /// hold the step to the next). The clip is brought to 20 FPS and the
    /// common skeleton first ([`Clip::normalised`]).
    pub fn encode(&self, clip: &Clip) -> Result<Vec<Vec<usize>>, ModelError> {
        self.encode_poses(&clip.normalised().poses)
    }

    /// The same with the last frame as well, which is taken to move on as it
    /// did: for a dance that is to follow without a seam.
    pub fn encode_all(&self, clip: &Clip) -> Result<Vec<Vec<usize>>, ModelError> {
        let mut poses = clip.normalised().poses;
        if let [.., before, last] = poses[..] {
            poses.push(moved_on(&before, &last));
        }
        self.encode_poses(&poses)
    }

    fn encode_poses(&self, poses: &[Pose]) -> Result<Vec<Vec<usize>>, ModelError> {
        let normalised: Vec<PoseVector> = encode(poses)
            .iter()
            .map(|v| std::array::from_fn(|i| (v[i] - self.mean[i]) / self.std[i]))
            .collect();
        self.encoder.encode(&normalised)
    }

    /// The motion of the codes: 20 FPS, the common skeleton, from
    /// the origin, facing +z.
    pub fn decode(&self, name: &str, codes: &[Vec<usize>]) -> Result<Clip, ModelError> {
        let team = self.engine.pool().team();
        let mut state = self.decoder.start();
        let mut recovery = Recovery::default();
        let mut poses = Vec::with_capacity(codes.len());
        for row in codes {
            let normalised = self.decoder.step(&team, &mut state, row)?;
            let vector = std::array::from_fn(|i| normalised[i] * self.std[i] + self.mean[i]);
            poses.push(skeleton::fit(&recovery.push(&vector), 1.0));
        }
        Ok(Clip { name: name.to_owned(), fps: servodance_types::FRAME_RATE_HZ, poses })
    }
}

/// The pose after `last` if every joint goes on as it came from `before`.
fn moved_on(before: &Pose, last: &Pose) -> Pose {
    std::array::from_fn(|j| std::array::from_fn(|k| 2.0 * last[j][k] - before[j][k]))
}
