//! Whole dances: configuration, wiring, one dance after another, and the files
//! that a dance leaves behind.

pub mod animation;
pub mod beat_scores;
pub mod config;
pub mod dance;
pub mod dance_session;
pub mod fault_run;
pub mod led_dance;
pub mod plot_selection;
pub mod summary;
pub mod uncompensated_replay;
