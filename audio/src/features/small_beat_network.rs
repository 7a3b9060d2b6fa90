//! A small recurrent network for beats, 80 steps a second: a dense layer over two hops of
//! band values and a gated recurrent unit (Cho 2014). The onsets' own tracker reads it.
//!
//! Trained on rendered sound alone: songs, talkers, crowds, noise, knocks, motors. The
//! network of the [beats](crate::beats) is another one, and looks back over 25 s.
//! Causal, constant memory, no allocation after the start.

use super::onset_strength::{BANDS, Onset};
use super::spectrum::{dot, sigmoid};

/// The older hop's rises, the newer hop's, the newer hop's levels.
const INPUTS: usize = 2 * BANDS + BANDS / 2;

const DENSE: usize = 32;
const UNITS: usize = 40;
/// Two of beats; two of downbeats and one of music, which are not read.
const OUTPUTS: usize = 5;

static WEIGHTS: &[u8] = include_bytes!("small_beat_weights.f32");

struct DenseLayer {
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl DenseLayer {
    fn apply(&self, input: &[f32], out: &mut [f32]) {
        let rows = self.weights.chunks_exact(input.len());
        for ((value, row), bias) in out.iter_mut().zip(rows).zip(&self.bias) {
            *value = dot(row, input) + bias;
        }
    }
}

pub(crate) struct SmallBeatNetwork {
    dense: DenseLayer,
    /// Gates reset, update and new, from the input and from the memory.
    from_input: DenseLayer,
    from_memory: DenseLayer,
    heads: DenseLayer,
    memory: [f32; UNITS],
}

impl SmallBeatNetwork {
    pub(crate) fn new() -> Self {
        let mut values =
            WEIGHTS.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let mut take = |count: usize| -> Vec<f32> { values.by_ref().take(count).collect() };
        let (dense, dense_bias) = (take(DENSE * INPUTS), take(DENSE));
        let (from_input, from_memory) = (take(3 * UNITS * DENSE), take(3 * UNITS * UNITS));
        let (input_bias, memory_bias) = (take(3 * UNITS), take(3 * UNITS));
        let layer = |weights, bias| DenseLayer { weights, bias };
        Self {
            dense: layer(dense, dense_bias),
            from_input: layer(from_input, input_bias),
            from_memory: layer(from_memory, memory_bias),
            heads: layer(take(OUTPUTS * UNITS), take(OUTPUTS)),
            memory: [0.0; UNITS],
        }
    }

    /// The log-odds of a beat in one of two more hops, 40 ms after it was audible.
    pub(crate) fn step(&mut self, older: &Onset, newer: &Onset) -> f32 {
        let mut input = [0.0; INPUTS];
        input[..BANDS].copy_from_slice(&older.rises);
        input[BANDS..2 * BANDS].copy_from_slice(&newer.rises);
        input[2 * BANDS..].copy_from_slice(&newer.levels);
        let mut dense = [0.0; DENSE];
        self.dense.apply(&input, &mut dense);
        dense.iter_mut().for_each(|v| *v = v.max(0.0));
        let (mut new, mut old) = ([0.0; 3 * UNITS], [0.0; 3 * UNITS]);
        self.from_input.apply(&dense, &mut new);
        self.from_memory.apply(&self.memory, &mut old);
        for (i, memory) in self.memory.iter_mut().enumerate() {
            let reset = sigmoid(new[i] + old[i]);
            let keep = sigmoid(new[UNITS + i] + old[UNITS + i]);
            let candidate = (new[2 * UNITS + i] + reset * old[2 * UNITS + i]).tanh();
            *memory = candidate + keep * (*memory - candidate);
        }
        let mut out = [0.0; OUTPUTS];
        self.heads.apply(&self.memory, &mut out);
        out[0].max(out[1])
    }
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
