//! The Feetech driver against simulated STS servos over a pseudo-terminal.

mod common;

use common::*;
use servodance_drivers::{Bus, BusKind, Framing, SafeBus, SafetyConfig, SerialBus, SerialScanner};
use servodance_sim::{ServoFault, SimBus, SimOptions};
use servodance_types::JointState;

const STS_BAUD: u32 = 1_000_000;

fn start(count: u8) -> (Vec<servodance_drivers::Servo>, SimBus, SerialBus) {
    let servos = robot_of("STS3215", count);
    let sim = SimBus::start(&specs(&servos), SimOptions::lockstep(STS_BAUD, HZ)).unwrap();
    let config = patient_of(BusKind::Feetech, STS_BAUD);
    let bus = SerialBus::open(sim.port_path(), &config, servos.clone()).unwrap();
    (servos, sim, bus)
}

#[test]
fn a_dance_is_followed_inside_the_limits() {
    let (servos, sim, bus) = start(6);
    let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap();
    let report = safe.arm(0.0).unwrap();
    assert!(report.notes.iter().any(|note| note.contains("no watchdog")), "{:?}", report.notes);
    let mut states = vec![JointState::default(); 6];
    let swing = |t: f64| 0.6 * (1.0 - (3.0 * t).cos());
    let mut worst = 0.0f64;
    for k in 0..800 {
        let now_s = k as f64 * PERIOD_S;
        safe.command(now_s, &[swing(now_s); 6]);
        safe.tick(now_s, &mut states).unwrap();
        if !safe.is_ramping(now_s) {
            worst = worst.max((states[0].position_rad - swing(now_s - 0.055)).abs());
        }
        sim.advance(PERIOD_S);
    }
    assert!(worst < 0.03, "off by {worst} rad from the command 55 ms before");
    assert!(states[1].velocity_rad_s.abs() > 0.1);
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
    safe.disarm(8.0, "end").unwrap();
    assert!(!any_torque(&sim, &servos));
    let stats = safe.stats();
    assert_eq!((stats.cycles, stats.retries), (800, 0));
}

#[test]
fn torque_is_off_after_drop() {
    let (servos, sim, mut bus) = start(3);
    bus.arm().unwrap();
    assert!(any_torque(&sim, &servos));
    drop(bus);
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn a_condition_is_named_and_ends_the_cycle() {
    let (_servos, sim, mut bus) = start(3);
    bus.arm().unwrap();
    let mut states = vec![JointState::default(); 3];
    bus.cycle(&[0.0; 3], &mut states).unwrap();
    sim.set_servo_fault(1, ServoFault::Overload);
    let error = bus.cycle(&[0.0; 3], &mut states).unwrap_err().to_string();
    assert_eq!(error, "joint_2 (id 2) reports a hardware error: overload");
}

/// Bits 3 and 4 are those with which a Dynamixel servo refuses an instruction.
#[test]
fn overcurrent_and_angle_are_conditions_and_refuse_nothing() {
    for (bits, named) in [(1 << 3, "overcurrent"), (1 << 4, "angle")] {
        let (servos, sim, mut bus) = start(3);
        bus.arm().unwrap();
        sim.set_servo_fault(1, ServoFault::Flags(bits));
        let mut states = vec![JointState::default(); 3];
        let error = bus.cycle(&[0.0; 3], &mut states).unwrap_err().to_string();
        assert_eq!(error, format!("joint_2 (id 2) reports a hardware error: {named}"));
        bus.disarm().unwrap();
        assert!(!any_torque(&sim, &servos));
        assert_eq!(bus.stats().crc_errors, 0);
    }
}

#[test]
fn a_servo_with_a_condition_is_found_and_its_torque_turned_off() {
    for (bits, named) in [(1 << 3, "overcurrent"), (1 << 4, "angle")] {
        let (_, sim, bus) = start(2);
        drop(bus);
        sim.set_servo_fault(0, ServoFault::Flags(bits));
        let wait = std::time::Duration::from_millis(300);
        let open = || SerialScanner::open(sim.port_path(), STS_BAUD, Framing::Protocol1, wait);
        let mut scanner = open().unwrap();
        let found = scanner.everyone().unwrap();
        let errors: Vec<_> = found.iter().map(|servo| servo.hardware_error.as_deref()).collect();
        assert_eq!(errors, [Some(named), None]);
        drop(scanner);
        // Another scanner does not know who that is.
        open().unwrap().torque_off(&found[0]).unwrap();
    }
}

#[test]
fn another_bus_kind_is_refused() {
    let servos = robot_of("STS3215", 1);
    let config = patient_of(BusKind::Dynamixel2, STS_BAUD);
    let error = servodance_drivers::open_bus(
        &servodance_drivers::Port::Serial("/dev/null".into()),
        &config,
        servos,
    );
    let error = error.err().unwrap().to_string();
    assert!(error.contains("joint joint_1: model STS3215 does not speak"), "{error}");
}

#[test]
fn an_sts_servo_is_found_and_renamed() {
    let (_, sim, bus) = start(2);
    drop(bus);
    let wait = std::time::Duration::from_millis(300);
    let mut probe =
        SerialScanner::open(sim.port_path(), STS_BAUD, Framing::Protocol1, wait).unwrap();
    let found = probe.ping(2).unwrap().unwrap();
    assert_eq!((found.model, found.firmware), (Some("STS3215"), 3));
    sim.set_servo_fault(1, ServoFault::Moved(-0.1));
    let vitals = probe.vitals(&found).unwrap().unwrap();
    assert!((vitals.voltage_v - 12.0).abs() < 0.2, "{vitals:?}");
    assert_eq!(vitals.position_ticks, 2048 - 65);
    probe.set_id(&found, 9).unwrap();
    assert_eq!(probe.ping(2).unwrap(), None);
    assert_eq!(probe.ping(9).unwrap().unwrap().model, found.model);
}
