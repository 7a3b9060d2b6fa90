//! The control loop: one fixed-rate cycle after another, from torque on to torque off.
//!
//! `control_loop` is the loop, `robot_buses` the servos that it commands,
//! `emergency_stop` what ends it at once. The safety layer below it, with what
//! happens when a servo does not answer, is `servodance_drivers::safety`.

pub(crate) mod balance;
pub(crate) mod beat_sync;
pub mod bus_choice;
pub(crate) mod control_loop;
pub(crate) mod cycle_clock;
mod cycle_gaps;
pub mod delays;
pub mod emergency_stop;
pub mod getup;
pub mod idle;
pub mod latency;
pub(crate) mod lead_time;
pub(crate) mod loop_clock;
pub(crate) mod loop_log;
pub(crate) mod minimum_jerk;
pub(crate) mod motion_input;
pub mod motion_log;
pub(crate) mod motion_plan;
pub(crate) mod recorder_feed;
pub mod robot_buses;
pub(crate) mod servo_truth_log;
pub(crate) mod timing;
pub(crate) mod trace;
pub(crate) mod viewer_link;
