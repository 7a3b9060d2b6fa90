//! The fast kernels against plain Rust (the same bits), the quantised ones
//! against the numbers that they stand for, and any number of threads.

use proptest::prelude::*;

use super::*;
use crate::config::Activation;
use crate::engine::kernels::Cpu;
use crate::engine::product::product;
use crate::weights::{Dtype, PackedMatrix, q4_block, q4_values, q8_block, random};

/// A product with pools of both kernels and several threads.
fn products(values: &[f32], width: usize, x: &[f32], dtype: Dtype) -> Vec<f32> {
    let matrix = PackedMatrix::pack(values, width, dtype);
    let lanes = x.len() / width;
    let mut input = Input::new(width, lanes, dtype);
    for (lane, x) in x.chunks_exact(width).enumerate() {
        input.lane_mut(lane).copy_from_slice(x);
    }
    input.ready(Cpu::detect());
    let with = |pool: Pool| {
        let mut out = vec![0.0; matrix.rows * lanes];
        product(&matrix, &pool.team(), &input, &mut out, |_, _| {});
        out
    };
    let fast = with(Pool::new(3));
    assert_eq!(fast, with(Pool::with(Cpu::portable(), 1)), "{dtype} {width}");
    fast
}

#[test]
fn kernels_agree_to_the_bit_and_products_are_right() {
    for (width, rows, lanes) in [(768, 60, 1), (39, 7, 2), (256, 33, 2), (192, 5, 1), (8, 3, 3)] {
        let values = random::tensor("values", &[rows, width]);
        let x = random::tensor("x", &[lanes, width]);
        for (dtype, tolerance) in [
            (Dtype::F32, 1e-6),
            (Dtype::F16, 1e-3),
            (Dtype::Q8_0, 2e-2),
            (Dtype::Q6, 6e-2),
            (Dtype::Q4_0, 0.25),
        ] {
            let found = products(&values, width, &x, dtype);
            for (row, found) in values.chunks(width).zip(found.chunks(lanes)) {
                for (x, found) in x.chunks(width).zip(found) {
                    let terms = || row.iter().zip(x).map(|(a, b)| f64::from(a * b));
                    let size: f64 = terms().map(|t| t * t).sum::<f64>().sqrt();
                    let gap = (terms().sum::<f64>() - f64::from(*found)).abs();
                    assert!(gap <= tolerance * size.max(1e-3), "{dtype} {width}: {gap} of {size}");
                }
            }
        }
    }
}

#[test]
fn quantised_blocks_keep_their_bounds() {
    let block: [f32; 32] = std::array::from_fn(|i| (i as f32 - 11.0) * 0.01);
    let (quants, scale) = q8_block(&block);
    for (quant, value) in quants.iter().zip(block) {
        let back = f32::from(*quant) * scale.to_f32();
        assert!((back - value).abs() <= 0.51 * scale.to_f32(), "{back} {value}");
    }
    let (bytes, scale) = q4_block(&block);
    for (back, value) in q4_values(&bytes, scale).iter().zip(block) {
        assert!((back - value).abs() <= 1.01 * scale.to_f32().abs(), "{back} {value}");
    }
    assert_eq!(q8_block(&[0.0; 32]).0, [0; 32]);
    let (bytes, scale) = q4_block(&[0.0; 32]);
    assert_eq!(q4_values(&bytes, scale), [0.0; 32]);
}

#[test]
fn activations_are_those_of_the_formula() {
    let xs: Vec<f32> = (-400..=400).map(|i| i as f32 * 0.05).collect();
    let (mut fast, mut plain) = (xs.clone(), xs.clone());
    kernels::gelu(Cpu::detect(), &mut fast);
    kernels::gelu(Cpu::portable(), &mut plain);
    assert_eq!(fast, plain);
    for (x, found) in xs.iter().zip(fast) {
        let x = f64::from(*x);
        let u = (2.0 / std::f64::consts::PI).sqrt() * (x + 0.044_715 * x.powi(3));
        let expected = 0.5 * x * (1.0 + u.tanh());
        let gap = (expected - f64::from(found)).abs();
        assert!(gap < 2e-6 * x.abs().max(1.0), "{x}: {found}, {expected}");
    }
    assert_ne!(After::Nothing, After::Activate(Activation::Gelu));
}

/// What a kernel makes of noise, compiled for this processor and in plain Rust.
fn both(count: usize, kernel: impl Fn(Cpu, &[f32]) -> Vec<f32>) -> (Vec<f32>, Vec<f32>) {
    let mut x = random::tensor("x", &[count]);
    x.iter_mut().for_each(|x| *x = 0.3 + 4.0 * *x);
    let made = [Cpu::detect(), Cpu::portable()].map(|cpu| kernel(cpu, &x));
    assert_eq!(made[0], made[1], "{count}");
    (x, made[0].clone())
}

#[test]
fn norms_are_those_of_the_formula() {
    for count in [8usize, 21, 256, 768] {
        let scale = random::tensor("scale", &[count]);
        let (x, found) = both(count, |cpu, x| {
            let mut out = vec![0.0; count];
            kernels::norm(cpu, &mut out, x, &scale, &scale);
            out
        });
        let n = count as f64;
        let mean = x.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
        let square = |x: &f32| (f64::from(*x) - mean).powi(2);
        let deviation = (x.iter().map(square).sum::<f64>() / n + 1e-5).sqrt();
        for ((x, scale), found) in x.iter().zip(&scale).zip(found) {
            let expected = ((f64::from(*x) - mean) / deviation + 1.0) * f64::from(*scale);
            assert!((expected - f64::from(found)).abs() < 1e-5, "{count}");
        }
        let (x, found) = both(count, |cpu, x| {
            let mut out = x.to_vec();
            kernels::styled(cpu, &mut out, &scale);
            out
        });
        let size = x.iter().map(|x| f64::from(x * x)).sum::<f64>().sqrt();
        for ((x, scale), found) in x.iter().zip(&scale).zip(found) {
            let expected = f64::from(*x) * (1.0 + f64::from(*scale) * n.sqrt() / size);
            assert!((expected - f64::from(found)).abs() < 1e-5, "{count}");
        }
    }
}

#[test]
fn numbers_are_kept_to_half_a_step() {
    for count in [32usize, 96, 768] {
        let (x, found) = both(count, |cpu, x| {
            let (mut quants, mut scales) = (vec![0; count], vec![0.0; count / 32]);
            kernels::quantise(cpu, &mut quants, &mut scales, x);
            let back = |i: usize| f32::from(quants[i]) * scales[i / 32];
            (0..count).map(back).collect()
        });
        for (x, found) in x.iter().zip(found) {
            assert!((x - found).abs() < 5e-4, "{x} {found}");
        }
    }
    for count in [1usize, 8, 21] {
        let (x, found) = both(count, |cpu, x| {
            let mut bits = vec![0; count];
            kernels::to_half(cpu, &mut bits, x);
            let back = |bits: &u16| half::f16::from_bits(*bits).to_f32();
            bits.iter().map(back).collect()
        });
        for (x, found) in x.iter().zip(found) {
            assert_eq!(half::f16::from_f32(*x).to_f32(), found);
        }
    }
}

#[test]
fn scores_fade_with_age() {
    for count in [1usize, 7, 8, 29] {
        let scores: Vec<f32> = (0..count).map(|i| (i as f32).sin()).collect();
        let (mut fast, mut plain) = (scores.clone(), scores.clone());
        kernels::fade(Cpu::detect(), &mut fast, 0.25, 100.0);
        kernels::fade(Cpu::portable(), &mut plain, 0.25, 100.0);
        assert_eq!(fast, plain);
        for (i, (before, after)) in scores.iter().zip(fast).enumerate() {
            let expected = f64::from(*before) - 0.25 * (100.0 - i as f64);
            assert!((expected - f64::from(after)).abs() < 2e-6 * expected.abs());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn attention_agrees_to_the_bit_and_is_softmax(
        scores in prop::collection::vec(-60f32..60.0, 1..50),
        width in 1usize..12,
    ) {
        let (mut fast, mut plain) = (scores.clone(), scores.clone());
        kernels::softmax(Cpu::detect(), &mut fast);
        kernels::softmax(Cpu::portable(), &mut plain);
        prop_assert_eq!(&fast, &plain);
        let largest = scores.iter().fold(f64::MIN, |m, s| m.max(f64::from(*s)));
        let e: Vec<f64> = scores.iter().map(|s| (f64::from(*s) - largest).exp()).collect();
        let total: f64 = e.iter().sum();
        for (found, e) in fast.iter().zip(&e) {
            prop_assert!((f64::from(*found) - e / total).abs() < 1e-6);
        }
        let width = 8 * width;
        let values = random::tensor("values", &[scores.len(), width]);
        let halves: Vec<u16> = values.iter().map(|v| half::f16::from_f32(*v).to_bits()).collect();
        for half in [false, true] {
            let mix = |cpu| {
                let mut out = vec![0.0; width];
                match half {
                    true => kernels::mix_f16(cpu, &mut out, &fast, &halves),
                    false => kernels::mix_f32(cpu, &mut out, &fast, &values),
                }
                let mut scores = fast.clone();
                match half {
                    true => kernels::scores_f16(cpu, &mut scores, &halves, &out),
                    false => kernels::scores_f32(cpu, &mut scores, &values, &out),
                }
                (out, scores)
            };
            let (out, again) = mix(Cpu::detect());
            prop_assert_eq!(&(out.clone(), again), &mix(Cpu::portable()));
            for (column, found) in out.iter().enumerate() {
                let of = |row: usize| f64::from(values[row * width + column]);
                let expected: f64 = fast.iter().enumerate().map(|(r, p)| f64::from(*p) * of(r)).sum();
                prop_assert!((f64::from(*found) - expected).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn halves_are_read_as_the_standard_says(bits in any::<u16>()) {
        let expected = half::f16::from_bits(bits).to_f32();
        prop_assume!(expected.is_finite());
        let row = [bits; 8];
        let mut x = [0.0; 8];
        x[3] = 1.0;
        let mut out = [0.0];
        for cpu in [Cpu::detect(), Cpu::portable()] {
            kernels::rows_f16(cpu, &mut out, &row, &x, 8);
            prop_assert_eq!(out[0], expected);
        }
    }
}
