//! The small steps between the products, one vector at a time.

/// Longest period of the sinusoidal positions, as in "Attention is all you need".
const PERIOD: f64 = 10_000.0;

/// Adds one lane of products (row by row, all lanes) to a vector.
pub(crate) fn add_lane(x: &mut [f32], products: &[f32], lane: usize, lanes: usize) {
    if lanes == 1 {
        x.iter_mut().zip(products).for_each(|(x, p)| *x += p);
    } else {
        let of_lane = products[lane..].iter().step_by(lanes);
        x.iter_mut().zip(of_lane).for_each(|(x, p)| *x += p);
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
