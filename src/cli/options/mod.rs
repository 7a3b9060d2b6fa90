//! Options that several commands share.

pub mod dance;
pub mod engine;
pub mod robot;
pub mod stage;
