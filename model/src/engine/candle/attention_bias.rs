//! ALiBi for candle: what is added to the scores of whole windows. For the own engine
//! see [`super::super::alibi`].

use candle_core::{Device, Result as TensorResult, Tensor};

#[derive(Clone, Copy, Debug)]
pub(crate) struct AttentionWindow {
    pub frames: usize,
    /// Frames seen that lie ahead; 0 is causal.
    pub ahead: usize,
}

/// The bias [heads, queries, keys] of the last `queries` of `keys`
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
