//! Keys, scales and progressions.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

const MAJOR: [i32; 7] = [0, 2, 4, 5, 7, 9, 11];
const MINOR: [i32; 7] = [0, 2, 3, 5, 7, 8, 10];
/// Scale degrees, a chord a bar.
const PROGRESSIONS: [&[usize]; 18] = [
    &[0, 4, 5, 3],
    &[0, 5, 3, 4],
    &[5, 3, 0, 4],
    &[0, 3, 4, 3],
    &[0, 0, 3, 4],
    &[1, 4, 0, 0],
    &[0, 5, 1, 4],
    &[2, 5, 1, 4],
    &[0, 3, 0, 4],
    &[0, 6, 5, 4],
    &[0, 6, 3, 0],
    &[0, 4],
    &[0, 3],
    &[0],
    &[0, 0, 0, 0, 3, 3, 0, 0, 4, 3, 0, 4],
    &[0, 4, 5, 2, 3, 0, 3, 4],
    &[0, 0, 4, 4, 4, 4, 0, 0],
    &[3, 4, 2, 5, 1, 4, 0, 0],
];

pub struct Harmony {
    tonic: i32,
    scale: [i32; 7],
    degrees: Vec<usize>,
    /// Bars a chord lasts: a half, one or two.
    bars: f64,
    seventh: bool,
}

impl Harmony {
    pub fn draw(tonic: i32, minor: bool, rng: &mut ChaCha8Rng) -> Self {
        let degrees = PROGRESSIONS[rng.random_range(0..PROGRESSIONS.len())].to_vec();
        let bars = [0.5, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0][rng.random_range(0..7)];
        Self {
            tonic,
            scale: if minor { MINOR } else { MAJOR },
            degrees,
            bars,
            seventh: rng.random_bool(0.3),
        }
    }

    fn degree(&self, bars: f64) -> usize {
        let chord = (bars.max(0.0) / self.bars + 1e-6) as usize;
        self.degrees[chord % self.degrees.len()]
    }

    /// The key of a step of the scale, octave by octave above the tonic.
    pub fn key(&self, step: i32) -> i32 {
        self.tonic + 12 * step.div_euclid(7) + self.scale[step.rem_euclid(7) as usize]
    }

    /// The keys of the chord at this place in bars, above the tonic.
    pub fn chord(&self, bars: f64) -> Vec<i32> {
        let root = self.degree(bars) as i32;
        let steps: &[i32] = if self.seventh { &[0, 2, 4, 6] } else { &[0, 2, 4] };
        steps.iter().map(|step| self.key(root + step)).collect()
    }

    /// Key of the chord's root, third (2), fifth (4) above the tonic.
    pub fn tone(&self, bars: f64, step: i32) -> i32 {
        self.key(self.degree(bars) as i32 + step)
    }

    /// A step of the scale that belongs to the chord and is nearest to `step`.
    pub fn nearest_chord_step(&self, bars: f64, step: i32) -> i32 {
        let root = self.degree(bars) as i32;
        let near = (step - 3)..=(step + 3);
        let fits = near.filter(|s| [0, 2, 4].contains(&(s - root).rem_euclid(7)));
        fits.min_by_key(|s| (s - step).abs()).unwrap_or(step)
    }
}
