//! How a dance is generated, checked before it begins.

use crate::error::ModelError;
use crate::sampling::Sampling;

/// What follows when the model says that the sequence ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AtEnd {
    /// The next sequence, from the codes of the last frame: motion goes on.
    #[default]
    Chain,
    /// Nothing: [`crate::Dance::step`] gives [`ModelError::Ended`].
    Stop,
}

/// How a dance is generated.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneratorOptions {
    /// Seed of everything random.
    pub seed: u64,
    /// A name out of [`crate::Generator::styles`] or [`crate::NO_STYLE`];
    /// if left out, [`crate::Generator::default_style`].
    pub style: Option<String>,
    /// A style that is no name but a vector, as wide as the weights' styles
    /// ([`crate::conditioning::ClipText`]); it comes before a name.
    pub style_vector: Option<Vec<f32>>,
    /// 0 (always the likeliest) up to 10; above 1 is wild.
    pub temperature: f32,
    /// Only the k likeliest codes a frame; 0 is all.
    pub top_k: usize,
    /// Only the likeliest codes that hold this share of the probability.
    pub top_p: f32,
    /// How much less likely a code gets by being repeated, 0 (not at all) to 20:
    /// its logit falls by this times its share of the last two seconds.
    pub repetition: f32,
    /// How much less likely it gets to go on as the last time that the dancer
    /// moved like now, 0 (not at all) to 20: so much a logit falls at most.
    pub variety: f32,
    /// How much likelier a code gets that came a bar before in the same phrase, 0 (not at all)
    /// to 20. `variety` counts half within a phrase.
    pub bar_repeat: f32,
    /// How much larger and faster the motion gets in loud music, smaller and slower in soft, 0
    /// (not at all) to 2.
    pub dynamics: f32,
    /// How much the motion slows down on beats and is fast between them, beyond what the model
    /// learned, 0 (not at all) to 5: the difference of the logits of a code whose speed is one
    /// standard deviation from the mean. Decoders of the paper's size go without.
    pub beat_emphasis: f32,
    /// Classifier-free guidance, away from a dance to no music in no style: 1 is off, above 1
    /// follows music and style more and takes some more time.
    pub guidance: f32,
    /// For models that know an end.
    pub at_end: AtEnd,
}

impl Default for GeneratorOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            style: None,
            style_vector: None,
            temperature: 0.9,
            top_k: 0,
            top_p: 0.95,
            repetition: 4.0,
            variety: 9.0,
            bar_repeat: 3.5,
            dynamics: 1.0,
            beat_emphasis: 0.7,
            guidance: 1.5,
            at_end: AtEnd::Chain,
        }
    }
}

impl GeneratorOptions {
    /// Refuses a style vector that is not `style_dim` wide or not finite, and
    /// numbers out of range, except those of [`Self::sampling`].
    pub(super) fn check(&self, style_dim: usize) -> Result<(), ModelError> {
        if let Some(vector) = &self.style_vector
            && (vector.len() != style_dim || vector.iter().any(|v| !v.is_finite()))
        {
            return Err(ModelError::StyleWidth { found: vector.len(), expected: style_dim });
        }
        let ranges = [
            ("guidance", self.guidance, 0.0..=10.0, "0 to 10"),
            ("variety", self.variety, 0.0..=20.0, "0 to 20"),
            ("bar_repeat", self.bar_repeat, 0.0..=20.0, "0 to 20"),
            ("dynamics", self.dynamics, 0.0..=2.0, "0 to 2"),
            ("beat_emphasis", self.beat_emphasis, 0.0..=5.0, "0 to 5"),
        ];
        for (option, found, range, expected) in ranges {
            if !range.contains(&found) {
                return Err(ModelError::Option { option, found: found.to_string(), expected });
            }
        }
        Ok(())
    }

    pub(super) fn sampling(&self) -> Sampling {
        Sampling {
            temperature: self.temperature,
            top_k: self.top_k,
            top_p: self.top_p,
            repetition: self.repetition,
        }
    }
}
