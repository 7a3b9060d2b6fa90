//! ALiBi: attention with linear biases, eq. 1 of the paper.
//!
//! A head's score for a frame `age` frames old falls by `slope * age`. It stands
//! for positions: nothing depends on how far into a dance a frame is. Slopes are
//! fields of the configuration ([`crate::config::SeqConfig::slopes`]). The bias that
//! candle adds to its scores is in `candle/attention_bias.rs`.

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
