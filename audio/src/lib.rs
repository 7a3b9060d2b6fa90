//! Music in: from recordings, raw samples or a microphone to music features and
//! beats, 20 frames a second, causally.
//!
//! | module | part |
//! |---|---|
//! | [`source`] | [`AudioSource`]: decoded files, raw PCM, live sound as mono blocks |
//! | [`capture`] | microphones: ring behind the callback, stalls, reconnection |
//! | `features` | [`Resampler`], spectra, MFCC, chroma, onset strength, music detection |
//! | [`beats`] | tempo, phase, meter, place in the bar; causal and offline trackers |
//! | [`playback`] | a song out of a loudspeaker, in step with the robot |
//! | [`song`] | songs and noises rendered by code, with known beats |
//! | `analyzer` | [`MusicAnalyzer`]: all of the analysis behind `push` and `pop` |
//!
//! Units: seconds since the first sample, hertz, beats a minute, decibels;
//! samples are mono, -1 to 1. Not here: motion (`model`) and the timing of live
//! sound against servos (the binary).
//!
//! ```
//! use servodance_audio::{MusicAnalyzer, song::{SongSpec, Style}};
//!
//! let mut spec = SongSpec::random(14.0, 1)?;
//! spec.style = Style::House;
//! let song = spec.render()?;
//! let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz)?;
//! analyzer.push(&song.samples);
//! let last = std::iter::from_fn(|| analyzer.pop()).last().expect("frames");
//! let true_bpm = 60.0 / (song.beats_s[1] - song.beats_s[0]);
//! assert!((f64::from(last.beat.tempo_bpm) / true_bpm - 1.0).abs() < 0.03);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod analyzer;
pub mod beats;
pub mod capture;
mod features;
pub mod playback;
pub mod song;
pub mod source;

pub use analyzer::{AnalyzerError, MusicAnalyzer};
pub use beats::TempoRange;
pub use features::ANALYSIS_RATE_HZ;
pub use features::mfcc::bands;
pub use features::resampler::Resampler;
pub use source::AudioSource;
