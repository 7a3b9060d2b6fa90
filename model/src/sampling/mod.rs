//! From logits to a code: temperature, top-k, top-p, by a seeded generator.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::ModelError;

/// How codes are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
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
    /// Refuses what cannot be drawn from.
    pub fn checked(self) -> Result<Self, ModelError> {
        if !(0.0..=10.0).contains(&self.temperature) {
            return Err(ModelError::Option {
                option: "temperature",
                found: self.temperature.to_string(),
                expected: "0 to 10",
            });
        }
        if !(self.top_p > 0.0 && self.top_p <= 1.0) {
            return Err(ModelError::Option {
                option: "top_p",
                found: self.top_p.to_string(),
                expected: "above 0, up to 1",
            });
        }
        if !(0.0..=20.0).contains(&self.repetition) {
            return Err(ModelError::Option {
                option: "repetition",
                found: self.repetition.to_string(),
                expected: "0 to 20",
            });
        }
        Ok(self)
    }
}

/// Frames of which repetition is counted: two seconds.
const RECENT_FRAMES: usize = 40;

/// What was danced in the last two seconds, for less of it.
#[derive(Clone, Debug)]
pub struct Recent {
    codes: usize,
    /// How often each code of each part came.
    counts: Vec<u16>,
    /// Codes of the last frames, the oldest at `next`.
    frames: Vec<usize>,
    next: usize,
    filled: usize,
}

impl Recent {
    /// Nothing yet.
    pub fn new(parts: usize, codes: usize) -> Self {
        Self {
            codes,
            counts: vec![0; parts * codes],
            frames: vec![0; parts * RECENT_FRAMES],
            next: 0,
            filled: 0,
        }
    }

    /// Nothing again.
    pub fn clear(&mut self) {
        self.counts.fill(0);
        (self.next, self.filled) = (0, 0);
    }

    /// Counts the codes of a frame, one per part.
    pub fn push(&mut self, codes: &[usize]) {
        let slot = &mut self.frames[self.next * codes.len()..][..codes.len()];
        for (part, (old, new)) in slot.iter_mut().zip(codes).enumerate() {
            if self.filled == RECENT_FRAMES {
                self.counts[part * self.codes + *old] -= 1;
            }
            self.counts[part * self.codes + new] += 1;
            *old = *new;
        }
        self.next = (self.next + 1) % RECENT_FRAMES;
        self.filled = (self.filled + 1).min(RECENT_FRAMES);
    }

    /// Makes the codes of one part that came less likely.
    pub fn discourage(&self, part: usize, strength: f32, logits: &mut [f32]) {
        if strength == 0.0 {
            return;
        }
        let counts = &self.counts[part * self.codes..][..self.codes];
        for (logit, count) in logits.iter_mut().zip(counts) {
            *logit -= strength * f32::from(*count) / RECENT_FRAMES as f32;
        }
    }
}

/// Draws codes; the same seed draws the same codes on every machine that
/// computes the same logits.
#[derive(Clone, Debug)]
pub struct Sampler {
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

    /// Begins the random sequence of another seed.
    pub fn reseed(&mut self, seed: u64) {
        self.rng = ChaCha8Rng::seed_from_u64(seed);
    }

    /// A number below `count` (which must not be 0), each equally likely.
    pub fn below(&mut self, count: usize) -> usize {
        self.rng.random_range(0..count)
    }

    /// One code. Logits that are not finite count as impossible; none if all are.
    pub fn draw(&mut self, logits: &[f32]) -> Option<usize> {
        let Sampling {
            temperature,
            top_k,
            top_p,
            ..
        } = self.sampling;
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

    fn sampler(temperature: f32, top_k: usize, top_p: f32) -> Sampler {
        let sampling = Sampling {
            temperature,
            top_k,
            top_p,
            repetition: 0.0,
        };
        Sampler::new(sampling, 5).unwrap()
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
            let sampling = Sampling {
                temperature: 1.0,
                top_k: 0,
                top_p: 1.0,
                repetition: 0.0,
            };
            let mut sampler = Sampler::new(sampling, seed).unwrap();
            (0..50).map(|_| sampler.draw(&[0.0; 64])).collect()
        };
        assert_eq!(draws(1), draws(1));
        assert_ne!(draws(1), draws(2));
    }

    #[test]
    fn only_what_came_in_the_last_two_seconds_gets_less_likely() {
        let mut recent = Recent::new(2, 4);
        let logits_of = |recent: &Recent, part| {
            let mut logits = [1.0; 4];
            recent.discourage(part, 8.0, &mut logits);
            logits
        };
        (0..10).for_each(|_| recent.push(&[2, 0]));
        assert_eq!(logits_of(&recent, 0), [1.0, 1.0, -1.0, 1.0]);
        assert_eq!(logits_of(&recent, 1), [-1.0, 1.0, 1.0, 1.0]);
        (0..35).for_each(|_| recent.push(&[3, 0]));
        assert_eq!(logits_of(&recent, 0), [1.0, 1.0, 0.0, -6.0]);
        recent.clear();
        assert_eq!(logits_of(&recent, 1), [1.0; 4]);
    }

    #[test]
    fn impossible_options_are_refused_by_name() {
        let sampling = Sampling {
            temperature: f32::NAN,
            top_k: 0,
            top_p: 1.0,
            repetition: 0.0,
        };
        let error = Sampler::new(sampling, 0).unwrap_err().to_string();
        assert!(error.contains("temperature"), "{error}");
        assert!(sampling.checked().is_err());
        assert_eq!(sampler(1.0, 0, 1.0).draw(&[f32::NAN]), None);
    }
}
