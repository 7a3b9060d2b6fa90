//! Music in: recordings or raw samples to timed blocks, features and beats.
//!
//! [`MusicAnalyzer`] turns samples into [`MusicFrame`](servodance_types::MusicFrame)s,
//! causally, 20 times a second; an [`AudioSource`] brings the samples. [`song`] renders music by code with known beats.

mod analyzer;
pub mod beats;
pub mod capture;
mod chroma;
pub mod noise;
mod onset;
mod presence;
mod resample;
pub mod song;
pub mod source;
mod spectral;
mod spectrum;

pub use analyzer::{ANALYSIS_RATE_HZ, AnalyzerError, MusicAnalyzer};
pub use resample::Resampler;
pub use source::AudioSource;
pub use spectral::{ENVELOPE_UNIT_DB, LEVEL_UNIT_DB, MFCC_UNIT, bands};
