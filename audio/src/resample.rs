//! A streaming resampler with a fixed, known delay.
//!
//! Windowed sinc in polyphase form. Output sample `n` is the input at
//! `(n - DELAY) / output_rate` seconds and depends only on input before
//! `n / output_rate`: the delay makes the filter causal. Positions are exact
//! integers, so nothing drifts, and the same input gives the same output
//! whatever the block sizes. Constant memory; `push` does not allocate beyond
//! the caller's buffer.

use std::f64::consts::PI;

/// How much later the output is than the input, in output samples.
pub(crate) const DELAY: usize = 16;

/// Most phases kept in the table. With more (odd ratios) the nearest is taken,
/// an error below -70 dB.
const MAX_PHASES: u64 = 1024;

/// Converts a mono stream from one rate to another.
pub(crate) struct Resampler {
    input_rate: u64,
    output_rate: u64,
    /// `phases` rows of `taps` coefficients, for the newest `taps` inputs.
    table: Vec<f32>,
    phases: u64,
    taps: usize,
    history: Vec<f32>,
    filled: usize,
    /// Input samples received.
    received: u64,
    /// Input position of the next output: whole samples and the remainder in
    /// units of one `output_rate`-th of an input sample.
    next_whole: u64,
    next_part: u64,
}

impl Resampler {
    /// A resampler between two rates in Hz, both above 0.
    pub(crate) fn new(input_rate: u32, output_rate: u32) -> Self {
        let (input, output) = (f64::from(input_rate), f64::from(output_rate));
        let half_width = DELAY as f64 * input / output;
        let taps = (2.0 * half_width).ceil() as usize + 1;
        let divisor = gcd(u64::from(input_rate), u64::from(output_rate));
        let phases = (u64::from(output_rate) / divisor).min(MAX_PHASES);
        // Pass band: a little below the lower of the two Nyquist rates.
        let cutoff = 0.94 * (output / input).min(1.0);
        let mut table = Vec::with_capacity(phases as usize * taps);
        for phase in 0..phases {
            let part = phase as f64 / phases as f64;
            let row: Vec<f64> = (0..taps)
                .map(|tap| {
                    // Distance from the wanted point to input `whole - (taps - 1 - tap)`.
                    let x = part + (taps - 1 - tap) as f64 - half_width;
                    cutoff * sinc(cutoff * x) * blackman(x / half_width)
                })
                .collect();
            let sum: f64 = row.iter().sum();
            table.extend(row.iter().map(|c| (c / sum) as f32));
        }
        Self {
            input_rate: u64::from(input_rate),
            output_rate: u64::from(output_rate),
            table,
            phases,
            taps,
            history: vec![0.0; 4 * taps],
            filled: taps,
            received: 0,
            next_whole: 0,
            next_part: 0,
        }
    }

    /// Takes one input sample and hands every output that it completes to `out`.
    pub(crate) fn push(&mut self, sample: f32, mut out: impl FnMut(f32)) {
        if self.filled == self.history.len() {
            self.history.copy_within(self.filled - self.taps.., 0);
            self.filled = self.taps;
        }
        self.history[self.filled] = sample;
        self.filled += 1;
        self.received += 1;
        // Output at whole + part needs the inputs up to `whole`.
        while self.next_whole < self.received {
            out(self.output());
            self.next_part += self.input_rate;
            self.next_whole += self.next_part / self.output_rate;
            self.next_part %= self.output_rate;
        }
    }

    fn output(&self) -> f32 {
        let phase = (self.next_part * self.phases + self.output_rate / 2) / self.output_rate;
        let phase = phase.min(self.phases - 1) as usize;
        let row = &self.table[phase * self.taps..(phase + 1) * self.taps];
        dot(row, &self.history[self.filled - self.taps..self.filled])
    }
}

/// The scalar product in eight lanes, which the compiler turns into vectors.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0f32; 8];
    let (a_rows, b_rows) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = a_rows
        .remainder()
        .iter()
        .zip(b_rows.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a_rows.zip(b_rows) {
        for lane in 0..8 {
            lanes[lane] += x[lane] * y[lane];
        }
    }
    lanes.iter().sum::<f32>() + rest
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-9 {
        1.0
    } else {
        (PI * x).sin() / (PI * x)
    }
}

/// Blackman window over -1..1, 0 outside.
fn blackman(x: f64) -> f64 {
    if x.abs() >= 1.0 {
        return 0.0;
    }
    0.42 + 0.5 * (PI * x).cos() + 0.08 * (2.0 * PI * x).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn convert(input: &[f32], from: u32, to: u32) -> Vec<f32> {
        let mut resampler = Resampler::new(from, to);
        let mut out = Vec::new();
        for &sample in input {
            resampler.push(sample, |s| out.push(s));
        }
        out
    }

    fn tone(hz: f64, rate: u32, seconds: f64) -> Vec<f32> {
        let length = (seconds * f64::from(rate)) as usize;
        (0..length)
            .map(|i| (2.0 * PI * hz * i as f64 / f64::from(rate)).sin() as f32)
            .collect()
    }

    #[test]
    fn tone_keeps_level_and_comes_after_the_delay() {
        for rate in [
            8_000, 11_025, 16_000, 20_480, 22_050, 44_100, 48_000, 96_000,
        ] {
            let out = convert(&tone(700.0, rate, 0.2), rate, 20_480);
            assert!(
                (out.len() as i64 - 4096).abs() <= 2,
                "{rate}: {}",
                out.len()
            );
            let worst = (200..4000)
                .map(|n| {
                    let time_s = (n as f64 - DELAY as f64) / 20_480.0;
                    (f64::from(out[n]) - (2.0 * PI * 700.0 * time_s).sin()).abs()
                })
                .fold(0.0, f64::max);
            assert!(worst < 2e-3, "{rate} Hz: error {worst}");
        }
    }

    #[test]
    fn tone_above_the_band_is_removed() {
        let out = convert(&tone(13_000.0, 48_000, 0.2), 48_000, 20_480);
        let worst = out[200..].iter().fold(0.0f32, |w, s| w.max(s.abs()));
        assert!(worst < 0.01, "alias of {worst}");
    }

    #[test]
    fn output_knows_only_earlier_input() {
        let mut input = vec![0.0; 4410];
        let before = convert(&input, 44_100, 20_480);
        input[2205] = 1.0; // at 0.05 s, output sample 1024
        let after = convert(&input, 44_100, 20_480);
        let first = before.iter().zip(&after).position(|(a, b)| a != b);
        assert!(first.is_some_and(|n| n > 1024), "changed at {first:?}");
    }
}
