//! How likely the model finds a dance that is known: what a change of weights
//! costs, without drawing anything.

use servodance_types::MusicFrame;

use super::Generator;
use crate::conditioning::{HeardFrame, MusicKind};
use crate::error::ModelError;

/// What the model says of the codes of a dance, frame by frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Likelihood {
    /// Mean negative log likelihood of a frame, nats, all codes together.
    pub nll: f64,
    /// The likeliest codes of each frame, the past as it was danced.
    pub likeliest: Vec<Vec<usize>>,
}

impl Generator {
    /// Of codes ([`crate::Codec::encode`]) from the second frame on, each given
    /// those before it and the music up to it, in a style of the model.
    /// Fails for: weights that hear other features than these.
    pub fn likelihood(
        &self,
        codes: &[Vec<usize>],
        music: &[MusicFrame],
        style: Option<usize>,
    ) -> Result<Likelihood, ModelError> {
        let networks = &*self.networks;
        let seq = &networks.seq;
        let team = networks.engine.pool().team();
        let mut state = seq.start(1);
        seq.set_style(&mut state, seq.style(style));
        let mut found = Likelihood::default();
        let kind = self.music_kind();
        let (mut features, mut heard) = (Vec::new(), vec![0.0; kind.dim()]);
        for (pair, frame) in codes.windows(2).zip(&music[1..]) {
            if !HeardFrame::from(*frame).features(kind, &mut features) {
                return Err(ModelError::MusicKind {
                    wanted: kind.name(),
                    fed: MusicKind::default().name(),
                });
            }
            networks.normalise_music(&features, &mut heard);
            seq.step(&team, &mut state, &pair[0], &[Some(&heard)])?;
            let mut likeliest = Vec::with_capacity(pair[1].len());
            for (part, code) in pair[1].iter().enumerate() {
                let mut lanes = seq.logits(&team, &mut state, part, &pair[1])?;
                let logits = lanes.next().unwrap_or_default();
                let (nll, best) = surprise(logits, *code);
                found.nll += nll;
                likeliest.push(best);
            }
            found.likeliest.push(likeliest);
        }
        found.nll /= found.likeliest.len().max(1) as f64;
        Ok(found)
    }
}

/// Negative log probability of a code, and the likeliest one.
fn surprise(logits: &[f32], code: usize) -> (f64, usize) {
    let best = logits.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
    let (best, largest) = best.map_or((0, 0.0), |(i, v)| (i, f64::from(*v)));
    let sum: f64 = logits.iter().map(|v| (f64::from(*v) - largest).exp()).sum();
    (sum.ln() - (f64::from(logits[code]) - largest), best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surprise_is_the_log_of_the_probability() {
        let logits = [0.0, 3f32.ln(), 0.0];
        let (nll, best) = surprise(&logits, 0);
        assert!((nll - 5f64.ln()).abs() < 1e-6, "{nll}");
        assert_eq!(best, 1);
        assert!((surprise(&logits, 1).0 - (5f64 / 3.0).ln()).abs() < 1e-6);
    }
}
