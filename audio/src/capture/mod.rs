//! Live sound: microphones and other devices, and what keeps their sound steady.
//!
//! ```text
//! capture callback --(lock-free ring)--> LiveStream: one rate, the clock's pace
//!        ^ DeviceSupervisor: opened again    | silence while no sound arrives (stall)
//! ```
//!
//! `ring` copies only, so that its writer may run in a capture callback.
//! `live_stream` makes a mono stream that keeps to the wall clock whatever the
//! device does, so that music time goes on. `stall` says what a stalled input
//! does. What the user should know comes out as [`CaptureEvent`]s, once each.
//!
//! A queue, not a latest value: every sample counts for the beat. Sound that is
//! too old to be danced to is dropped by the stream, and reported.

mod clock;
mod event;
mod live_stream;
#[cfg(feature = "mic")]
mod microphone;
mod ring;
mod stall;
// Without microphones no device is opened twice; tests still run this code.
#[cfg_attr(not(feature = "mic"), allow(dead_code))]
mod supervisor;

pub use event::{CaptureEvent, CaptureStats};
#[cfg(feature = "mic")]
pub use microphone::{DeviceError, InputDevice, devices};

#[cfg(feature = "mic")]
pub(crate) use microphone::open_microphone;

pub(crate) use live_stream::{LIVE_RATE_HZ, LiveStream};
pub(crate) use ring::{RingFormat, RingWriter, ring};
pub(crate) use stall::InputKind;
pub(crate) use supervisor::DeviceSupervisor;

#[cfg(test)]
mod tests;
