//! The VQ-VAE on the tape: an encoder a body part, and the causal decoder.

use crate::train::autodiff::ops::AttentionMask;
use crate::train::autodiff::parameters::Parameters;
use crate::train::autodiff::tape::{Batch, Tape, Var};
use crate::train::layers::{
    Dropout, LayerNorm, LayerWidths, LinearLayer, ParamBuilder, TransformerLayer,
};
use servodance_model::config::{EncoderKind, ModelConfig, part_channels, position_channels};
use servodance_model::weights::ENCODERS;

#[derive(Clone, Debug)]
struct PartEncoder {
    /// Which of the 137 numbers it sees.
    channels: Vec<usize>,
    input: LinearLayer,
    layers: Vec<TransformerLayer>,
    norm: LayerNorm,
    output: LinearLayer,
    skip: Option<LinearLayer>,
}

/// The networks of the VQ-VAE; their numbers are in the parameters.
#[derive(Clone, Debug)]
pub(crate) struct VqVaeNetwork {
    /// None where positions are quantised as they are.
    encoders: Vec<PartEncoder>,
    /// Which numbers these are, of each part.
    positions: Vec<Vec<usize>>,
    code_dim: usize,
    encoder_mask: AttentionMask,
    input: LinearLayer,
    layers: Vec<TransformerLayer>,
    norm: LayerNorm,
    output: LinearLayer,
    skip: Option<LinearLayer>,
    decoder_mask: AttentionMask,
    motion_dim: usize,
}

impl VqVaeNetwork {
    /// Fails on an unknown body part, with those that there are.
    pub fn new(make: &mut ParamBuilder, config: &ModelConfig) -> Result<Self, String> {
        let vq = &config.vq;
        let widths = LayerWidths {
            dim: vq.encoder_dim,
            inner: vq.encoder_slopes.len() * vq.encoder_head_dim(),
            hidden: 4 * vq.encoder_dim,
        };
        let (mut encoders, mut positions) = (Vec::new(), Vec::new());
        for part in &config.parts {
            if vq.encoder == EncoderKind::Positions {
                positions.push(position_channels(part)?);
                continue;
            }
            let channels = part_channels(part)?;
            let name = |rest: &str| format!("{ENCODERS}{part}.{rest}");
            encoders.push(PartEncoder {
                input: LinearLayer::new(make, &name("input"), channels.len(), widths.dim),
                layers: (0..vq.encoder_layers)
                    .map(|i| {
                        TransformerLayer::new(
                            make,
                            &name(&format!("layers.{i}")),
                            widths,
                            config.activation,
                        )
                    })
                    .collect(),
                norm: LayerNorm::new(make, &name("norm"), widths.dim),
                output: LinearLayer::new(make, &name("output"), widths.dim, config.code_dim),
                skip: vq.skip.then(|| {
                    LinearLayer::new(make, &name("skip"), channels.len(), config.code_dim)
                }),
                channels,
            });
        }
        let widths =
            LayerWidths { dim: vq.dim, inner: vq.heads * vq.decoder_head_dim(), hidden: vq.ff };
        let wide = config.parts.len() * config.code_dim;
        Ok(Self {
            encoders,
            positions,
            code_dim: config.code_dim,
            encoder_mask: AttentionMask {
                slopes: vq.encoder_slopes.clone(),
                window: vq.encoder_window,
                ahead: vq.encoder_window,
            },
            input: LinearLayer::new(make, "vq.decoder.input", wide, vq.dim),
            layers: (0..vq.decoder_layers)
                .map(|i| {
                    let name = format!("vq.decoder.layers.{i}");
                    TransformerLayer::new(make, &name, widths, config.activation)
                })
                .collect(),
            norm: LayerNorm::new(make, "vq.decoder.norm", vq.dim),
            output: LinearLayer::new(make, "vq.decoder.output", vq.dim, config.motion_dim),
            skip: vq
                .skip
                .then(|| LinearLayer::new(make, "vq.decoder.skip", wide, config.motion_dim)),
            decoder_mask: AttentionMask {
                slopes: vq.decoder_slopes.clone(),
                window: vq.decoder_window,
                ahead: 0,
            },
            motion_dim: config.motion_dim,
        })
    }

    /// Whether an encoder learns.
    pub fn has_encoders(&self) -> bool {
        !self.encoders.is_empty()
    }

    /// The decoder's way around its layers, where positions are quantised: each number to its
    /// own place. The layers begin with nothing to add.
    pub fn begin_with_positions(&self, parameters: &mut Parameters) {
        if self.positions.is_empty() || self.skip.is_none() {
            return;
        }
        let wide = self.positions.len() * self.code_dim;
        for parameter in parameters.iter_mut() {
            match parameter.name.as_str() {
                "vq.decoder.skip.weight" => {
                    parameter.values.fill(0.0);
                    for (part, channels) in self.positions.iter().enumerate() {
                        for (at, channel) in channels.iter().enumerate() {
                            parameter.values[channel * wide + part * self.code_dim + at] = 1.0;
                        }
                    }
                }
                "vq.decoder.skip.bias" | "vq.decoder.output.weight" | "vq.decoder.output.bias" => {
                    parameter.values.fill(0.0);
                }
                _ => (),
            }
        }
    }

    /// Continuous codes of every part, [rows, code_dim], of normalised motion.
    pub fn latents(
        &self,
        t: &mut Tape,
        motion: &[f32],
        batch: &Batch,
        drop: &mut Dropout,
    ) -> Vec<Var> {
        let filled = |channels: &Vec<usize>| {
            let rows = motion.chunks(self.motion_dim).flat_map(|row| {
                let seen = channels.iter().map(|c| row[*c]).chain(std::iter::repeat(0.0));
                seen.take(self.code_dim)
            });
            t.constant(rows.collect(), self.code_dim)
        };
        if !self.positions.is_empty() {
            return self.positions.iter().map(filled).collect();
        }
        let of_part = |encoder: &PartEncoder| {
            let rows = motion.chunks(self.motion_dim);
            let seen = rows.flat_map(|row| encoder.channels.iter().map(|c| row[*c])).collect();
            let seen = t.constant(seen, encoder.channels.len());
            let mut x = encoder.input.forward(t, seen);
            for layer in &encoder.layers {
                x = layer.forward(t, x, &self.encoder_mask, batch, drop);
            }
            let x = encoder.norm.forward(t, x);
            with_skip(t, (encoder.output, encoder.skip), x, seen)
        };
        self.encoders.iter().map(of_part).collect()
    }

    /// Normalised motion [rows, 137] from the code vectors of all parts side by side.
    pub fn decode(&self, t: &mut Tape, codes: Var, batch: &Batch, drop: &mut Dropout) -> Var {
        let mut x = self.input.forward(t, codes);
        for layer in &self.layers {
            x = layer.forward(t, x, &self.decoder_mask, batch, drop);
        }
        let x = self.norm.forward(t, x);
        with_skip(t, (self.output, self.skip), x, codes)
    }
}

/// The last layer, onto a linear map of the input where there is one.
fn with_skip(
    t: &mut Tape,
    (output, skip): (LinearLayer, Option<LinearLayer>),
    x: Var,
    input: Var,
) -> Var {
    match skip {
        Some(skip) => {
            let skipped = skip.forward(t, input);
            output.onto(t, x, skipped)
        }
        None => output.forward(t, x),
    }
}
