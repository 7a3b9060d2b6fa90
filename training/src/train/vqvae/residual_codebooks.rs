//! The codebooks of one body part: each codes what those before it left of the latents
//! (residual vector quantisation).

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::codebook::{LearnedCodebook, usage};
use crate::train::autodiff::parameters::normal;
use crate::train::settings::TrainingSettings;
use servodance_model::config::ModelConfig;

/// A noisy code is one of so many nearest.
const NEAR: usize = 8;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ResidualCodebooks(pub Vec<LearnedCodebook>);

/// Codes of the rows of a batch, and what the latents are to learn from them.
pub(super) struct QuantisedRows {
    /// Vectors of the codes, added up over the levels; some of wrong codes.
    pub vectors: Vec<f32>,
    /// Of the commitment loss by the latents.
    pub gradient: Vec<f32>,
    pub commit: f64,
    /// Share of the codes of each level that were used.
    pub used: Vec<f64>,
}

impl ResidualCodebooks {
    /// Codes of a part at random; k-means comes before their first use.
    pub fn random(config: &ModelConfig, part: usize, rng: &mut ChaCha8Rng) -> Self {
        let count = config.codes * config.code_dim;
        let mut book =
            || LearnedCodebook::new((0..count).map(|_| normal(rng)).collect(), config.code_dim);
        Self((0..config.levels_of(part)).map(|_| book()).collect())
    }

    pub fn dim(&self) -> usize {
        self.0[0].dim()
    }

    /// The codes of each row, [level][row].
    pub fn nearest(&self, rows: &[f32]) -> Vec<Vec<u32>> {
        let mut left = rows.to_vec();
        let of_level = |book: &LearnedCodebook| {
            let codes = book.nearest(&left);
            subtract(book, &mut left, &codes);
            codes
        };
        self.0.iter().map(of_level).collect()
    }

    /// The vectors of codes [level][row].
    pub fn vectors(&self, codes: &[Vec<u32>]) -> Vec<f32> {
        let rows = codes.first().map_or(0, Vec::len);
        let mut out = vec![0.0; rows * self.dim()];
        for (book, codes) in self.0.iter().zip(codes) {
            for (row, code) in out.chunks_mut(book.dim()).zip(codes) {
                row.iter_mut().zip(book.code(*code)).for_each(|(sum, v)| *sum += v);
            }
        }
        out
    }

    /// First codes: k-means over the rows, level by level.
    pub fn k_means(&mut self, mut rows: Vec<f32>, rounds: usize, rng: &mut ChaCha8Rng) {
        for book in &mut self.0 {
            book.k_means(&rows, rounds, rng);
            let codes = book.nearest(&rows);
            subtract(book, &mut rows, &codes);
        }
    }

    /// Codes of real rows; moves the codebooks unless they are fixed.
    pub(super) fn quantise(
        &mut self,
        rows: &[f32],
        settings: &TrainingSettings,
        rng: &mut ChaCha8Rng,
    ) -> QuantisedRows {
        let zeros = || vec![0.0; rows.len()];
        let mut found =
            QuantisedRows { vectors: zeros(), gradient: zeros(), commit: 0.0, used: Vec::new() };
        let (noise, commit) = (settings.quantise.noise, settings.loss.commit);
        let share = 1.0 / rows.len() as f32;
        let mut left = rows.to_vec();
        for book in &mut self.0 {
            let nearest = book.nearest(&left);
            if !settings.codebook.fixed {
                book.update(&left, &nearest, &settings.codebook, rng);
            }
            let dim = book.dim();
            for (row, (code, z)) in nearest.iter().zip(left.chunks_mut(dim)).enumerate() {
                let at = row * dim..(row + 1) * dim;
                let shown = match rng.random::<f32>() < noise {
                    true => book.neighbours(z, NEAR)[rng.random_range(0..NEAR.min(book.len()))],
                    false => *code,
                };
                let vector = found.vectors[at.clone()].iter_mut();
                vector.zip(book.code(shown)).for_each(|(sum, v)| *sum += v);
                let gradient = found.gradient[at].iter_mut();
                for ((g, z), c) in gradient.zip(z).zip(book.code(*code)) {
                    *z -= c;
                    found.commit += f64::from(*z * *z * share);
                    *g += 2.0 * commit * *z * share;
                }
            }
            found.used.push(usage(&nearest, book.len()).0);
        }
        found
    }
}

/// What the codes leave of the rows.
fn subtract(book: &LearnedCodebook, rows: &mut [f32], codes: &[u32]) {
    for (row, code) in rows.chunks_mut(book.dim()).zip(codes) {
        row.iter_mut().zip(book.code(*code)).for_each(|(left, v)| *left -= v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn rows(rng: &mut ChaCha8Rng) -> Vec<f32> {
        (0..4000).map(|_| normal(rng)).collect()
    }

    fn error(books: &ResidualCodebooks, rows: &[f32]) -> f32 {
        let vectors = books.vectors(&books.nearest(rows));
        rows.iter().zip(&vectors).map(|(a, b)| (a - b) * (a - b)).sum::<f32>() / rows.len() as f32
    }

    #[test]
    fn a_second_level_codes_what_the_first_one_left() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let rows = rows(&mut rng);
        let tiny = ModelConfig::preset("tiny").unwrap();
        let config = ModelConfig { codes: 16, code_dim: 4, ..tiny };
        let mut two = ResidualCodebooks::random(&config, 0, &mut rng);
        two.k_means(rows.clone(), 20, &mut rng);
        let one = ResidualCodebooks(two.0[..1].to_vec());
        let (one, two) = (error(&one, &rows), error(&two, &rows));
        assert!(two < 0.5 * one, "{one} with one level, {two} with two");
    }
}
