//! Training data: [`import`] brings motion of other programs into a folder of
//! clips, [`DatasetReport`] describes the folder, and [`build`] writes the training
//! file with motion, music and splits.
//!
//! Captured motion has no music here, so music is rendered on its beats, or on
//! the beats that a choreography is then made for. The features are those that
//! a live dancer hears: causal, from [`MusicAnalyzer`](servodance_audio::MusicAnalyzer).
//! Same options and data: the same numbers. Offline; minutes of work.

mod build;
mod captured;
pub mod clip_entry;
mod error;
mod feature_args;
mod figures;
mod import;
pub mod index;
mod music;
mod options;
mod report;
mod sources;
mod splits;
pub(crate) mod styles;
mod synthetic;
mod tilted;
pub mod training_file;

pub use build::build;
pub use clip_entry::Split;
pub use error::DatasetError;
pub use feature_args::FeatureArgs;
pub use import::{ImportRequest, ImportSummary, import};
pub(crate) use music::on_beats as rendered_on;
pub use options::{DatasetOptions, DatasetSummary};
pub use report::DatasetReport;
pub use styles::STYLES;
