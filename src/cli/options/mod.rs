//! Options that several commands share.

pub mod dance;
pub mod robot;
pub mod stage;
