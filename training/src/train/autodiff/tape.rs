//! The tape: what was computed on the way to a loss, so that the gradient can
//! go the same way back.
//!
//! A value is a matrix with one row a frame, the sequences of a batch one after
//! another. Operations are coarse (a whole attention, a linear layer onto a
//! residual), each with its own backward pass; candle's are not used here
//! because its backward pass writes zeros and adds for every gradient, and its
//! fused operations have none. Memory goes round in [`BufferPool`] from step to
//! step: fresh pages cost more than most of the arithmetic.

use std::collections::HashMap;

use super::lanes;
use super::parameters::{ParameterGradients, Parameters};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Var(usize);

/// Sequences of `length` frames on the tape: the first `lengths[i]` real, the rest padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Batch {
    /// Frames of every sequence, padding among them.
    pub length: usize,
    pub lengths: Vec<usize>,
}

impl Batch {
    pub fn full(sequences: usize, length: usize) -> Self {
        Self { length, lengths: vec![length; sequences] }
    }

    pub fn rows(&self) -> usize {
        self.length * self.lengths.len()
    }

    /// The rows that are no padding.
    pub fn real_rows(&self) -> impl Iterator<Item = usize> + '_ {
        let of_sequence = |(s, real): (usize, &usize)| s * self.length..s * self.length + real;
        self.lengths.iter().enumerate().flat_map(of_sequence)
    }
}

/// A step back: from the gradient of a value to those of what it was made from.
pub(crate) trait Operation {
    /// `this` is the value; `gradient` is that of the loss by it.
    fn backward(&self, tape: &Tape, this: Var, gradient: Vec<f32>, into: &mut Gradients);
}

struct TapeNode {
    data: Vec<f32>,
    columns: usize,
    /// None: given from outside, nothing to learn behind it.
    operation: Option<Box<dyn Operation>>,
}

#[derive(Debug, Default)]
pub(crate) struct BufferPool {
    of_length: HashMap<usize, BufferShelf>,
}

#[derive(Debug, Default)]
struct BufferShelf {
    free: Vec<Vec<f32>>,
    /// No more than these come back: vectors made elsewhere would pile up, step after step.
    out: usize,
}

impl BufferPool {
    /// A vector with any numbers in it, to be overwritten.
    pub fn take(&mut self, length: usize) -> Vec<f32> {
        let shelf = self.of_length.entry(length).or_default();
        shelf.out += 1;
        shelf.free.pop().unwrap_or_else(|| vec![0.0; length])
    }

    pub fn zeros(&mut self, length: usize) -> Vec<f32> {
        let mut buffer = self.take(length);
        buffer.fill(0.0);
        buffer
    }

    pub fn give(&mut self, buffer: Vec<f32>) {
        let shelf = self.of_length.entry(buffer.len()).or_default();
        if shelf.out > 0 {
            shelf.out -= 1;
            shelf.free.push(buffer);
        }
    }
}

pub(crate) struct Tape<'p> {
    pub parameters: &'p Parameters,
    pub buffers: BufferPool,
    nodes: Vec<TapeNode>,
}

impl<'p> Tape<'p> {
    pub fn new(parameters: &'p Parameters, buffers: BufferPool) -> Self {
        Self { parameters, buffers, nodes: Vec::new() }
    }

    /// Numbers from outside, [rows, columns].
    pub fn constant(&mut self, data: Vec<f32>, columns: usize) -> Var {
        self.push(data, columns, None)
    }

    pub fn record(&mut self, data: Vec<f32>, columns: usize, by: impl Operation + 'static) -> Var {
        self.push(data, columns, Some(Box::new(by)))
    }

    fn push(
        &mut self,
        data: Vec<f32>,
        columns: usize,
        operation: Option<Box<dyn Operation>>,
    ) -> Var {
        debug_assert_eq!(data.len() % columns, 0);
        self.nodes.push(TapeNode { data, columns, operation });
        Var(self.nodes.len() - 1)
    }

    /// The numbers of a value, row after row.
    pub fn data(&self, value: Var) -> &[f32] {
        &self.nodes[value.0].data
    }

    pub fn columns(&self, value: Var) -> usize {
        self.nodes[value.0].columns
    }

    pub fn learns(&self, value: Var) -> bool {
        self.nodes[value.0].operation.is_some()
    }

    /// Gradients by every parameter, from those by some values; and the memory back.
    pub fn backward(mut self, seeds: Vec<(Var, Vec<f32>)>) -> (ParameterGradients, BufferPool) {
        let mut into = Gradients {
            of_values: vec![None; self.nodes.len()],
            parameters: ParameterGradients::zeros(self.parameters),
            buffers: std::mem::take(&mut self.buffers),
        };
        for (value, gradient) in seeds {
            into.add(value, gradient);
        }
        for at in (0..self.nodes.len()).rev() {
            let gradient = into.of_values[at].take();
            match (self.nodes[at].operation.take(), gradient) {
                (Some(by), Some(gradient)) => by.backward(&self, Var(at), gradient, &mut into),
                (_, Some(unused)) => into.buffers.give(unused),
                _ => {}
            }
            // Whatever was made from it has gone back already.
            into.buffers.give(std::mem::take(&mut self.nodes[at].data));
        }
        (into.parameters, into.buffers)
    }

    /// Ends without going back; the memory returns.
    pub fn end(mut self) -> BufferPool {
        for node in self.nodes.drain(..) {
            self.buffers.give(node.data);
        }
        self.buffers
    }
}

pub(crate) struct Gradients {
    of_values: Vec<Option<Vec<f32>>>,
    pub parameters: ParameterGradients,
    pub buffers: BufferPool,
}

impl Gradients {
    pub fn add(&mut self, to: Var, gradient: Vec<f32>) {
        match &mut self.of_values[to.0] {
            Some(sum) => {
                lanes::add(sum, &gradient);
                self.buffers.give(gradient);
            }
            empty => *empty = Some(gradient),
        }
    }

    /// Takes what a value's gradient is so far, to add to it and give it back.
    pub fn take(&mut self, of: Var) -> Option<Vec<f32>> {
        self.of_values[of.0].take()
    }
}
