//! Looking at a bus and setting it up: what people need before a robot dances.
//!
//! [`scan`], [`ping`] and [`servo_check`] only ask (the last with `fix` set writes). [`set_id`],
//! [`set_baud`], [`calibrate`] and [`jog`] change or move something on what may be a live robot,
//! and ask first ([`Consent`]). [`memory`] reads and writes the registers of single servos, and
//! [`setup`] makes new servos those of a robot; neither turns torque on.
//! [`serve`] is the simulated far end.

pub mod calibrate;
mod consent;
pub mod jog;
mod listen;
pub mod memory;
pub mod ping;
pub(crate) mod plug;
pub mod scan;
pub mod serve;
pub mod servo_check;
pub mod set_baud;
pub mod set_id;
pub mod setup;
pub mod sim_link;

pub use consent::Consent;
pub use listen::ProtocolChoice;
