//! The same bits on every processor: what AVX2 gives here was also computed by
//! plain Rust on aarch64 (under an emulator: see docs/measurements/model-speed.md).

use super::*;
use crate::engine::kernels::Cpu;
use crate::engine::product::product;
use crate::weights::{Dtype, PackedMatrix};

/// What the numbers below come to in these formats, as their bits' FNV-1a hash.
const EXPECTED: [(&[Dtype], u64); 2] = [
    (&[Dtype::F32, Dtype::F16, Dtype::Q8_0, Dtype::Q4_0], 0x4dd6_f633_a630_6975),
    (&[Dtype::Q6], 0x5d47_16d0_6f69_7475),
];

/// Numbers from -1 to 1 without a pattern (xorshift), no library's.
fn noise(count: usize, seed: u32) -> Vec<f32> {
    let mut state = seed | 1;
    let next = |_| {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as i32 as f32 / 2_147_483_648.0
    };
    (0..count).map(next).collect()
}

/// GELU of products in a format.
fn products(team: &Team, dtype: Dtype, (rows, width, lanes): (usize, usize, usize)) -> Vec<f32> {
    let matrix = PackedMatrix::pack(&noise(rows * width, 7), width, dtype);
    let mut x = Input::new(width, lanes, dtype);
    for lane in 0..lanes {
        let values = noise(width, 11 + lane as u32);
        x.lane_mut(lane).copy_from_slice(&values);
    }
    x.ready(team.cpu());
    let mut out = vec![0.0; rows * lanes];
    product(&matrix, team, &x, &mut out, |_, out| {
        kernels::gelu(team.cpu(), out);
    });
    out
}

/// Attention over a cache that comes round twice.
fn attention(team: &Team, dtype: Dtype) -> Vec<f32> {
    let shape =
        AttentionShape { slopes: (1..=8).map(|h| 0.5 / h as f32).collect(), width: 20, window: 45 };
    let mut caches = [KvCache::new(&shape, dtype)];
    let mut scratch = AttentionScratch::new(&shape, 1, Dtype::F32);
    let (mut position, mut all) = (CachePosition::new(45), Vec::new());
    for frame in 0..100 {
        let numbers = noise(3 * shape.wide(), 100 + frame);
        let products: Vec<f32> = numbers.iter().map(|v| 3.0 * v).collect();
        scratch.set_queries(&shape, &products);
        let given = (&products[..], shape.wide());
        scratch.store(team, &shape, &mut caches, position.slot(), given);
        let attended = scratch.attend(team, &shape, &position, &caches);
        all.extend_from_slice(&attended.values[..shape.wide()]);
        position.advance();
    }
    all
}

fn hash_of(team: &Team, formats: &[Dtype]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    for dtype in formats {
        let shapes = [(96, 768, 1), (33, 256, 2), (7, 39, 2)];
        let products = shapes.map(|shape| products(team, *dtype, shape)).concat();
        for value in products.into_iter().chain(attention(team, *dtype)) {
            for byte in value.to_bits().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        }
    }
    hash
}

#[test]
fn bits_are_the_same_on_every_processor() {
    for pool in [Pool::new(2), Pool::with(Cpu::portable(), 1)] {
        let team = pool.team();
        for (formats, expected) in EXPECTED {
            let hash = hash_of(&team, formats);
            assert_eq!(hash, expected, "{}: {hash:#x}", team.cpu().name());
        }
    }
}
