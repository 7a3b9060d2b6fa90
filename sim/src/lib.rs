//! Simulated servos, exact to the byte on a serial port and to the frame on CAN.
//!
//! ```text
//! any driver <-> port <-> SimBus thread <-> Line (servos on one wire) <-> firmware, motor, judge
//! ```
//!
//! A driver cannot tell [`SimBus`] from servos: registers, checksums, status errors,
//! return delay, bus watchdog and shutdown are there, and wire time is imposed. The
//! port is a pseudo-terminal, a Unix socket, a multicast group or a CAN interface
//! ([`SimLink`]). A judge counts, at the servo, every joint limit that goals or true
//! motion break ([`Violations`]).
//!
//! Fault injection: [`WireFault`] and [`ServoFault`] at a running bus, or a script of
//! them ([`parse_script`]).
//!
//! Units are radians, seconds, newton metres and amperes. Drivers are in
//! `servodance-drivers`; this crate takes from there registers and framing, and not the
//! bus drivers.
//!
//! ```
//! use servodance_drivers::{BusConfig, ServoConfig, open_bus, servos};
//! use servodance_sim::{SimBus, SimOptions, SimServoSpec};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let elbow = ServoConfig {
//! #     name: "elbow".into(), id: 1, model: "XM430-W350".into(), direction: 1, zero_deg: 180.0,
//! #     lower_deg: -90.0, upper_deg: 90.0, velocity_deg_s: 230.0, acceleration_deg_s2: 2300.0,
//! #     ..Default::default()
//! # };
//! let servos = servos(&[elbow])?; // one joint of a robot file
//! let specs: Vec<SimServoSpec> = servos.iter().map(Into::into).collect();
//! let sim = SimBus::start(&specs, SimOptions::lockstep(1_000_000, 100.0))?;
//! let config = BusConfig {
//!     reply_clock: sim.reply_clock(),
//!     ..BusConfig::dynamixel2(1_000_000)
//! };
//! let states = open_bus(&sim.port(), &config, servos)?.observe()?; // a ping, and the position
//! assert!(states[0].position_rad.abs() < 1e-3);
//! # Ok(())
//! # }
//! ```

mod bus;
pub mod can;
mod error;
mod fault;
mod imu;
mod judge;
mod serial;
mod servo;
pub mod world;

pub use bus::SimBus;
pub use bus::line::{Burst, Line};
pub use bus::options::{SimClock, SimLink, SimOptions};
pub use bus::shared::WireStats;
pub use error::SimError;
pub use fault::script::{Cue, Happening, happen, parse_happening, parse_script};
pub use fault::{ServoFault, WireFault};
pub use imu::SimImu;
pub use judge::Violations;
pub use serial::protocol1_line::Protocol1Line;
pub use serial::protocol2_line::Protocol2Line;
pub use serial::protocol2_packet::status;
pub use servo::body::SimServoState;
pub use servo::byte_servo::ByteServo;
pub use servo::dynamixel2::XServo;
pub use servo::spec::SimServoSpec;
