//! Melodies: motifs of rhythm cells, repeated from bar to bar, on the scale.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::harmony::Harmony;

/// A note of a motif: beats from the bar, length in beats, whether it is swung.
#[derive(Clone, Copy)]
pub struct Cell {
    pub at: f64,
    pub length: f64,
    pub swung: bool,
}

/// Lengths in beats; negative rests.
fn cells(rhythm: &str, rng: &mut ChaCha8Rng) -> &'static [f64] {
    const THIRD: f64 = 1.0 / 3.0;
    let choice: &[&[f64]] = match rhythm {
        "plain" => &[&[1.0], &[1.0], &[1.0], &[2.0], &[0.5, 0.5]],
        "syncopated" => &[
            &[0.5, 1.0, 0.5],
            &[0.75, 0.75, 0.5],
            &[0.5, 0.5],
            &[-0.5, 0.5],
            &[-0.5, 1.0, 0.5],
            &[1.0],
            &[1.5, 0.5],
            &[0.25, 0.5, 0.25],
            &[0.5, 0.5, 0.5, 1.0, 0.5],
            &[-1.0],
            &[0.5, 0.5, -0.5, 1.5],
        ],
        "triplet" => &[
            &[THIRD, THIRD, THIRD],
            &[1.0],
            &[2.0 * THIRD, THIRD],
            &[2.0],
            &[2.0 * THIRD, 2.0 * THIRD, 2.0 * THIRD],
            &[0.5, 0.5],
        ],
        "compound" => &[
            &[THIRD, THIRD, THIRD],
            &[THIRD, THIRD, THIRD],
            &[2.0 * THIRD, THIRD],
            &[2.0 * THIRD, THIRD],
            &[1.0],
            &[2.0],
            &[0.5, 0.5 * THIRD, THIRD],
        ],
        "running" => &[
            &[0.5, 0.5],
            &[0.5, 0.5],
            &[0.25, 0.25, 0.25, 0.25],
            &[0.25, 0.25, 0.25, 0.25],
            &[0.5, 0.25, 0.25],
            &[1.0],
        ],
        _ => &[
            &[1.0],
            &[1.0],
            &[0.5, 0.5],
            &[0.5, 0.5],
            &[1.5, 0.5],
            &[2.0],
            &[0.75, 0.25],
            &[0.5, 0.25, 0.25],
            &[-1.0],
            &[3.0],
            &[-0.5, 0.5],
        ],
    };
    choice[rng.random_range(0..choice.len())]
}

/// The rhythm of one bar.
fn bar_rhythm(beats: usize, rhythm: &str, rng: &mut ChaCha8Rng) -> Vec<Cell> {
    let triplets = ["triplet", "compound"].contains(&rhythm);
    let mut bar = Vec::new();
    let mut at = 0.0;
    while at < beats as f64 - 1e-6 {
        for &length in cells(rhythm, rng) {
            if length > 0.0 && at < beats as f64 - 1e-6 {
                bar.push(Cell {
                    at,
                    length: length.min(beats as f64 - at + 0.5),
                    swung: !triplets,
                });
            }
            at += length.abs();
        }
        at = at.round().max(1.0);
    }
    bar
}

/// A phrase of four bars in which bars come again.
pub struct Phrase {
    bars: [Vec<Cell>; 4],
    contour: [i32; 32],
}

impl Phrase {
    pub fn draw(beats: usize, rhythm: &str, rng: &mut ChaCha8Rng) -> Self {
        let [a, b, c] = [(); 3].map(|()| bar_rhythm(beats, rhythm, rng));
        let bars = match rng.random_range(0..5) {
            0 => [a.clone(), a.clone(), a.clone(), b],
            1 => [a.clone(), b.clone(), a.clone(), c],
            2 => [a.clone(), b.clone(), a, b],
            3 => [a.clone(), a.clone(), b.clone(), c],
            _ => [a.clone(), a.clone(), a.clone(), a],
        };
        let mut step = 0;
        let contour = std::array::from_fn(|_| {
            step = (step + rng.random_range(-2..=2)).clamp(-5, 8);
            step
        });
        Self { bars, contour }
    }

    /// The cells of a bar with their keys above the tonic.
    pub fn bar(&self, bar: usize, beats: usize, harmony: &Harmony) -> Vec<(Cell, i32)> {
        let cells = self.bars[bar % 4].iter().enumerate();
        let keys = cells.map(|(i, cell)| {
            let step = self.contour[(8 * (bar % 2) + i) % 32];
            let place = bar as f64 + cell.at / beats as f64;
            let strong = cell.at.fract() < 1e-6;
            let step = if strong { harmony.nearest_chord_step(place, step) } else { step };
            (*cell, harmony.key(step))
        });
        keys.collect()
    }
}
