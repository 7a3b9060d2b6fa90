//! servodance: a robot hears music and dances to it.
//!
//! This crate puts the parts together: [`robot`] files, the [`dance`] from
//! sound to servo, its [`report`], [`record`]ing and [`picture`]. The parts
//! themselves are crates of their own; ARCHITECTURE.md maps them.

// A reader that goes away is no reason to panic: see `console`.
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod beats;
pub mod bus_tools;
pub mod conditioning;
pub mod console;
pub mod dance;
pub mod doctor;
pub mod drill;
pub mod export;
pub mod follow;
pub mod generate;
pub mod hearing;
pub mod joint_csv;
pub mod listening;
pub mod output;
pub mod picture;
pub mod progress;
pub mod realtime;
pub mod record;
pub mod report;
pub mod retarget_motion;
pub mod robot;
pub mod robot_file;
pub mod show;
pub mod sim_link;
pub mod song;
#[cfg(feature = "stage")]
pub mod stage;
pub mod stages;
pub mod summary;
