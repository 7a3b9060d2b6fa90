//! MAGMA: music features to motion tokens to 22-joint motion.
//!
//! [`Generator`] holds the trained networks; a [`Dance`] takes a music frame and
//! gives a motion frame, 20 times a second, known only from the music so far.
//! [`Codec`] turns recorded motion into tokens and back.
//!
//! | module | part |
//! |---|---|
//! | `generator` | the step from music to motion: drawing, stalls, standing feet, bounds of the floor |
//! | [`motionseq`], [`vqvae`] | the two networks: music and past codes to the next codes; codes to motion |
//! | [`engine`] | what computes them, and which engine runs where: kernels, KV cache, ALiBi, candle |
//! | `sampling` | temperature, top-k, top-p, repetition penalty |
//! | [`conditioning`] | style conditioning; Encodec latents and CLIP texts from public checkpoints |
//! | [`config`], [`weights`] | sizes; weights files and number formats |
//! | [`motion`] | skeleton, clips, the 137 numbers a frame |
//!
//! Units: metres, seconds, radians; y up. Not here: music features (`audio`), joint
//! angles of a robot (`retarget`), training and import of motion (`training`).
//!
//! ```
//! use servodance_model::{Generator, GeneratorOptions};
//! use servodance_types::{Beat, BodyJoint, MusicFrame};
//!
//! let generator = Generator::built_in()?;
//! let mut dance = generator.start(GeneratorOptions::default())?;
//! for k in 0..20 {
//!     let time_s = f64::from(k) / 20.0;
//!     let phase = (2.0 * time_s % 1.0) as f32; // 120 beats a minute
//!     let beat = Beat { phase, tempo_bpm: 120.0, confidence: 1.0, ..Beat::default() };
//!     let motion = dance.step(&MusicFrame { time_s, beat, presence: 1.0, ..MusicFrame::default() })?;
//!     assert!((0.3..1.5).contains(&motion.position(BodyJoint::Pelvis)[1]));
//! }
//! # Ok::<(), servodance_model::ModelError>(())
//! ```

pub mod conditioning;
pub mod config;
pub mod engine;
mod error;
mod generator;
pub mod motion;
pub mod motionseq;
mod sampling;
// The reference is candle.
#[cfg(all(test, feature = "candle"))]
mod tests;
pub mod vqvae;
pub mod weights;

pub use conditioning::NO_STYLE;
pub use engine::{EngineKind, EngineOptions};
pub use error::ModelError;
pub use generator::{AtEnd, Dance, Generator, GeneratorOptions, Likelihood};
#[cfg(feature = "motion-files")]
pub use vqvae::Codec;
pub use weights::Dtype;

/// The weights file that is part of this library: `q8_0`, without encoders.
pub fn built_in_weights() -> &'static [u8] {
    weights::BUILT_IN
}
