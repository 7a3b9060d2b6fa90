//! A codebook that learns by exponential moving averages: k-means before the
//! first use, codes that die out begun anew.
//!
//! A code is its moving sum over its moving count. A restart sets all three
//! together (with the sum left alone the next update would undo it), and takes
//! its rows from real frames alone, never from padding: the caller hands in no
//! other rows.

use rand::Rng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use crate::train::autodiff::lanes;
use crate::train::autodiff::matmul::{MatrixView, MatrixViewMut, Threads, WriteMode, product};

/// How codes follow the latents.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CodebookSettings {
    /// Share of the past that an update keeps.
    pub decay: f32,
    /// Moving count below which a code is restarted; 0 for never.
    pub dead_below: f32,
    /// Rounds of k-means before the first use.
    pub k_means_rounds: usize,
    /// Whether encoders and codes stay those that training begins with: the decoder alone learns,
    /// and a MotionSeq that knows these codes stays valid.
    pub fixed: bool,
}

impl Default for CodebookSettings {
    fn default() -> Self {
        Self { decay: 0.98, dead_below: 0.5, k_means_rounds: 20, fixed: false }
    }
}

/// Below this a moving count is taken to be this.
const LEAST_COUNT: f32 = 1e-5;
/// Rows that distances are made for at a time.
const PIECE_ROWS: usize = 1024;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LearnedCodebook {
    dim: usize,
    pub embed: Vec<f32>,
    /// Moving sums, [codes, dim].
    pub embed_avg: Vec<f32>,
    pub cluster_size: Vec<f32>,
}

impl LearnedCodebook {
    pub fn new(embed: Vec<f32>, dim: usize) -> Self {
        Self::with_counts(embed, dim, 1.0)
    }

    /// Each code counts as the mean of so many past rows.
    pub fn with_counts(embed: Vec<f32>, dim: usize, rows: f32) -> Self {
        let embed_avg = embed.iter().map(|e| e * rows).collect();
        Self { dim, embed_avg, cluster_size: vec![rows; embed.len() / dim], embed }
    }

    pub fn dim(&self) -> usize {
        self.dim
    }

    pub fn len(&self) -> usize {
        self.cluster_size.len()
    }

    pub fn code(&self, code: u32) -> &[f32] {
        &self.embed[code as usize * self.dim..][..self.dim]
    }

    /// Squared distances [rows, codes] less the square of the row, which is the same for all codes.
    pub fn distances(&self, x: &[f32]) -> Vec<f32> {
        let (rows, codes) = (x.len() / self.dim, self.len());
        let mut out = vec![0.0; rows * codes];
        let (x, e) =
            (MatrixView::of(x, rows, self.dim), MatrixView::of(&self.embed, codes, self.dim));
        product(
            MatrixViewMut::of(&mut out, rows, codes),
            WriteMode::Nothing,
            x,
            e.t(),
            Threads::All,
        );
        let squares: Vec<f32> = self.embed.chunks(self.dim).map(|c| lanes::dot(c, c)).collect();
        for row in out.chunks_mut(codes) {
            row.iter_mut().zip(&squares).for_each(|(d, s)| *d = s - 2.0 * *d);
        }
        out
    }

    /// The nearest code of each row; of several the first.
    pub fn nearest(&self, x: &[f32]) -> Vec<u32> {
        let pieces = x.chunks(PIECE_ROWS * self.dim);
        pieces.flat_map(|piece| self.nearest_in_piece(piece)).collect()
    }

    fn nearest_in_piece(&self, x: &[f32]) -> Vec<u32> {
        let distances = self.distances(x);
        distances.chunks(self.len()).map(first_smallest).collect()
    }

    /// The `count` nearest codes of one row, nearest first.
    pub fn neighbours(&self, row: &[f32], count: usize) -> Vec<u32> {
        let distances = self.distances(row);
        let mut order: Vec<u32> = (0..self.len() as u32).collect();
        order.sort_by(|a, b| distances[*a as usize].total_cmp(&distances[*b as usize]));
        order.truncate(count);
        order
    }

    /// First codes: k-means over the rows of `x`.
    pub fn k_means(&mut self, x: &[f32], rounds: usize, rng: &mut ChaCha8Rng) {
        let rows = x.len() / self.dim;
        let row = |r: usize| &x[r * self.dim..][..self.dim];
        let begin: Vec<usize> = match rows >= self.len() {
            true => index::sample(rng, rows, self.len()).into_vec(),
            false => (0..self.len()).map(|_| rng.random_range(0..rows)).collect(),
        };
        self.embed = begin.iter().flat_map(|r| row(*r)).copied().collect();
        for _ in 0..rounds {
            let (sums, counts) = self.gather(x, &self.nearest(x));
            for (code, count) in counts.iter().enumerate() {
                let at = code * self.dim..(code + 1) * self.dim;
                match *count > 0.0 {
                    true => self.embed[at.clone()]
                        .iter_mut()
                        .zip(&sums[at])
                        .for_each(|(e, s)| *e = s / count),
                    false => self.embed[at].copy_from_slice(row(rng.random_range(0..rows))),
                }
            }
        }
        *self = Self::new(std::mem::take(&mut self.embed), self.dim);
    }

    /// Sums and counts of the rows of each code.
    fn gather(&self, x: &[f32], nearest: &[u32]) -> (Vec<f32>, Vec<f32>) {
        let (mut sums, mut counts) = (vec![0.0; self.embed.len()], vec![0.0; self.len()]);
        for (row, code) in x.chunks(self.dim).zip(nearest) {
            lanes::add(&mut sums[*code as usize * self.dim..][..self.dim], row);
            counts[*code as usize] += 1.0;
        }
        (sums, counts)
    }

    /// A moving-average step over real rows, then dead codes restart at some; returns how many.
    pub fn update(
        &mut self,
        x: &[f32],
        nearest: &[u32],
        settings: &CodebookSettings,
        rng: &mut ChaCha8Rng,
    ) -> usize {
        let (sums, counts) = self.gather(x, nearest);
        let lerp = |from: &mut Vec<f32>, to: &[f32]| {
            let share = 1.0 - settings.decay;
            from.iter_mut().zip(to).for_each(|(a, b)| *a += share * (b - *a));
        };
        lerp(&mut self.cluster_size, &counts);
        lerp(&mut self.embed_avg, &sums);
        for (code, count) in self.cluster_size.iter().enumerate() {
            let at = code * self.dim..(code + 1) * self.dim;
            for (e, sum) in self.embed[at.clone()].iter_mut().zip(&self.embed_avg[at]) {
                *e = sum / count.max(LEAST_COUNT);
            }
        }
        let dead = |count: f32| count < settings.dead_below;
        let dead: Vec<usize> = (0..self.len()).filter(|c| dead(self.cluster_size[*c])).collect();
        for code in &dead {
            let row = rng.random_range(0..x.len() / self.dim);
            self.restart(*code, &x[row * self.dim..][..self.dim]);
        }
        dead.len()
    }

    /// Restarts a code: code, moving sum and moving count together.
    fn restart(&mut self, code: usize, row: &[f32]) {
        let at = code * self.dim..(code + 1) * self.dim;
        self.embed[at.clone()].copy_from_slice(row);
        self.embed_avg[at].copy_from_slice(row);
        self.cluster_size[code] = 1.0;
    }
}

fn first_smallest(row: &[f32]) -> u32 {
    let mut best = 0;
    for (at, value) in row.iter().enumerate() {
        if *value < row[best] {
            best = at;
        }
    }
    best as u32
}

/// Share of `total` codes that appear, and the perplexity of their frequencies.
pub(crate) fn usage(codes: &[u32], total: usize) -> (f64, f64) {
    let mut counts = vec![0.0; total];
    codes.iter().for_each(|code| counts[*code as usize] += 1.0);
    let all = codes.len().max(1) as f64;
    let used = counts.iter().filter(|c| **c > 0.0);
    let entropy: f64 = used.clone().map(|c| -(c / all) * (c / all).ln()).sum();
    (used.count() as f64 / total as f64, entropy.exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::autodiff::parameters::normal;
    use rand::SeedableRng;

    const DIM: usize = 4;

    /// Rows in 32 tight clusters; the clusters of later steps lie elsewhere, as
    /// latents do while the encoder learns.
    fn rows(rng: &mut ChaCha8Rng, step: usize) -> Vec<f32> {
        let count = 512;
        (0..count)
            .flat_map(|_| {
                let cluster = rng.random_range(0..32usize);
                let bit = move |b: usize| if cluster >> b & 1 == 1 { 1.0 } else { -1.0 };
                let drift = 0.02 * step as f32;
                let fifth = 0.5 * bit(4);
                let noise: Vec<f32> = (0..DIM).map(|_| 0.05 * normal(rng)).collect();
                (0..DIM).map(move |b| 3.0 * bit(b) + fifth + drift + noise[b])
            })
            .collect()
    }

    /// Share of codes used at the end of 200 updates that begin from codes far
    /// from all rows but one.
    fn used_at_the_end(dead_below: f32) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut book =
            LearnedCodebook::new((0..32 * DIM).map(|_| 40.0 + normal(&mut rng)).collect(), DIM);
        let settings = CodebookSettings { dead_below, ..CodebookSettings::default() };
        let mut nearest = Vec::new();
        for step in 0..200 {
            let x = rows(&mut rng, step);
            nearest = book.nearest(&x);
            book.update(&x, &nearest, &settings, &mut rng);
        }
        usage(&nearest, book.len()).0
    }

    #[test]
    fn restarted_codes_stay_alive_and_are_used() {
        let (without, with) = (used_at_the_end(0.0), used_at_the_end(0.5));
        assert!(without < 0.1 && with > 0.4, "{without} without restarts, {with} with");
    }

    #[test]
    fn a_restart_survives_the_next_update() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut book = LearnedCodebook::new(vec![0.0, 0.0, 9.0, 9.0], 2);
        book.cluster_size = vec![8.0, 0.01];
        let settings = CodebookSettings::default();
        let x = [[0.1, 0.1], [0.2, 0.0], [0.1, 0.2]].concat();
        let restarted = book.update(&x, &book.nearest(&x), &settings, &mut rng);
        assert_eq!(restarted, 1);
        assert!(x.chunks(2).any(|row| row == book.code(1)), "{book:?}");
        assert_eq!(
            (book.embed_avg[2..].to_vec(), book.cluster_size[1]),
            (book.code(1).to_vec(), 1.0)
        );
        // Unused in the next update: its sum and its count shrink alike.
        let before = book.code(1).to_vec();
        book.update(&[7.0, 7.0], &[0], &settings, &mut rng);
        for (a, b) in before.iter().zip(book.code(1)) {
            assert!((a - b).abs() < 1e-6, "{before:?} became {:?}", book.code(1));
        }
    }

    #[test]
    fn k_means_finds_the_clusters() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let x = rows(&mut rng, 0);
        let mut book = LearnedCodebook::new(vec![0.0; 32 * DIM], DIM);
        book.k_means(&x, 20, &mut rng);
        let nearest = book.nearest(&x);
        let error: f32 = x
            .chunks(DIM)
            .zip(&nearest)
            .map(|(row, code)| {
                let apart = row.iter().zip(book.code(*code)).map(|(a, b)| (a - b) * (a - b));
                apart.sum::<f32>()
            })
            .sum();
        let per_row = error / nearest.len() as f32;
        // Rows are 37 long on average, squared; two neighbouring clusters that
        // share a code cost 1 a row.
        assert!(per_row < 0.6, "{per_row}");
    }

    #[test]
    fn usage_counts_codes_and_their_evenness() {
        assert_eq!(usage(&[0, 0, 1, 1], 4), (0.5, 2.0));
        let (used, perplexity) = usage(&[2, 2, 2], 4);
        assert_eq!((used, perplexity), (0.25, 1.0));
    }
}
