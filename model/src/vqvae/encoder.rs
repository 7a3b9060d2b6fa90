//! The VQ-VAE's encoders: normalised motion to the codes of each frame.
//!
//! Each part's encoder sees some frames to both sides, so this is for motion
//! that is there already (a file to send through the codes, the past that a
//! dance goes on from), not for a stream. Long motion is taken in pieces that
//! overlap by all that an encoder sees: the codes are those of one pass.

use candle_core::{Device, Tensor};

use super::nearest_code::NearestCode;
use crate::config::{CodePlace, EncoderKind, VqConfig, part_channels, position_channels};
use crate::engine::AttentionWindow;
use crate::engine::candle::{TensorTransformer, TransformerSizes};
use crate::error::ModelError;
use crate::motion::representation::POSE_DIM;
use crate::weights::{Dtype, Weights};

/// Frames whose codes one piece gives.
const PIECE_FRAMES: usize = 512;

#[derive(Clone, Debug)]
struct PartEncoder {
    /// Which of the 137 numbers it sees.
    channels: Vec<usize>,
    /// None where these numbers are quantised as they are.
    transformer: Option<TensorTransformer>,
    code_dim: usize,
    /// One a level.
    codebooks: Vec<NearestCode>,
}

/// The encoders of all body parts.
#[derive(Clone, Debug)]
pub struct VqEncoder {
    config: VqConfig,
    /// Of the codes of a frame.
    places: Vec<CodePlace>,
    parts: Vec<PartEncoder>,
}

impl VqEncoder {
    /// Takes the tensors under `vq.encoder.` out of the file. A file made for
    /// dancing alone has none: the error names the first that is missing.
    pub fn load(w: &Weights) -> Result<Self, ModelError> {
        let config = w.config();
        let parts = (0..config.parts.len()).map(|part| PartEncoder::load(w, part));
        Ok(Self {
            parts: parts.collect::<Result<_, _>>()?,
            places: config.code_places(),
            config: config.vq.clone(),
        })
    }

    /// The codes ([`ModelConfig::code_names`](crate::config::ModelConfig::code_names)) of each row of 137 normalised numbers.
    pub fn encode(&self, motion: &[[f32; POSE_DIM]]) -> Result<Vec<Vec<usize>>, ModelError> {
        let margin = self.config.encoder_window * self.config.encoder_layers;
        let mut codes = Vec::with_capacity(motion.len());
        while codes.len() < motion.len() {
            let first = codes.len();
            let from = first.saturating_sub(margin);
            let end = motion.len().min(first + PIECE_FRAMES);
            let piece = &motion[from..motion.len().min(end + margin)];
            let all = self.encode_piece(piece)?;
            codes.extend_from_slice(&all[first - from..end - from]);
        }
        Ok(codes)
    }

    fn encode_piece(&self, motion: &[[f32; POSE_DIM]]) -> Result<Vec<Vec<usize>>, ModelError> {
        let parts = self.parts.iter().map(|part| part.codes(motion));
        let parts: Vec<Vec<Vec<u32>>> = parts.collect::<Result<_, _>>()?;
        let code = |place: &CodePlace, frame: usize| parts[place.part][place.level][frame] as usize;
        let row = |frame| self.places.iter().map(|place| code(place, frame)).collect();
        Ok((0..motion.len()).map(row).collect())
    }
}

impl PartEncoder {
    fn load(w: &Weights, index: usize) -> Result<Self, ModelError> {
        let (config, vq) = (w.config(), &w.config().vq);
        let part = &config.parts[index];
        let channels = match vq.encoder {
            EncoderKind::Transformer => part_channels(part),
            EncoderKind::Positions => position_channels(part),
        };
        let channels = channels.map_err(|reason| w.config_error(reason))?;
        let sizes = TransformerSizes {
            input: channels.len(),
            dim: vq.encoder_dim,
            ff: 4 * vq.encoder_dim,
            output: config.code_dim,
            layers: vq.encoder_layers,
            head_width: vq.encoder_head_dim(),
            slopes: vq.encoder_slopes.clone(),
            window: AttentionWindow { frames: vq.encoder_window, ahead: vq.encoder_window },
            activation: config.activation,
            skip: vq.skip,
        };
        let name = format!("vq.encoder.{part}");
        let transformer = (vq.encoder == EncoderKind::Transformer)
            .then(|| TensorTransformer::load(w, &name, sizes));
        let places = (0..config.levels_of(index)).map(|level| CodePlace { part: index, level });
        Ok(Self {
            transformer: transformer.transpose()?,
            code_dim: config.code_dim,
            codebooks: places
                .map(|place| NearestCode::load(w, &config.code_name(place)))
                .collect::<Result<_, _>>()?,
            channels,
        })
    }

    /// What is quantised, [frames, code_dim].
    fn latents(&self, motion: &[[f32; POSE_DIM]]) -> Result<Tensor, ModelError> {
        let frames = motion.len();
        let seen = |row: &[f32; POSE_DIM]| self.channels.iter().map(|&c| row[c]).collect();
        let rows: Vec<Vec<f32>> = motion.iter().map(seen).collect();
        let Some(transformer) = &self.transformer else {
            let filled = |mut row: Vec<f32>| {
                row.resize(self.code_dim, 0.0);
                row
            };
            let rows: Vec<f32> = rows.into_iter().flat_map(filled).collect();
            return Ok(Tensor::from_vec(rows, (frames, self.code_dim), &Device::Cpu)?);
        };
        let seen = Tensor::from_vec(rows.concat(), (frames, self.channels.len()), &Device::Cpu)?;
        Ok(transformer.forward(&seen, &mut transformer.start(Dtype::F32))?)
    }

    /// [level][frame].
    fn codes(&self, motion: &[[f32; POSE_DIM]]) -> Result<Vec<Vec<u32>>, ModelError> {
        let mut left = self.latents(motion)?;
        let mut levels = Vec::with_capacity(self.codebooks.len());
        for codebook in &self.codebooks {
            let (codes, rest) = codebook.quantise(&left)?;
            left = rest;
            levels.push(codes);
        }
        Ok(levels)
    }
}
