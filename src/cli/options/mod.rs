//! Options that several commands share.

pub mod dance;
pub mod file_ending;
pub mod links;
pub mod robot;
pub mod stage;
