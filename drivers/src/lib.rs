//! Servo buses: joint targets out, joint states in, once a control cycle.
//!
//! ```text
//! targets (rad) -> SafeBus (limits, staleness, torque off) -> Bus -> wire
//! ```
//!
//! [`Bus`] is one bus of servos; [`SerialBus`] drives Dynamixel (Protocol 2.0 and
//! 1.0) and Feetech STS servos; [`can`] has
//! the motors on CAN; [`BusSet`] runs several buses side by side. [`SafeBus`]
//! wraps any bus, and programs that move real motors hand their targets to it
//! and never to a bus directly.
//!
//! Units are radians, seconds and amperes; degrees exist in [`ServoConfig`]
//! (the robot file) and encoder ticks in [`Servo`] and below.
//!
//! The simulated servos are in `servodance-sim`, which implements the wire's far end:
//! nothing in this crate knows whether a port is real.

mod bus;
mod bus_set;
pub mod can;
mod config;
mod dialect;
mod dynamixel;
mod dynamixel1;
mod error;
mod family;
mod feetech;
mod last_words;
mod layout;
mod link;
mod model;
mod owed;
mod packet;
mod port;
mod probe;
mod protocol1;
mod punctual;
mod rate;
mod register;
mod reply_clock;
mod safety;
mod serial;
mod servo;
mod stream;
mod wire;

pub use bus::{ArmReport, Bus, BusStats, Health, open_bus};
pub use bus_set::{BusSet, open_buses};
pub use config::{BusConfig, BusKind, ServoConfig, one_or_several, servos};
pub use error::{BusError, ConfigError, Refusal, ServoId};
pub use family::{Family, Layout};
pub use last_words::{Listener, hear_last_words};
pub use layout::{BusLayout, layouts};
pub use model::{MODELS, Model};
pub use packet::{Decoded, Decoder, Packet, Protocol, encode};
pub use port::Port;
pub use probe::{Found, Probe, Vitals};
pub use punctual::sleep_punctually;
pub use rate::{RateCheck, check_rate, cycle_bytes};
pub use register::Register;
pub use reply_clock::{FarEnd, ReplyClock};
pub use safety::{
    EStop, Interventions, Limited, Limiter, SafeBus, SafetyConfig, SafetyError, ServoLost, State,
    Transition,
};
pub use serial::SerialBus;
pub use servo::Servo;
pub use wire::{LatencyTimer, available_ports, latency_timer};
