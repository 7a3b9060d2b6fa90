//! The machine keeps the program from running for a while, and the servos' own watchdogs
//! stop the robot: it is told, and either follows again or ends in torque off.

use crate::crash_safety::Stage;
use crate::program::Program;
use crate::torque_off::{alone, signal};
use std::time::Duration;

/// Stops a dance on the neck for so long; the stage afterwards.
fn stalled(stall: Duration) -> Stage {
    let stage = Stage::start(Program::patient_robot, &[], |_| ());
    stage.wait("movement", || stage.moves());
    signal(&stage.child, "-STOP");
    std::thread::sleep(stall);
    stage.wait("watchdogs", || stage.tripped() == 2);
    signal(&stage.child, "-CONT");
    stage
}

#[test]
fn a_short_stall_is_told_and_the_robot_dances_on() {
    let _alone = alone();
    let mut stage = stalled(Duration::from_millis(500));
    stage.hears("stopped by their own watchdog");
    stage.hears("follow again");
    stage.wait("servos that take goals", || stage.tripped() == 0);
    stage.wait("movement", || stage.moves());
    signal(&stage.child, "-INT");
    stage.ends();
    assert_eq!(stage.bus.violations().total(), 0, "{:?}", stage.bus.violation_notes());
    assert_eq!(stage.powered(), 0);
}

#[test]
fn a_long_stall_ends_in_torque_off_and_status_1() {
    let _alone = alone();
    let mut stage = stalled(Duration::from_secs(5));
    stage.hears("error: ");
    let status = stage.ends();
    assert_eq!(status.code(), Some(1));
    assert_eq!(stage.powered(), 0);
}
