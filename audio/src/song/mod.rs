//! Songs and noises rendered by code: free of rights, with known beats.
//!
//! A [`SongSpec`] says what to play; [`SongSpec::render`] gives a [`Song`]: mono
//! samples and the times of the beats in seconds. The same specification gives
//! the same samples on the same machine. Rendering is for tests, training data
//! and the built-in song ([`Song::demo`]), not for the audio thread: it allocates
//! the whole song.
//!
//! Refused: beat times that do not increase or lie outside 30-300 BPM, an
//! empty or endless duration, a sample rate below 8 kHz.

mod arrangement;
mod demo;
mod drums;
mod error;
mod grid;
mod mixer;
pub mod noise;
mod render;
mod spec;
mod style;
mod synth;

pub use error::SongError;
pub use grid::{Grid, TempoStep};
pub use mixer::Mix;
pub use render::Song;
pub use spec::{DEFAULT_RATE_HZ, Layers, MusicalKey, Section, SongSpec};
pub use style::Style;

#[cfg(test)]
mod tests;
