//! A small recurrent network that hears downbeats and music.
//!
//! 80 steps a second: a dense layer over what two hops of sound bring, a gated
//! recurrent unit (Cho 2014) that remembers rhythm, and five logits: two of
//! beats, which say well which onsets are beats but serve real music less well
//! than the onsets do, two of downbeats, one of music. Trained by
//! `audio/reference/train_beats.py` on rendered sound alone; the weights are in
//! `weights.f32`. Causal, constant memory, no allocation after the start.

use super::hearing::INPUTS;
use crate::spectrum::dot;

const DENSE: usize = 32;
const UNITS: usize = 40;
const OUTPUTS: usize = 5;

static WEIGHTS: &[u8] = include_bytes!("weights.f32");

/// What the network says of one step, as logits: 0 is "as likely as not".
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Heard {
    /// Beat in the older or the newer hop, 40 ms after it was audible.
    pub(crate) beat: f32,
    /// Downbeat in the older or the newer hop, 40 ms after it was audible.
    pub(crate) downbeat: f32,
    /// Music at all.
    pub(crate) music: f32,
}

impl Heard {
    /// What is said before anything was heard.
    pub(crate) const SILENCE: Heard = Heard {
        beat: -9.0,
        downbeat: -9.0,
        music: -9.0,
    };
}

/// A matrix with a bias, row by row.
struct Layer {
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Layer {
    fn apply(&self, input: &[f32], out: &mut [f32]) {
        let rows = self.weights.chunks_exact(input.len());
        for ((value, row), bias) in out.iter_mut().zip(rows).zip(&self.bias) {
            *value = dot(row, input) + bias;
        }
    }
}

/// The network and its memory.
pub(crate) struct Network {
    dense: Layer,
    /// Gates reset, update and new, from the input and from the memory.
    from_input: Layer,
    from_memory: Layer,
    heads: Layer,
    memory: [f32; UNITS],
}

impl Network {
    pub(crate) fn new() -> Self {
        let mut values = WEIGHTS
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let mut take = |count: usize| -> Vec<f32> { values.by_ref().take(count).collect() };
        let (dense, dense_bias) = (take(DENSE * INPUTS), take(DENSE));
        let (from_input, from_memory) = (take(3 * UNITS * DENSE), take(3 * UNITS * UNITS));
        let (input_bias, memory_bias) = (take(3 * UNITS), take(3 * UNITS));
        let layer = |weights, bias| Layer { weights, bias };
        Self {
            dense: layer(dense, dense_bias),
            from_input: layer(from_input, input_bias),
            from_memory: layer(from_memory, memory_bias),
            heads: layer(take(OUTPUTS * UNITS), take(OUTPUTS)),
            memory: [0.0; UNITS],
        }
    }

    /// Hears one step.
    pub(crate) fn step(&mut self, input: &[f32; INPUTS]) -> Heard {
        let mut dense = [0.0; DENSE];
        self.dense.apply(input, &mut dense);
        dense.iter_mut().for_each(|v| *v = v.max(0.0));
        let (mut new, mut old) = ([0.0; 3 * UNITS], [0.0; 3 * UNITS]);
        self.from_input.apply(&dense, &mut new);
        self.from_memory.apply(&self.memory, &mut old);
        for (i, memory) in self.memory.iter_mut().enumerate() {
            let reset = sigmoid(new[i] + old[i]);
            let keep = sigmoid(new[UNITS + i] + old[UNITS + i]);
            let wish = (new[2 * UNITS + i] + reset * old[2 * UNITS + i]).tanh();
            *memory = wish + keep * (*memory - wish);
        }
        let mut out = [0.0; OUTPUTS];
        self.heads.apply(&self.memory, &mut out);
        Heard {
            beat: out[0].max(out[1]),
            downbeat: out[2].max(out[3]),
            music: out[4],
        }
    }
}

pub(crate) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fill_the_network() {
        let count = DENSE * (INPUTS + 1) + 3 * UNITS * (DENSE + UNITS + 2) + OUTPUTS * (UNITS + 1);
        assert_eq!(WEIGHTS.len(), 4 * count);
    }
}
