//! A program that is killed (SIGKILL) while it dances: nobody is left to turn
//! torque off, so the servos' own watchdog must stop them.

mod common;

use std::process::{Command, Stdio};
use std::time::Duration;

use common::*;
use servodance_drivers::{Bus, BusConfig};
use servodance_sim::{SimBus, SimOptions};
use servodance_types::JointState;

/// Tells the child, a second run of this test binary, which port to dance on.
const PORT: &str = "SERVODANCE_TEST_PORT";

#[test]
fn servos_stop_by_themselves_when_the_program_is_killed() {
    if let Ok(port) = std::env::var(PORT) {
        dance_until_killed(&port);
    }
    let servos = robot(4);
    let sim = SimBus::start(&specs(&servos), SimOptions::realtime(BAUD, HZ)).unwrap();
    let mut child = Command::new(std::env::current_exe().unwrap())
        .arg("servos_stop_by_themselves_when_the_program_is_killed")
        .env(PORT, sim.port_path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let moves = |index| sim.servo(index).unwrap().velocity_rad_s.abs() > 0.5;
    wait_for("the dance", || moves(0) && moves(3));
    let killed_s = sim.time_s();
    child.kill().unwrap();
    child.wait().unwrap();
    let stopped = |index| sim.servo(index).unwrap().watchdog_tripped;
    wait_for("the watchdogs", || (0..servos.len()).all(stopped));
    for index in 0..servos.len() {
        let after_s = sim.servo(index).unwrap().tripped_s.unwrap() - killed_s;
        assert!(after_s < 0.2, "servo {index} went on for {after_s:.3} s");
    }
    std::thread::sleep(Duration::from_millis(300));
    for index in 0..servos.len() {
        let servo = sim.servo(index).unwrap();
        assert_eq!(servo.velocity_rad_s, 0.0, "{servo:?}");
    }
    // The next program finds the port free and the servos willing.
    let mut bus = driver(&sim, &patient(), &servos);
    bus.arm().unwrap();
    bus.disarm().unwrap();
    assert!(!any_torque(&sim, &servos));
}

/// Runs in the child; ends only by being killed.
fn dance_until_killed(port: &str) -> ! {
    let servos = robot(4);
    let config = BusConfig { reply_timeout_ms: 500.0, ..BusConfig::dynamixel2(BAUD) };
    let mut bus = servodance_drivers::open_bus(
        &servodance_drivers::Port::Serial(port.into()),
        &config,
        servos,
    )
    .unwrap();
    let mut states = vec![JointState::default(); 4];
    // A machine that stalls may trip the watchdog before its time: begin again.
    loop {
        if bus.arm().is_err() {
            continue;
        }
        for k in 0u32.. {
            let target = 0.5 * (1.0 - (0.05 * f64::from(k)).cos());
            let tripped = k > 50 && states[0].velocity_rad_s == 0.0 && k % 50 == 0;
            if tripped || bus.cycle(&[target; 4], &mut states).is_err() {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = bus.disarm();
    }
}

/// Waits, without a bound that a slow machine could miss by little.
fn wait_for(what: &str, done: impl Fn() -> bool) {
    for _ in 0..6000 {
        if done() {
            return;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("waited a minute for {what}");
}
