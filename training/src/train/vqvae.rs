//! Stage 1 on the tape: an encoder a body part, and the causal decoder.

use super::codebook::Codebook;
use super::layers::{Dropout, Layer, Linear, Maker, Norm, Widths};
use super::ops::Sight;
use super::tape::{Batch, Tape, Value};
use servodance_model::config::{ModelConfig, part_channels};

/// The encoder of one body part.
#[derive(Clone, Debug)]
struct Encoder {
    /// Which of the 137 numbers it sees.
    channels: Vec<usize>,
    input: Linear,
    layers: Vec<Layer>,
    norm: Norm,
    output: Linear,
}

/// The networks of stage 1; their numbers are in the parameters.
#[derive(Clone, Debug)]
pub(crate) struct VqVae {
    encoders: Vec<Encoder>,
    encoder_sight: Sight,
    input: Linear,
    layers: Vec<Layer>,
    norm: Norm,
    output: Linear,
    decoder_sight: Sight,
    motion_dim: usize,
}

impl VqVae {
    /// New parameters for this configuration; an unknown body part is an error
    /// that lists those that there are.
    pub fn new(make: &mut Maker, config: &ModelConfig) -> Result<Self, String> {
        let vq = &config.vq;
        let widths = Widths {
            dim: vq.encoder_dim,
            inner: vq.encoder_slopes.len() * vq.encoder_head_dim(),
            hidden: 4 * vq.encoder_dim,
        };
        let mut encoders = Vec::new();
        for part in &config.parts {
            let channels = part_channels(part)?;
            let name = |rest: &str| format!("vq.encoder.{part}.{rest}");
            encoders.push(Encoder {
                input: Linear::new(make, &name("input"), channels.len(), widths.dim),
                layers: (0..vq.encoder_layers)
                    .map(|i| {
                        Layer::new(
                            make,
                            &name(&format!("layers.{i}")),
                            widths,
                            config.activation,
                        )
                    })
                    .collect(),
                norm: Norm::new(make, &name("norm"), widths.dim),
                output: Linear::new(make, &name("output"), widths.dim, config.code_dim),
                channels,
            });
        }
        let widths = Widths {
            dim: vq.dim,
            inner: vq.heads * vq.decoder_head_dim(),
            hidden: vq.ff,
        };
        let wide = config.parts.len() * config.code_dim;
        Ok(Self {
            encoders,
            encoder_sight: Sight {
                slopes: vq.encoder_slopes.clone(),
                window: vq.encoder_window,
                ahead: vq.encoder_window,
            },
            input: Linear::new(make, "vq.decoder.input", wide, vq.dim),
            layers: (0..vq.decoder_layers)
                .map(|i| {
                    let name = format!("vq.decoder.layers.{i}");
                    Layer::new(make, &name, widths, config.activation)
                })
                .collect(),
            norm: Norm::new(make, "vq.decoder.norm", vq.dim),
            output: Linear::new(make, "vq.decoder.output", vq.dim, config.motion_dim),
            decoder_sight: Sight {
                slopes: vq.decoder_slopes.clone(),
                window: vq.decoder_window,
                ahead: 0,
            },
            motion_dim: config.motion_dim,
        })
    }

    /// Continuous codes of every part, [rows, code_dim], of normalised motion.
    pub fn latents(
        &self,
        t: &mut Tape,
        motion: &[f32],
        batch: &Batch,
        drop: &mut Dropout,
    ) -> Vec<Value> {
        let of_part = |encoder: &Encoder| {
            let rows = motion.chunks(self.motion_dim);
            let seen = rows
                .flat_map(|row| encoder.channels.iter().map(|c| row[*c]))
                .collect();
            let seen = t.constant(seen, encoder.channels.len());
            let mut x = encoder.input.forward(t, seen);
            for layer in &encoder.layers {
                x = layer.forward(t, x, &self.encoder_sight, batch, drop);
            }
            let x = encoder.norm.forward(t, x);
            encoder.output.forward(t, x)
        };
        self.encoders.iter().map(of_part).collect()
    }

    /// Normalised motion [rows, 137] from the code vectors of all parts side by
    /// side.
    pub fn decode(&self, t: &mut Tape, codes: Value, batch: &Batch, drop: &mut Dropout) -> Value {
        let mut x = self.input.forward(t, codes);
        for layer in &self.layers {
            x = layer.forward(t, x, &self.decoder_sight, batch, drop);
        }
        let x = self.norm.forward(t, x);
        self.output.forward(t, x)
    }
}

/// Code vectors of all parts side by side.
pub(crate) fn embed(books: &[Codebook], codes: &[Vec<u32>]) -> Vec<f32> {
    let rows = codes.first().map_or(0, Vec::len);
    let mut out = Vec::with_capacity(rows * books.iter().map(Codebook::dim).sum::<usize>());
    for row in 0..rows {
        for (book, codes) in books.iter().zip(codes) {
            out.extend_from_slice(book.code(codes[row]));
        }
    }
    out
}
