//! Simulated servos behind a serial port, exact to the byte.
//!
//! ```text
//! any driver <-> /dev/pts/N <-> SimBus thread <-> line (packets) <-> servos (table, loops, motor)
//!                                                                      `-> judge (limits)
//! ```
//!
//! A driver cannot tell [`SimBus`] from servos: control table, checksums,
//! status errors, return delay, bus watchdog and shutdown are there, and wire
//! time is imposed. The [`Judge`] counts, at the servo, every limit that a
//! joint was told to break or broke.
//!
//! Nothing here knows a bus driver's interface: this is the wire's far end.

mod bench;
mod bus;
pub mod can;
mod error;
mod fault;
mod judge;
mod script;
mod serial;
mod servo;

pub use bench::{BenchError, BusBench, bench_bus};
pub use bus::line::{Burst, Line};
pub use bus::options::{SimClock, SimLink, SimOptions};
pub use bus::{SimBus, WireStats};
pub use error::SimError;
pub use fault::{ServoFault, WireFault};
pub use judge::Violations;
pub use script::{Cue, Happening, happen, parse_script};
pub use serial::protocol1_line::Protocol1Line;
pub use serial::protocol2_line::Protocol2Line;
pub use serial::protocol2_packet::{
    BROADCAST, Instruction, Parsed, Parser, crc16, fast_status, status,
};
pub use servo::body::SimServoState;
pub use servo::byte_servo::ByteServo;
pub use servo::dynamixel2::XServo;
pub use servo::dynamixel2::table::{AccessError, Table};
pub use servo::spec::SimServoSpec;
