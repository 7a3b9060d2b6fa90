//! The control loop: one fixed-rate cycle after another, from torque on to torque off.
//!
//! `control_loop` is the loop, `robot_buses` the servos that it commands,
//! `emergency_stop` what ends it at once. The safety layer below it, with what
//! happens when a servo does not answer, is `servodance_drivers::safety`.

pub mod beat_sync;
pub mod bus_choice;
pub mod control_loop;
pub mod cycle_clock;
pub mod delays;
pub mod emergency_stop;
pub mod idle;
pub mod latency;
pub mod lead_time;
pub mod minimum_jerk;
pub mod recorder_feed;
pub mod robot_buses;
pub mod servo_truth_log;
pub mod timing;
pub mod trace;
pub mod viewer_link;
