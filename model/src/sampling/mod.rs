//! From logits to a code: temperature, top-k, top-p, by a seeded generator.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::ModelError;

mod repetition_penalty;

pub(crate) use repetition_penalty::{PenaltyStrength, RepetitionPenalty};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sampling {
    /// Logits are divided by it; 0 takes the likeliest code.
    pub temperature: f32,
    /// Only the k likeliest codes; 0 is all.
    pub top_k: usize,
    /// Only the likeliest codes that hold this share of the probability, 0-1.
    pub top_p: f32,
    /// A code's logit falls by this times its share of the last frames.
    pub repetition: f32,
}

impl Sampling {
    pub fn checked(self) -> Result<Self, ModelError> {
        let refuse = |option, found: f32, expected| {
            Err(ModelError::Option { option, found: found.to_string(), expected })
        };
        if !(0.0..=10.0).contains(&self.temperature) {
            return refuse("temperature", self.temperature, "0 to 10");
        }
        if !(self.top_p > 0.0 && self.top_p <= 1.0) {
            return refuse("top_p", self.top_p, "above 0, up to 1");
        }
        if !(0.0..=20.0).contains(&self.repetition) {
            return refuse("repetition", self.repetition, "0 to 20");
        }
        Ok(self)
    }
}

/// Draws codes; the same seed draws the same codes on every machine that
/// computes the same logits.
#[derive(Clone, Debug)]
pub(crate) struct Sampler {
    sampling: Sampling,
    rng: ChaCha8Rng,
    order: Vec<u32>,
}

impl Sampler {
    /// A sampler at the beginning of its random sequence.
    pub fn new(sampling: Sampling, seed: u64) -> Result<Self, ModelError> {
        Ok(Self {
            sampling: sampling.checked()?,
            rng: ChaCha8Rng::seed_from_u64(seed),
            order: Vec::new(),
        })
    }

    pub fn reseed(&mut self, seed: u64) {
        self.rng = ChaCha8Rng::seed_from_u64(seed);
    }

    /// A number below `count` (which must not be 0), each equally likely.
    pub fn below(&mut self, count: usize) -> usize {
        self.rng.random_range(0..count)
    }

    /// One code. Logits that are not finite count as impossible; none if all are.
    pub fn draw(&mut self, logits: &[f32]) -> Option<usize> {
        let Sampling { temperature, top_k, top_p, .. } = self.sampling;
        let logit = |i: &u32| logits[*i as usize];
        let order = &mut self.order;
        order.clear();
        order.extend((0..logits.len() as u32).filter(|i| logit(i).is_finite()));
        order.sort_unstable_by(|a, b| logit(b).total_cmp(&logit(a)).then(a.cmp(b)));
        let best = *order.first()?;
        if temperature == 0.0 {
            return Some(best as usize);
        }
        if top_k > 0 {
            order.truncate(top_k);
        }
        let weight = |i: &u32| f64::from((logit(i) - logit(&best)) / temperature).exp();
        let held = nucleus(order, top_p, weight);
        let mut left = self.rng.random::<f64>() * held;
        for i in order.iter() {
            left -= weight(i);
            if left <= 0.0 {
                return Some(*i as usize);
            }
        }
        Some(best as usize)
    }
}

/// Cuts `order` where the likeliest codes hold `top_p` of all weight; gives
/// the weight that is left.
fn nucleus(order: &mut Vec<u32>, top_p: f32, weight: impl Fn(&u32) -> f64) -> f64 {
    let total: f64 = order.iter().map(&weight).sum();
    let mut held = 0.0;
    for (n, i) in order.iter().enumerate() {
        held += weight(i);
        if held >= total * f64::from(top_p) {
            order.truncate(n + 1);
            break;
        }
    }
    held
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampling(temperature: f32, top_k: usize, top_p: f32) -> Sampling {
        Sampling { temperature, top_k, top_p, repetition: 0.0 }
    }

    fn sampler(temperature: f32, top_k: usize, top_p: f32) -> Sampler {
        Sampler::new(sampling(temperature, top_k, top_p), 5).unwrap()
    }

    fn share_of(sampler: &mut Sampler, logits: &[f32], code: usize) -> f64 {
        let hits = (0..4000).filter(|_| sampler.draw(logits) == Some(code));
        hits.count() as f64 / 4000.0
    }

    #[test]
    fn codes_are_drawn_by_their_probability() {
        let logits = [0.0, 3f32.ln(), f32::NAN, f32::NEG_INFINITY];
        let share = share_of(&mut sampler(1.0, 0, 1.0), &logits, 1);
        assert!((share - 0.75).abs() < 0.03, "{share}");
    }

    #[test]
    fn temperature_flattens_and_zero_takes_the_likeliest() {
        let logits = [0.0, 2.0];
        let hot = share_of(&mut sampler(10.0, 0, 1.0), &logits, 1);
        assert!((hot - 0.55).abs() < 0.03, "{hot}");
        assert_eq!(share_of(&mut sampler(0.0, 0, 1.0), &logits, 1), 1.0);
    }

    #[test]
    fn top_k_and_top_p_leave_only_the_likeliest() {
        let logits = [1.0, 0.9, 0.0, 0.5];
        let mut by_k = sampler(1.0, 2, 1.0);
        let mut by_p = sampler(1.0, 0, 0.6);
        for _ in 0..500 {
            assert!(by_k.draw(&logits).unwrap() < 2);
            assert!(by_p.draw(&logits).unwrap() < 2);
        }
    }

    #[test]
    fn the_same_seed_draws_the_same_codes() {
        let draws = |seed| -> Vec<_> {
            let mut sampler = Sampler::new(sampling(1.0, 0, 1.0), seed).unwrap();
            (0..50).map(|_| sampler.draw(&[0.0; 64])).collect()
        };
        assert_eq!(draws(1), draws(1));
        assert_ne!(draws(1), draws(2));
    }

    #[test]
    fn impossible_options_are_refused_by_name() {
        let sampling = sampling(f32::NAN, 0, 1.0);
        let error = Sampler::new(sampling, 0).unwrap_err().to_string();
        assert!(error.contains("temperature"), "{error}");
        assert!(sampling.checked().is_err());
        assert_eq!(sampler(1.0, 0, 1.0).draw(&[f32::NAN]), None);
    }
}
