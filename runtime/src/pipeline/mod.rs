//! From sound to motion: audio in, feature extractor, generator, one motion frame every 50 ms.
//!
//! ```text
//! audio input -> feature extractor -> dancer -> motion source -> control loop
//! ```
//!
//! A recording ends, a pipe may pause, a microphone may stall: `audio_input` says what
//! happens. `load_shedding` decides what is left out while the machine is too slow.

pub mod audio_input;
pub mod conditioning;
pub mod feature_extractor;
pub mod load_shedding;
pub mod microphone;
pub mod motion_source;
pub mod stage_source;
pub mod step_times;
