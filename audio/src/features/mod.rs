//! Signal processing under the analyzer: resampling, spectra, onset strength,
//! the 35 features of AIST++, and the detection of music.
//!
//! | file | computes |
//! |---|---|
//! | `resampler` | any rate to [`ANALYSIS_RATE_HZ`], with a known delay |
//! | `spectrum`, `filter_bank` | power spectra, mel bands |
//! | `onset_strength` | spectral flux, 160 values a second: input of the beat tracker |
//! | `note_onset` | rise of each semitone, 80 a second: the network hears chords by it |
//! | `mfcc` | onset envelope, 20 MFCC, onset peak; assembles the feature vector |
//! | `chroma_cens` | 12 chroma values (CENS) |
//! | `music_detector` | probability of music against silence, speech and noise |
//! | `small_beat_network` | beats for the onsets' own tracker |

mod chroma_cens;
mod filter_bank;
pub(crate) mod mfcc;
pub(crate) mod music_detector;
pub(crate) mod note_onset;
pub(crate) mod onset_strength;
pub(crate) mod resampler;
pub(crate) mod small_beat_network;
pub(crate) mod spectrum;

/// Sample rate inside the analysis, hertz. Live sources deliver this rate, so
/// that their sound is resampled once.
pub const ANALYSIS_RATE_HZ: u32 = 20_480;
