//! What other programs leave in a servo is put right, told or refused before torque.

mod common;

use common::*;
use servodance_drivers::serial::Register;
use servodance_drivers::serial::dynamixel2::registers as at;
use servodance_drivers::{Bus, BusError, Framing, SerialScanner, SerialSettings, Servo};
use servodance_sim::SimBus;
use std::time::Duration;

const WAIT: Duration = Duration::from_millis(300);

/// Another program writes registers of the servo with this id.
fn left_behind(sim: &SimBus, id: u8, values: &[(Register, u64)]) {
    let mut program = SerialScanner::open(sim.port_path(), BAUD, Framing::Protocol2, WAIT).unwrap();
    for (register, value) in values {
        program.set(id, *register, *value).unwrap();
    }
}

fn value(sim: &SimBus, id: u8, register: Register) -> u64 {
    let mut program = SerialScanner::open(sim.port_path(), BAUD, Framing::Protocol2, WAIT).unwrap();
    program.read(id, register).unwrap().unwrap()
}

fn told(servos: &[Servo], sim: &SimBus) -> Result<Vec<String>, BusError> {
    driver(sim, &hasty(), servos).arm().map(|report| report.notes)
}

#[test]
fn settings_of_another_program_are_put_right_and_told() {
    for (register, left, right) in [
        (at::POSITION_P, 60, 800),
        (at::FEED_FORWARD_1, 100, 0),
        (at::GOAL_PWM, 200, 885),
        (at::SHUTDOWN, 0, 52),
        (at::STARTUP, 1, 0),
        (at::SHADOW_ID, 2, 255),
        (at::DRIVE_MODE, 1, 0),
        (at::OPERATING_MODE, 4, 3),
        (at::PROFILE_VELOCITY, 30, 0),
    ] {
        let servos = robot(2);
        let sim = lockstep(&servos);
        left_behind(&sim, 1, &[(register, left)]);
        let notes = told(&servos, &sim).unwrap();
        let line = format!("joint_1 (id 1): {} changed from {left} to {right}", register.name);
        assert!(notes.iter().any(|note| note.starts_with(&line)), "{line}: {notes:?}");
        assert_eq!(value(&sim, 1, register), right, "{}", register.name);
    }
}

#[test]
fn what_may_be_meant_is_told_and_kept() {
    let servos = robot(2);
    let sim = lockstep(&servos);
    left_behind(&sim, 2, &[(at::PWM_LIMIT, 400), (at::CURRENT_LIMIT, 100), (at::POSITION_P, 900)]);
    let notes = told(&servos, &sim).unwrap();
    for says in ["PWM limit is 400, 885 is expected", "current limit is 100", "gain is 900"] {
        assert!(notes.iter().any(|note| note.contains(says)), "{says}: {notes:?}");
    }
    assert_eq!(value(&sim, 2, at::POSITION_P), 900);
}

#[test]
fn gains_of_the_robot_file_are_made_so() {
    let mut servos = robot(1);
    servos[0].settings = SerialSettings { gains: Some([640, 10, 300]), ..Default::default() };
    let sim = lockstep(&servos);
    told(&servos, &sim).unwrap();
    let gains = [at::POSITION_P, at::POSITION_I, at::POSITION_D];
    assert_eq!(gains.map(|register| value(&sim, 1, register)), [640, 10, 300]);
}

#[test]
fn another_homing_offset_than_the_robot_file_has_is_refused() {
    let mut servos = robot(1);
    servos[0].settings.homing_offset = Some(100);
    let sim = lockstep(&servos);
    let error = told(&servos, &sim).unwrap_err().to_string();
    assert!(error.contains("joint_1 (id 1): homing offset is 0, must be 100"), "{error}");
    assert!(error.contains("calibrate"), "{error}");
    left_behind(&sim, 1, &[(at::HOMING_OFFSET, 100)]);
    told(&servos, &sim).unwrap();
}

#[test]
fn a_look_writes_nothing() {
    let servos = robot(2);
    let sim = lockstep(&servos);
    left_behind(&sim, 1, &[(at::SHUTDOWN, 0), (at::DRIVE_MODE, 1)]);
    let mut bus = driver(&sim, &hasty(), &servos);
    let found = bus.deviations().unwrap();
    let places: Vec<usize> = found.iter().map(|found| found.index).collect();
    assert_eq!(places, [0, 0], "{found:?}");
    drop(bus);
    assert_eq!(value(&sim, 1, at::SHUTDOWN), 0);
    assert_eq!(value(&sim, 1, at::DRIVE_MODE), 1);
    let mut bus = driver(&sim, &hasty(), &servos);
    assert_eq!(bus.set_up().unwrap().len(), 4, "two changes, two return delays");
    assert_eq!(bus.deviations().unwrap(), []);
}
