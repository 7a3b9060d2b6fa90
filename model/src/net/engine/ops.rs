//! The small steps between the products, one vector at a time.

/// Layer norm's epsilon, PyTorch's default.
const EPSILON: f32 = 1e-5;
/// Longest period of the sinusoidal positions, as in "Attention is all you need".
const PERIOD: f64 = 10_000.0;

/// Sum of `f` of all, in eight running sums so that the compiler can use vectors.
fn sum(x: &[f32], f: impl Fn(f32) -> f32) -> f32 {
    let (eights, rest) = x.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        sums.iter_mut()
            .zip(eight)
            .for_each(|(sum, v)| *sum += f(*v));
    }
    sums.iter_mut().zip(rest).for_each(|(sum, v)| *sum += f(*v));
    let four: [f32; 4] = std::array::from_fn(|i| sums[i] + sums[i + 4]);
    (four[0] + four[2]) + (four[1] + four[3])
}

/// `(x - mean) / deviation * weight + bias`.
pub(crate) fn norm_into(x: &[f32], weight: &[f32], bias: &[f32], out: &mut [f32]) {
    let count = x.len() as f32;
    let mean = sum(x, |v| v) / count;
    let variance = sum(x, |v| (v - mean) * (v - mean)) / count;
    let inverse = (variance + EPSILON).sqrt().recip();
    for (((out, x), weight), bias) in out.iter_mut().zip(x).zip(weight).zip(bias) {
        *out = (x - mean) * inverse * weight + bias;
    }
}

/// Adds one lane of products (row by row, all lanes) to a vector.
pub(crate) fn add_lane(x: &mut [f32], products: &[f32], lane: usize, lanes: usize) {
    if lanes == 1 {
        x.iter_mut().zip(products).for_each(|(x, p)| *x += p);
    } else {
        let of_lane = products[lane..].iter().step_by(lanes);
        x.iter_mut().zip(of_lane).for_each(|(x, p)| *x += p);
    }
}

/// Eq. 5 as a residual branch: `x + scale * x / |x| * sqrt(dim)`.
pub(crate) fn styled(x: &mut [f32], scale: &[f32]) {
    let squared = sum(x, |v| v * v);
    let factor = (x.len() as f32).sqrt() / (squared + 1e-6).sqrt();
    for (x, scale) in x.iter_mut().zip(scale) {
        *x += *x * factor * scale;
    }
}

/// Adds the absolute position of a frame: sine and cosine by turns.
pub(crate) fn add_positions(x: &mut [f32], frame: u64) {
    let dim = x.len() as f64;
    for (i, pair) in x.chunks_mut(2).enumerate() {
        let angle = frame as f64 * PERIOD.powf(-2.0 * i as f64 / dim);
        pair[0] += angle.sin() as f32;
        if let Some(second) = pair.get_mut(1) {
            *second += angle.cos() as f32;
        }
    }
}
