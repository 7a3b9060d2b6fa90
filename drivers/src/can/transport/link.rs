//! One open way to a CAN bus: it moves frames and reports what the controller says.
//!
//! A link waits for nothing but its deadline, does not try again, and knows no motors.

use std::io;
use std::time::Instant;

use super::frame::CanFrame;

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    Taken,
    /// No room in the transmit queue (ENOBUFS): nothing was sent, try again
    /// when a frame's time has passed.
    Full,
}

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanEvent {
    Frame(CanFrame),
    Fault(CanFault),
    Nothing,
}

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanFault {
    Warning,
    Passive,
    Error,
    Overrun,
    Rejected,
    BusOff,
}

/// A way to a CAN bus. Opened for this program; closed when dropped.
pub trait CanLink: Send {
    /// Whether it carries CAN FD frames.
    fn carries_flexible(&self) -> bool {
        false
    }

    /// Offers one frame. Blocks for no longer than handing it over takes. A link
    /// may keep it until the next `receive`, to hand several over at once.
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sent>;

    /// Hands over what it has kept, as far as there is room.
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// The next frame or fault, waiting until `deadline` at most; with a
    /// deadline in the past, what is there already.
    fn receive(&mut self, deadline: Instant) -> io::Result<CanEvent>;
}
