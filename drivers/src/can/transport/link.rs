//! One open way to a CAN bus: it moves frames and reports what the controller says.
//!
//! A link waits for nothing but its deadline, does not try again, and knows no motors.

use std::io;
use std::time::Instant;

use super::frame::CanFrame;

/// Whether a link took a frame that was offered to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// The controller or adapter took it.
    Taken,
    /// No room in the transmit queue (ENOBUFS): nothing was sent, try again
    /// when a frame's time has passed.
    Full,
}

/// What a link received within its deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanEvent {
    /// A frame of another node, or an echo of our own.
    Frame(CanFrame),
    /// The controller reports a fault of the bus.
    Fault(CanFault),
    /// Neither frame nor fault came within the deadline.
    Nothing,
}

/// A fault of the bus that a CAN controller or adapter reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanFault {
    /// Error counters are high (warning level).
    Warning,
    /// The controller may no longer disturb others: it is close to bus-off.
    Passive,
    /// A damaged frame was seen, or nobody acknowledged one.
    Error,
    /// Frames came faster than they were fetched; some are lost.
    Overrun,
    /// The adapter refused or lost a frame that it was to send.
    Rejected,
    /// The controller has left the bus. Nothing gets through until it restarts.
    BusOff,
}

/// A way to a CAN bus. Opened for this program; closed when dropped.
pub trait CanLink: Send {
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
