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
pub(crate) mod dance_step;
pub(crate) mod dancer;
pub(crate) mod dancer_thread;
pub mod feature_extractor;
pub(crate) mod load_shedding;
pub mod microphone;
pub mod model_args;
pub(crate) mod motion_source;
#[cfg_attr(not(feature = "view"), allow(dead_code))] // only a page has one
pub(crate) mod page_sound;
pub(crate) mod shared_pipe;
pub mod song_sound;
pub mod speaker;
pub(crate) mod stage_source;
pub mod step_times;
