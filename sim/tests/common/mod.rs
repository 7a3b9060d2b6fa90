//! A robot of simulated servos for the tests, and the driver that moves it.

// Each test binary uses some of these.
#![allow(dead_code)]

pub mod biped;
pub mod can;
pub mod fault_table;

use servodance_drivers::{BusConfig, BusKind, SerialBus, Servo, ServoConfig, servos};
use servodance_sim::{SimBus, SimOptions, SimServoSpec};

pub const BAUD: u32 = 2_000_000;
pub const HZ: f64 = 100.0;
pub const PERIOD_S: f64 = 1.0 / HZ;

/// `count` joints, every other one mounted in reverse.
pub fn robot(count: u8) -> Vec<Servo> {
    robot_of("XM430-W350", count)
}

pub fn robot_of(model: &str, count: u8) -> Vec<Servo> {
    let joint = |k| joint_of(model, k);
    servos(&(1..=count).map(joint).collect::<Vec<_>>()).unwrap()
}

pub fn joint_of(model: &str, k: u8) -> ServoConfig {
    ServoConfig {
        name: format!("joint_{k}"),
        id: k,
        model: model.into(),
        direction: if k.is_multiple_of(2) { 1 } else { -1 },
        zero_deg: 180.0,
        lower_deg: -60.0,
        upper_deg: 90.0,
        velocity_deg_s: 230.0,
        acceleration_deg_s2: 2300.0,
        ..Default::default()
    }
}

pub fn specs(servos: &[Servo]) -> Vec<SimServoSpec> {
    servos.iter().map(SimServoSpec::from).collect()
}

/// A reply may be late by a stall of the machine, never by the simulation.
pub fn patient() -> BusConfig {
    patient_of(BusKind::Dynamixel2, BAUD)
}

pub fn patient_of(kind: BusKind, baud: u32) -> BusConfig {
    BusConfig {
        reply_timeout_ms: 2000.0,
        accept_no_watchdog: true,
        ..BusConfig::of_kind(kind, baud)
    }
}

/// For tests that wait for an answer that never comes.
pub fn hasty() -> BusConfig {
    BusConfig { reply_timeout_ms: 100.0, retries: 1, ..BusConfig::dynamixel2(BAUD) }
}

pub fn lockstep(servos: &[Servo]) -> SimBus {
    SimBus::start(&specs(servos), SimOptions::lockstep(BAUD, HZ)).unwrap()
}

pub fn driver(sim: &SimBus, config: &BusConfig, servos: &[Servo]) -> SerialBus {
    SerialBus::open(sim.port_path(), config, servos.to_vec()).unwrap()
}

/// Whether any servo drives.
pub fn any_torque(sim: &SimBus, servos: &[Servo]) -> bool {
    (0..servos.len()).any(|index| sim.servo(index).unwrap().torque_enabled)
}
