//! AX and MX with Protocol 1.0: the driver against the simulated servos.

mod common;

use common::*;
use servodance_drivers::{
    Bus, BusConfig, BusKind, SafeBus, SafetyConfig, SerialBus, Servo, servos,
};
use servodance_sim::{ServoFault, SimBus, SimOptions};
use servodance_types::JointState;

const BAUD1: u32 = 1_000_000;

/// Joints of these models; AX servos read 150 degrees at their centre.
fn robot1(models: &[&str]) -> Vec<Servo> {
    let joint = |(k, model): (usize, &&str)| {
        let mut joint = joint_of(model, k as u8 + 1);
        joint.zero_deg = if model.starts_with("AX") { 150.0 } else { 180.0 };
        joint
    };
    servos(&models.iter().enumerate().map(joint).collect::<Vec<_>>()).unwrap()
}

fn start(models: &[&str]) -> (Vec<Servo>, SimBus, SerialBus) {
    let servos = robot1(models);
    let sim = SimBus::start(&specs(&servos), SimOptions::lockstep(BAUD1, HZ)).unwrap();
    let config = patient_of(BusKind::Dynamixel1, BAUD1);
    let bus = SerialBus::open(sim.port_path(), &config, servos.clone()).unwrap();
    (servos, sim, bus)
}

/// Dances ten seconds inside the limits and is judged.
fn check(models: &[&str], note: Option<&str>) {
    let (servos, sim, bus) = start(models);
    let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap();
    let report = safe.arm(0.0).unwrap();
    let told = |note: &str| report.notes.iter().any(|line| line.contains(note));
    assert_eq!(told("a read for each servo"), note.is_some(), "{:?}", report.notes);
    assert!(note.is_none_or(told), "{:?}", report.notes);
    let mut states = vec![JointState::default(); servos.len()];
    let mut furthest = 0.0f64;
    for k in 0..1000 {
        let now_s = k as f64 * PERIOD_S;
        let target = 0.5 * (1.0 - (3.0 * now_s).cos());
        safe.command(now_s, &vec![target; servos.len()]);
        safe.tick(now_s, &mut states).unwrap();
        sim.advance(PERIOD_S);
        for (state, index) in states.iter().zip(0..) {
            furthest = furthest.max(state.position_rad);
            let truth = sim.servo(index).unwrap().position_rad;
            assert!((state.position_rad - truth).abs() < 0.2, "{state:?} {truth}");
        }
    }
    assert!(furthest > 0.9, "{furthest}");
    assert_eq!(sim.motion_violations().total(), 0, "{:?}", sim.violation_notes());
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
    safe.disarm(10.0, "done").unwrap();
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn mx_servos_dance_by_bulk_read() {
    check(&["MX-28(1.0)", "MX-64(1.0)", "MX-106(1.0)", "MX-28(1.0)"], None);
}

#[test]
fn ax_servos_dance_one_read_each_and_that_is_said() {
    check(
        &["AX-12A", "MX-28(1.0)", "AX-18A"],
        Some("joint_1 (id 1) is an AX-12A, which knows no Bulk Read"),
    );
}

#[test]
fn servos_without_a_watchdog_must_be_accepted() {
    let servos = robot1(&["AX-12A"]);
    let sim = SimBus::start(&specs(&servos), SimOptions::lockstep(BAUD1, HZ)).unwrap();
    let config = BusConfig::of_kind(BusKind::Dynamixel1, BAUD1);
    let mut bus = SerialBus::open(sim.port_path(), &config, servos.clone()).unwrap();
    let error = bus.arm().unwrap_err().to_string();
    assert!(error.contains("joint_1 (id 1)"), "{error}");
    assert!(error.contains("accept_no_watchdog = true"), "{error}");
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn an_overloaded_ax_is_named_and_stops_the_others() {
    let (servos, sim, mut bus) = start(&["AX-12A", "AX-12A"]);
    let mut states = bus.arm().unwrap().states;
    bus.cycle(&[0.1, 0.1], &mut states).unwrap();
    sim.set_servo_fault(1, ServoFault::Overload);
    let error = bus.cycle(&[0.1, 0.1], &mut states).unwrap_err().to_string();
    assert!(error.contains("joint_2 (id 2) reports a hardware error: overload"), "{error}");
    bus.disarm().unwrap();
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn the_wire_carries_fewer_cycles_with_an_ax_on_it() {
    let config = BusConfig::of_kind(BusKind::Dynamixel1, BAUD1);
    let limit = |models: &[&str]| {
        let servos = robot1(models);
        servodance_drivers::check_rate(&config, &servos, 10.0).unwrap().fast_hz
    };
    // 20 goals in 68 bytes; a Bulk Read of 67 and 20 answers of 14.
    assert!((limit(&["MX-28(1.0)"; 20]) - 1e5 / 415.0).abs() < 0.1);
    // Each asked by itself: 8 bytes there, 14 back.
    assert!((limit(&["AX-12A"; 20]) - 1e5 / 508.0).abs() < 0.1);
}
