//! Fault injection: what goes wrong on the wire, in a servo, at the adapter.
//!
//! Wire faults hit a share of the replies, chosen by a seeded generator, so
//! that a run in lockstep can be repeated.

pub(crate) mod random;
pub(crate) mod script;
pub(crate) mod wire;

/// A fault of the wire: something that happens to replies or instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WireFault {
    /// The reply never arrives.
    Drop,
    /// The reply comes late by this much wall time, seconds.
    Late(f64),
    /// One bit of the reply is flipped.
    Corrupt,
    /// The end of the reply is missing.
    Truncate,
    /// The reply arrives twice.
    Duplicate,
    /// Random bytes arrive before the reply.
    Noise,
    /// The host receives its own instruction before the reply, as on adapters
    /// that do not control the direction.
    Echo,
    /// A packet is lost, of the host or of a servo.
    Lose,
    /// One bit is flipped in this share of the **bytes**, of the host and of the servos.
    Bytes,
    /// One bit of the host's instruction is flipped on its way to the servos.
    CorruptInstruction,
}

/// A fault of one servo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ServoFault {
    /// Its cable is cut: it neither receives nor answers, and goes on as it was.
    Dead,
    /// Its cable is mended: it receives and answers again.
    Revive,
    /// It restarts: silent for 0.3 s, then without torque.
    Reboot,
    /// Its winding is this hot, Celsius.
    Overheat(f64),
    /// Its shaft is held; it will overload in time.
    Jam,
    /// Its shaft is free again.
    Free,
    /// It shuts down from overload now.
    Overload,
    /// It shuts down now and reports these bits of its error byte. Servos of byte memory alone.
    Flags(u8),
    /// Its own watchdog stops it now, if it has one.
    Trip,
    /// Its supply changes, volts.
    Supply(f64),
    /// The limp joint is turned by hand, to this many radians.
    Moved(f64),
    /// It is set to another rate than the bus: it receives garbage and stays silent.
    Baud(u32),
    /// It answers to another id; if that one is taken, both answer at once.
    Id(u8),
    /// Its plug is pulled: no supply, so no torque, and it neither hears nor answers.
    Unplug,
    /// It is plugged in: it starts with what its permanent memory holds.
    Plug,
    /// Its memory is that of a servo out of the box: factory settings, id 1, the factory's
    /// rate. Serial servos alone.
    New,
}
