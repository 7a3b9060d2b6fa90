//! Linear layers and layer norm over packed weights.

use super::dtype::Dtype;
use super::input::Input;
use super::kernels::{self, Cpu};
use super::matrix::Matrix;
use super::pool::Team;
use crate::error::ModelError;
use crate::net::config::Activation;
use crate::net::weights::Weights;

/// What is done with the products of a linear layer, piece by piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum After {
    /// Nothing.
    Nothing,
    /// The activation of a feed-forward block.
    Activate(Activation),
}

/// `W x + b`.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    matrix: Matrix,
    bias: Vec<f32>,
}

impl Linear {
    /// `NAME.weight` [output, input] and `NAME.bias` [output].
    pub fn load(
        w: &Weights,
        name: &str,
        input: usize,
        output: usize,
        dtype: Dtype,
    ) -> Result<Self, ModelError> {
        Ok(Self {
            matrix: w.matrix(&format!("{name}.weight"), output, input, dtype)?,
            bias: w.floats(&format!("{name}.bias"), &[output])?,
        })
    }

    /// Layers of one input as one: their outputs one after another.
    pub fn stack(layers: Vec<Self>, input: usize, dtype: Dtype) -> Self {
        let bias = layers.iter().flat_map(|layer| layer.bias.clone()).collect();
        let matrices = layers.into_iter().map(|layer| layer.matrix);
        let matrix = Matrix::stack(matrices, input, dtype);
        Self { matrix, bias }
    }

    /// Its matrix, to be moved.
    pub fn matrix(&mut self) -> &mut Matrix {
        &mut self.matrix
    }

    /// Numbers that come out of a lane.
    pub fn outputs(&self) -> usize {
        self.bias.len()
    }

    /// Bytes that a step reads.
    pub fn bytes(&self) -> usize {
        self.matrix.bytes() + 4 * self.bias.len()
    }

    /// `out` takes for each output those of all lanes.
    pub fn forward<'a>(
        &self,
        team: &Team,
        x: &Input,
        out: &'a mut [f32],
        after: After,
    ) -> &'a mut [f32] {
        let lanes = x.lanes();
        let cpu = team.cpu();
        self.matrix.times(team, x, out, |first, products| {
            add_each(products, &self.bias[first..], lanes);
            match after {
                After::Nothing => {}
                After::Activate(Activation::Gelu) => kernels::gelu(cpu, products),
                After::Activate(Activation::Relu2) => {
                    products
                        .iter_mut()
                        .for_each(|p| *p = p.max(0.0) * p.max(0.0));
                }
            }
        });
        &mut out[..self.matrix.rows() * lanes]
    }
}

/// Adds to the products of each row, in all lanes.
fn add_each(products: &mut [f32], bias: &[f32], lanes: usize) {
    if lanes == 1 {
        products.iter_mut().zip(bias).for_each(|(p, b)| *p += b);
    } else {
        for (products, bias) in products.chunks_exact_mut(lanes).zip(bias) {
            products.iter_mut().for_each(|p| *p += bias);
        }
    }
}

/// Layer norm with scale and shift.
#[derive(Clone, Debug)]
pub(crate) struct Norm {
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl Norm {
    /// `NAME.weight` and `NAME.bias`.
    pub fn load(w: &Weights, name: &str, dim: usize) -> Result<Self, ModelError> {
        Ok(Self {
            weight: w.floats(&format!("{name}.weight"), &[dim])?,
            bias: w.floats(&format!("{name}.bias"), &[dim])?,
        })
    }

    /// One vector.
    pub fn one(&self, cpu: Cpu, x: &[f32], out: &mut [f32]) {
        kernels::norm(cpu, out, x, &self.weight, &self.bias);
    }

    /// The vectors of all lanes, ready for a product.
    pub fn forward(&self, cpu: Cpu, x: &[f32], out: &mut Input) {
        for (lane, x) in x.chunks_exact(self.weight.len()).enumerate() {
            self.one(cpu, x, out.lane_mut(lane));
        }
        out.ready(cpu);
    }
}
