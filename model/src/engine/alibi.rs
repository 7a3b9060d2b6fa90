//! ALiBi: attention with linear biases, eq. 1 of the paper.
//!
//! A head's score for a frame `age` frames old falls by `slope * age`. It stands
//! for positions: nothing depends on how far into a dance a frame is. Slopes are
//! fields of the configuration ([`crate::config::SeqConfig::slopes`]).

use candle_core::{Device, Result as TensorResult, Tensor};

use super::kernels::{self, Cpu};

/// For the own engine: subtracts the bias from the scores of one head, one score
/// for each filled slot of a cache whose newest frame is in `slot`.
pub(super) fn subtract(cpu: Cpu, scores: &mut [f32], slope: f32, slot: usize) {
    if slope == 0.0 {
        return;
    }
    // Up to `slot` the cache holds this rotation's frames; the slots behind, all
    // filled if any is, hold those of the rotation before.
    let oldest = scores.len() - 1;
    let (newer, older) = scores.split_at_mut(slot + 1);
    kernels::fade(cpu, newer, slope, slot as f32);
    kernels::fade(cpu, older, slope, oldest as f32);
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct AttentionWindow {
    pub frames: usize,
    /// Frames seen that lie ahead; 0 is causal.
    pub ahead: usize,
}

/// For candle: the bias [heads, queries, keys] of the last `queries` of `keys`
/// frames in their order; minus infinity for frames that are not seen.
pub(crate) fn attention_bias(
    slopes: &[f32],
    queries: usize,
    keys: usize,
    seen: AttentionWindow,
) -> TensorResult<Tensor> {
    let mut bias = Vec::with_capacity(slopes.len() * queries * keys);
    for slope in slopes {
        for i in keys - queries..keys {
            for j in 0..keys {
                let visible = j <= i + seen.ahead && j + seen.frames > i;
                bias.push(if visible { -slope * i.abs_diff(j) as f32 } else { f32::NEG_INFINITY });
            }
        }
    }
    Tensor::from_vec(bias, (slopes.len(), queries, keys), &Device::Cpu)
}
