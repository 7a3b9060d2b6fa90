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
mod body;
mod byte_servo;
pub mod can;
mod far_end;
mod fault;
mod host_port;
mod judge;
mod layout;
mod line;
mod motor;
mod packet;
mod protocol1_line;
mod roster;
mod script;
mod serial_line;
mod serial_server;
mod servo;
mod shared;
mod sim_bus;
mod spec;
mod table;
mod urgency;
mod world;

pub use bench::{BenchError, BusBench, bench_bus};
pub use body::SimServoState;
pub use byte_servo::ByteServo;
pub use fault::{ServoFault, WireFault};
pub use judge::{Judge, Violations};
pub use line::{Burst, Line, XLine};
pub use motor::Motor;
pub use packet::{BROADCAST, Instruction, Parsed, Parser, crc16, fast_status, status};
pub use protocol1_line::Protocol1Line;
pub use script::{Cue, Happening, happen, parse_script};
pub use servo::SimServo;
pub use sim_bus::{SimBus, WireStats};
pub use spec::{MODELS, ServoModel, SimClock, SimError, SimLink, SimOptions, SimServoSpec};
pub use table::{AccessError, Table};
pub use world::World;
