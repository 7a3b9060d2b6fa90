//! Simulated servos on a serial line: memory, firmware and motor of one each.

pub(crate) mod body;
mod byte_loops;
pub(crate) mod byte_servo;
pub(crate) mod dynamixel2;
pub(crate) mod motor;
pub(crate) mod spec;
