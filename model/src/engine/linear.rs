//! Linear layers and layer norm over packed weights, and tables of vectors.

use super::input::Input;
use super::kernels::{self, Cpu};
use super::pool::Team;
use super::product::product;
use crate::config::Activation;
use crate::error::ModelError;
use crate::weights::{Dtype, PackedMatrix, Weights};

/// What is done with the products of a linear layer, piece by piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum After {
    Nothing,
    Activate(Activation),
}

/// `W x + b`.
#[derive(Clone, Debug)]
pub(crate) struct PackedLinear {
    matrix: PackedMatrix,
    bias: Vec<f32>,
}

impl PackedLinear {
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
        let matrix = PackedMatrix::stack(matrices, input, dtype);
        Self { matrix, bias }
    }

    pub fn matrix(&mut self) -> &mut PackedMatrix {
        &mut self.matrix
    }

    pub fn outputs(&self) -> usize {
        self.bias.len()
    }

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
        product(&self.matrix, team, x, out, |first, products| {
            add_each(products, &self.bias[first..], lanes);
            match after {
                After::Nothing => {}
                After::Activate(Activation::Gelu) => kernels::gelu(cpu, products),
                After::Activate(Activation::Relu2) => {
                    products.iter_mut().for_each(|p| *p = p.max(0.0) * p.max(0.0));
                }
            }
        });
        &mut out[..self.matrix.rows * lanes]
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

#[derive(Clone, Debug)]
pub(crate) struct LayerNorm {
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl LayerNorm {
    pub fn load(w: &Weights, name: &str, dim: usize) -> Result<Self, ModelError> {
        Ok(Self {
            weight: w.floats(&format!("{name}.weight"), &[dim])?,
            bias: w.floats(&format!("{name}.bias"), &[dim])?,
        })
    }

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

/// Vectors that are looked up: one for each code, or for each style.
#[derive(Clone, Debug)]
pub(crate) struct EmbeddingTable {
    dim: usize,
    rows: Vec<f32>,
}

impl EmbeddingTable {
    pub fn load(w: &Weights, name: &str, rows: usize, dim: usize) -> Result<Self, ModelError> {
        let rows = w.floats(name, &[rows, dim])?;
        Ok(Self { dim, rows })
    }

    pub fn row(&self, index: usize) -> &[f32] {
        &self.rows[index * self.dim..][..self.dim]
    }
}
