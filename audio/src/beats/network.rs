//! The network that hears beats and downbeats.
//!
//! 80 steps a second: a dense layer over the values of
//! [`network_input`](super::network_input), ten residual blocks of causal
//! convolutions, dilated by 1 to 512 steps so that it looks back over 25 s (Bai
//! 2018; for beats Davies and Boeck 2019), and logits of beat,
//! downbeat and music. Trained by
//! `audio/reference/train_beats.py` on rendered sound alone; the weights are in
//! `weights.f32`. Plain sums of products in one order: the same bits on every
//! processor. Constant memory, no allocation after the start.

use super::network_input::INPUTS;
use crate::features::spectrum::dot;

const UNITS: usize = 48;
const BLOCKS: usize = 10;
const TAPS: usize = 3;
const OUTPUTS: usize = 3;

static WEIGHTS: &[u8] = include_bytes!("weights.f32");

/// Logits of one step; 0 is a probability of one half.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NetworkOutput {
    /// A beat, [`BeatNetwork::LATE_S`] after it was audible.
    pub(crate) beat: f32,
    /// A beat that opens a bar, just as late.
    pub(crate) downbeat: f32,
    /// Music.
    pub(crate) music: f32,
}

impl NetworkOutput {
    pub(crate) const SILENCE: NetworkOutput =
        NetworkOutput { beat: -9.0, downbeat: -9.0, music: -9.0 };
}

struct DenseLayer {
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl DenseLayer {
    fn take(values: &mut impl Iterator<Item = f32>, inputs: usize, outputs: usize) -> Self {
        Self {
            weights: values.take(inputs * outputs).collect(),
            bias: values.take(outputs).collect(),
        }
    }

    fn apply(&self, input: &[f32], out: &mut [f32]) {
        let rows = self.weights.chunks_exact(input.len());
        for ((value, row), bias) in out.iter_mut().zip(rows).zip(&self.bias) {
            *value = dot(row, input) + bias;
        }
    }
}

/// `x + mix(relu(taps(x two dilations ago, one ago, now)))`.
struct Block {
    taps: DenseLayer,
    mix: DenseLayer,
    /// What came in, in a ring as long as the block looks back.
    past: Vec<[f32; UNITS]>,
    at: usize,
}

impl Block {
    fn take(values: &mut impl Iterator<Item = f32>, dilation: usize) -> Self {
        Self {
            taps: DenseLayer::take(values, TAPS * UNITS, UNITS),
            mix: DenseLayer::take(values, UNITS, UNITS),
            past: vec![[0.0; UNITS]; (TAPS - 1) * dilation],
            at: 0,
        }
    }

    fn step(&mut self, x: &mut [f32; UNITS]) {
        let middle = (self.at + self.past.len() / 2) % self.past.len();
        let mut input = [0.0; TAPS * UNITS];
        for (to, from) in
            input.chunks_exact_mut(UNITS).zip([&self.past[self.at], &self.past[middle], &*x])
        {
            to.copy_from_slice(from);
        }
        self.past[self.at] = *x;
        self.at = (self.at + 1) % self.past.len();
        let (mut hidden, mut added) = ([0.0; UNITS], [0.0; UNITS]);
        self.taps.apply(&input, &mut hidden);
        hidden.iter_mut().for_each(|v| *v = v.max(0.0));
        self.mix.apply(&hidden, &mut added);
        x.iter_mut().zip(added).for_each(|(x, v)| *x += v);
    }
}

pub(crate) struct BeatNetwork {
    dense: DenseLayer,
    blocks: Vec<Block>,
    heads: DenseLayer,
}

impl BeatNetwork {
    /// From an audible beat to the step that hears it, without the resampler's delay.
    pub(crate) const LATE_S: f64 = 0.050;

    pub(crate) fn new() -> Self {
        let values = WEIGHTS.chunks_exact(4);
        let mut values = values.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        Self {
            dense: DenseLayer::take(&mut values, INPUTS, UNITS),
            blocks: (0..BLOCKS).map(|i| Block::take(&mut values, 1 << i)).collect(),
            heads: DenseLayer::take(&mut values, UNITS, OUTPUTS),
        }
    }

    pub(crate) fn step(&mut self, input: &[f32; INPUTS]) -> NetworkOutput {
        let mut x = [0.0; UNITS];
        self.dense.apply(input, &mut x);
        x.iter_mut().for_each(|v| *v = v.max(0.0));
        for block in &mut self.blocks {
            block.step(&mut x);
        }
        x.iter_mut().for_each(|v| *v = v.max(0.0));
        let mut out = [0.0; OUTPUTS];
        self.heads.apply(&x, &mut out);
        let [beat, downbeat, music] = out;
        NetworkOutput { beat, downbeat, music }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fill_the_network() {
        let block = UNITS * (TAPS * UNITS + 1) + UNITS * (UNITS + 1);
        let count = UNITS * (INPUTS + 1) + BLOCKS * block + OUTPUTS * (UNITS + 1);
        assert_eq!(WEIGHTS.len(), 4 * count);
    }
}
