//! Every operation's gradient against differences of its forward pass.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{AttentionInputs, AttentionMask};
use crate::train::autodiff::parameters::{ParamId, ParamInit, Parameters};
use crate::train::autodiff::tape::{Batch, BufferPool, Tape, Var};
use servodance_model::config::Activation;

const STEP: f32 = 1e-2;

/// Everything learned is a matrix that comes onto the tape by a lookup, or a
/// parameter of the operation itself.
struct Bench {
    parameters: Parameters,
    rng: ChaCha8Rng,
}

impl Bench {
    fn new() -> Self {
        Self { parameters: Parameters::default(), rng: ChaCha8Rng::seed_from_u64(4) }
    }

    fn parameter(&mut self, shape: &[usize]) -> ParamId {
        let name = String::new();
        self.parameters.add(name, shape, ParamInit::Normal(0.8), false, &mut self.rng)
    }

    /// Differences of a weighted sum of the outputs against its gradient.
    fn check(&mut self, build: impl Fn(&mut Tape) -> Var) {
        let mut t = Tape::new(&self.parameters, BufferPool::default());
        let out = build(&mut t);
        let weights: Vec<f32> =
            t.data(out).iter().map(|_| self.rng.random_range(-1.0..1.0)).collect();
        let (gradients, _) = t.backward(vec![(out, weights.clone())]);
        let loss = |parameters: &Parameters| -> f64 {
            let mut t = Tape::new(parameters, BufferPool::default());
            let out = build(&mut t);
            let products = t.data(out).iter().zip(&weights).map(|(o, w)| f64::from(o * w));
            products.sum()
        };
        for (p, gradient) in gradients.0.iter().enumerate() {
            assert!(gradient.iter().any(|g| *g != 0.0), "parameter {p} got no gradient");
            let largest = gradient.iter().fold(1f32, |m, g| m.max(g.abs()));
            for (i, g) in gradient.iter().enumerate() {
                let mut at = |step: f32| {
                    let value =
                        |ps: &mut Parameters, v: f32| ps.iter_mut().nth(p).unwrap().values[i] += v;
                    value(&mut self.parameters, step);
                    let loss = loss(&self.parameters);
                    value(&mut self.parameters, -step);
                    loss
                };
                let slope = ((at(STEP) - at(-STEP)) / f64::from(2.0 * STEP)) as f32;
                assert!((slope - g).abs() < 4e-3 * largest, "parameter {p}, {i}: {slope} and {g}");
            }
        }
    }
}

fn rows(count: usize) -> Vec<u32> {
    (0..count as u32).collect()
}

#[test]
fn affine_alone_and_onto_a_residual() {
    let mut b = Bench::new();
    let (x, w, bias, residual) =
        (b.parameter(&[7, 5]), b.parameter(&[3, 5]), b.parameter(&[3]), b.parameter(&[7, 3]));
    b.check(|t| {
        let (x, residual) = (t.lookup(None, x, 5, rows(7)), t.lookup(None, residual, 3, rows(7)));
        let y = t.affine(x, w, bias, Some(residual));
        // Used twice: gradients add up.
        t.add(y, residual)
    });
}

#[test]
fn layer_norm() {
    let mut b = Bench::new();
    let (x, w, bias) = (b.parameter(&[4, 11]), b.parameter(&[11]), b.parameter(&[11]));
    b.check(|t| {
        let x = t.lookup(None, x, 11, rows(4));
        t.layer_norm(x, w, bias)
    });
}

#[test]
fn activations() {
    for kind in [Activation::Gelu, Activation::Relu2] {
        let mut b = Bench::new();
        let x = b.parameter(&[6, 4]);
        b.check(|t| {
            let x = t.lookup(None, x, 4, rows(6));
            t.activate(x, kind)
        });
    }
}

#[test]
fn modulation_by_style() {
    let mut b = Bench::new();
    let (x, scale) = (b.parameter(&[6, 4]), b.parameter(&[2, 4]));
    b.check(|t| {
        let (x, scale) = (t.lookup(None, x, 4, rows(6)), t.lookup(None, scale, 4, rows(2)));
        t.modulate(x, scale, 3)
    });
}

#[test]
fn dropout_parts_side_by_side_and_null_stream() {
    let mut b = Bench::new();
    let (x, y, null) = (b.parameter(&[6, 2]), b.parameter(&[6, 3]), b.parameter(&[2]));
    b.check(|t| {
        let (x, y) = (t.lookup(None, x, 2, rows(6)), t.lookup(None, y, 3, rows(6)));
        let x = t.or_else(x, null, 3, vec![true, false]);
        let both = t.beside(&[x, y]);
        t.dropout(both, 3, vec![2.0, 2.0, 2.0, 0.0, 2.0, 0.0, 2.0, 2.0, 2.0, 2.0])
    });
}

#[test]
fn rows_that_are_looked_up_often_add_up() {
    let mut b = Bench::new();
    let (table, onto) = (b.parameter(&[3, 4]), b.parameter(&[5, 4]));
    b.check(|t| {
        let onto = t.lookup(None, onto, 4, rows(5));
        t.lookup(Some(onto), table, 4, vec![2, 0, 2, 2, 1])
    });
}

fn sights() -> [AttentionMask; 4] {
    let slopes = vec![0.5, 0.02];
    let of = |window, ahead| AttentionMask { slopes: slopes.clone(), window, ahead };
    [of(5, 0), of(4, 4), of(100, 2), AttentionMask::everything(2)]
}

#[test]
fn attention_to_itself_and_to_music_with_mixed_lengths() {
    let batch = Batch { length: 9, lengths: vec![9, 6] };
    for mask in sights() {
        let mut b = Bench::new();
        let (packed, queries) = (b.parameter(&[18, 12]), b.parameter(&[18, 4]));
        let memory = b.parameter(&[18, 8]);
        b.check(|t| {
            let packed = t.lookup(None, packed, 12, rows(18));
            let own = t.attention(AttentionInputs::Own(packed), &mask, &batch);
            let (q, m) =
                (t.lookup(None, queries, 4, rows(18)), t.lookup(None, memory, 8, rows(18)));
            let cross = t.attention(AttentionInputs::Cross(q, m), &mask, &batch);
            t.add(own, cross)
        });
    }
}

#[test]
fn attention_is_that_of_its_definition_over_many_blocks() {
    let (length, dim, heads) = (130, 8, 2);
    for mask in sights() {
        let mut b = Bench::new();
        let packed = b.parameter(&[length, 3 * dim]);
        let mut t = Tape::new(&b.parameters, BufferPool::default());
        let value = t.lookup(None, packed, 3 * dim, rows(length));
        let out = t.attention(AttentionInputs::Own(value), &mask, &Batch::full(1, length));
        let data = b.parameters.get(packed);
        let width = dim / heads;
        for head in 0..heads {
            for i in 0..length {
                let part =
                    |j: usize, which: usize| &data[(j * 3 + which) * dim + head * width..][..width];
                let seen = mask.of(i, length);
                let score = |j: usize| -> f64 {
                    let dot: f32 = part(i, 0).iter().zip(part(j, 1)).map(|(a, b)| a * b).sum();
                    let bias = mask.slopes[head] * i.abs_diff(j) as f32;
                    f64::from(dot / (width as f32).sqrt() - bias).exp()
                };
                let sum: f64 = seen.clone().map(score).sum();
                for k in 0..width {
                    let mixed: f64 =
                        seen.clone().map(|j| score(j) * f64::from(part(j, 2)[k])).sum();
                    let found = t.data(out)[i * dim + head * width + k];
                    assert!((f64::from(found) - mixed / sum).abs() < 1e-5, "{head} {i} {k}");
                }
            }
        }
    }
}
