//! Random weights of any shape, always the same for the same name: for
//! measuring time, and for tests that need no trained model.

/// Numbers of the size that layers begin training with: matrices by their
/// width, scales of norms around 1.
pub(crate) fn tensor(name: &str, shape: &[usize]) -> Vec<f32> {
    let count = shape.iter().product();
    let width = shape.last().copied().unwrap_or(1).max(1) as f32;
    let (mean, spread) = match shape.len() {
        1 if name.ends_with(".weight") => (1.0, 0.1),
        1 => (0.0, 0.1),
        _ => (0.0, (3.0 / width).sqrt()),
    };
    let mut state = name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let next = || {
        // xorshift64: good enough to be no pattern.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        let unit = (state >> 40) as f32 / (1 << 23) as f32 - 1.0;
        mean + spread * unit
    };
    std::iter::repeat_with(next).take(count).collect()
}
