//! Servo buses: joint targets out, joint states in, once a control cycle.
//!
//! ```text
//! targets (rad) -> SafeBus (limits, staleness, torque off) -> Bus -> wire
//! ```
//!
//! [`Bus`] is one bus of servos; [`SerialBus`] drives Dynamixel (Protocol 2.0 and
//! 1.0) and Feetech STS servos; [`can`] has the motors on CAN; [`BusSet`] runs
//! several buses side by side. [`SafeBus`] wraps any bus, and programs that move
//! real motors hand their targets to it and never to a bus directly.
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
mod safety;
pub mod serial;
mod servo;

pub use bus::config::{BusConfig, one_or_several};
pub use bus::kind::BusKind;
pub use bus::layout::{BusLayout, layouts};
pub use bus::open::open_bus;
pub use bus::port::Port;
pub use bus::rate::{RateCheck, check_rate};
pub use bus::reply_clock::{FarEnd, ReplyClock};
pub use bus::timer_slack::sleep_precisely;
pub use bus::torque_alarm::{TorqueAlarm, set_torque_alarm};
pub use bus::{ArmReport, Bus, BusStats, Health};
pub use bus_set::{BusSet, open_buses};
pub use error::{BusError, ConfigError, Refusal, ServoId};
pub use safety::{
    EStop, Interventions, Limited, Limiter, SafeBus, SafetyConfig, SafetyError, ServoLost, State,
    Transition,
};
pub use serial::SerialBus;
pub use serial::scan::{FoundServo, SerialScanner, Vitals};
pub use serial::wire::decoder::{Decoded, Decoder, Packet};
pub use serial::wire::framing::Framing;
pub use serial::wire::protocol2::encode;
pub use serial::wire::system_ports::{LatencyTimer, available_ports, latency_timer};
pub use servo::Servo;
pub use servo::config::{ServoConfig, servos};
pub use servo::model::{DataSheet, ServoModel};
