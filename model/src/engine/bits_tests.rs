//! The same bits on every processor: what AVX2 gives here was also computed by
//! plain Rust on aarch64 (under an emulator: see docs/speed.md).

use super::*;

/// What the numbers below come to in these formats, as their bits' FNV-1a hash.
const EXPECTED: [(&[Dtype], u64); 2] = [
    (
        &[Dtype::F32, Dtype::F16, Dtype::Q8_0, Dtype::Q4_0],
        0x4dd6_f633_a630_6975,
    ),
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
    let matrix = Matrix::pack(&noise(rows * width, 7), width, dtype);
    let mut x = Input::new(width, lanes, dtype);
    for lane in 0..lanes {
        let values = noise(width, 11 + lane as u32);
        x.lane_mut(lane).copy_from_slice(&values);
    }
    x.ready(team.cpu());
    let mut out = vec![0.0; rows * lanes];
    matrix.times(team, &x, &mut out, |_, out| {
        kernels::gelu(team.cpu(), out);
    });
    out
}

/// Attention over a ring that comes round twice.
fn attention(team: &Team, dtype: Dtype) -> Vec<f32> {
    let slopes = (1..=8).map(|h| 0.5 / h as f32).collect();
    let heads = Heads::new(slopes, 20, 45);
    let (mut ring, mut scene) = (Ring::new(&heads, dtype), Scene::new(&heads, 1));
    let (mut clock, mut all) = (Clock::new(45), Vec::new());
    let mut out = vec![0.0; heads.wide()];
    for frame in 0..100 {
        let numbers = noise(3 * heads.wide(), 100 + frame);
        let products: Vec<f32> = numbers.iter().map(|v| 3.0 * v).collect();
        scene.ask(&heads, &products, 0, (0, 1));
        scene.remember(
            team.cpu(),
            &heads,
            &mut ring,
            clock.slot(),
            (&products, heads.wide()),
            (0, 1),
        );
        scene.attend(team, &heads, &clock, std::slice::from_ref(&ring));
        scene.found(&heads, 0, &mut out);
        all.extend_from_slice(&out);
        clock.advance();
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
