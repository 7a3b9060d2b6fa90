//! Sound as it happens: a microphone, or raw samples that a program writes.
//!
//! ```text
//! capture callback --(lock-free ring)--> Listener: one rate, the clock's pace
//!        ^ opened again when lost             | silence while there is no sound
//! ```
//!
//! `link` is the ring: its writer only copies, so it may run in a capture
//! callback. `listener` turns what arrives into a mono stream at
//! [`ANALYSIS_RATE_HZ`](crate::ANALYSIS_RATE_HZ) that keeps to the wall clock
//! whatever the device does, so that music time goes on. What a user should
//! know comes out as [`Notice`]s, once each.
//!
//! A queue, not a latest value: every sample counts for the beat. What is too
//! old to be danced to is dropped by the listener, and said.

// Without a microphone nothing is opened twice, and tests still look at it.
#[cfg_attr(not(feature = "mic"), allow(dead_code))]
mod keeper;
mod link;
#[cfg_attr(not(feature = "mic"), allow(dead_code))]
mod listener;
#[cfg(feature = "mic")]
mod microphone;
mod notice;
mod pipe;

pub use notice::{CaptureStats, Notice};

#[cfg(feature = "mic")]
pub use microphone::{Device, devices};

#[cfg(feature = "mic")]
pub(crate) use microphone::listen_to_microphone;

pub(crate) use listener::{LIVE_RATE_HZ, Listener};
pub(crate) use pipe::listen_to_pipe;
