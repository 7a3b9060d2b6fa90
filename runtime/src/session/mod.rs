//! Whole dances: configuration, wiring, one dance after another, and the files
//! that a dance leaves behind.

pub(crate) mod animation;
pub(crate) mod beat_scores;
pub mod config;
pub mod dance;
pub(crate) mod dance_report;
pub mod dance_session;
mod dance_verdict;
pub mod fault_run;
pub mod led_dance;
pub(crate) mod plot_selection;
pub mod summary;
pub(crate) mod uncompensated_replay;
