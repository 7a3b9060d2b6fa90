//! Servo buses: joint targets out, joint states in, once a control cycle.
//!
//! ```text
//! targets (rad) -> SafeBus (limits, staleness, torque off) -> Bus -> wire
//! ```
//!
//! [`Bus`] is one bus of servos; [`SerialBus`] drives Dynamixel (Protocol 2.0 and
//! 1.0) and Feetech STS servos; [`can`] has the motors on CAN; [`Ros2Bus`] is a
//! robot whose own controller listens on ROS 2; [`BusSet`] runs several buses side by side. [`SafeBus`] wraps any bus, and programs that move
//! real motors hand their targets to it and never to a bus directly.
//!
//! ```
//! use servodance_drivers::{BusConfig, SafeBus, SafetyConfig, SerialBus, ServoConfig, servos};
//! use servodance_sim::{SimBus, SimOptions};
//!
//! let joint: ServoConfig = toml::from_str(
//!     r#"name = "neck"
//!     id = 1
//!     model = "XL430-W250"
//!     direction = 1
//!     zero_deg = 180.0
//!     lower_deg = -60.0
//!     upper_deg = 60.0
//!     velocity_deg_s = 200.0
//!     acceleration_deg_s2 = 2000.0"#,
//! )?;
//! let servos = servos(&[joint])?;
//! let sim = SimBus::start(&[(&servos[0]).into()], SimOptions::lockstep(1_000_000, 100.0))?;
//! let mut config = BusConfig::dynamixel2(1_000_000);
//! config.reply_clock = sim.reply_clock(); // a real port has none: leave this out
//! let bus = SerialBus::open(sim.port_path(), &config, servos)?;
//! let mut bus = SafeBus::new(bus, SafetyConfig::at_hz(100.0))?;
//! let mut states = bus.arm(0.0)?.states;
//! for cycle in 0..400 {
//!     bus.command(f64::from(cycle) * 0.01, &[0.3]);
//!     bus.tick(f64::from(cycle) * 0.01, &mut states)?;
//!     sim.advance(0.01);
//! }
//! assert!((states[0].position_rad - 0.3).abs() < 0.02);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Units are radians, seconds and amperes; degrees exist in [`ServoConfig`]
//! (the robot file) and encoder ticks in [`Servo`] and below.
//!
//! The simulated servos are in `servodance-sim`, which implements the wire's far
//! end: nothing in this crate knows whether a port is real, except how long a
//! reply is waited for ([`ReplyClock`]).

mod bus;
mod bus_set;
pub mod can;
mod error;
pub mod imu;
mod ros2;
mod safety;
pub mod serial;
mod servo;

pub use bus::config::{BusConfig, one_or_several};
pub use bus::error_counters::{ErrorCounters, ServoErrors};
pub use bus::kind::BusKind;
pub use bus::layout::{BusLayout, assign_imu, layouts};
pub use bus::open::open_bus;
pub use bus::port::Port;
pub use bus::rate::{RateCheck, check_rate};
pub use bus::reply_clock::{FarEnd, ReplyClock};
pub use bus::timer_slack::sleep_precisely;
pub use bus::torque_alarm::{TorqueAlarm, set_torque_alarm};
pub use bus::{ArmReport, Bus, BusStats, Health, Notes};
pub use bus_set::{BusSet, open_buses};
pub use error::{BusError, BusResult, ConfigError, Refusal, ServoId};
pub use imu::{ImuConfig, ImuKind, SerialImu};
pub use ros2::{Ros2Address, Ros2Bus};
pub use safety::{
    EStop, Interventions, Limited, Limiter, SafeBus, SafetyConfig, SafetyError, ServoLost, State,
    Transition,
};
pub use serial::scan::{FoundServo, Readings, SerialScanner, Vitals};
pub use serial::wire::decoder::{Decoded, Decoder, Packet};
pub use serial::wire::framing::Framing;
pub use serial::wire::protocol1::ErrorFlags;
pub use serial::wire::protocol2::encode;
pub use serial::wire::system_ports::{LatencyTimer, available_ports, latency_timer};
pub use serial::{SerialBus, ServoDeviation};
pub use servo::config::{ServoConfig, servos};
pub use servo::model::{DataSheet, ServoModel};
pub use servo::{SerialSettings, Servo};
