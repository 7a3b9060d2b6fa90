//! Every CAN driver against its simulated motors over slcan: arming, a dance
//! inside the limits, every way out, what is refused.

mod common;

use common::can::*;
use common::*;
use servodance_drivers::can::CanBus;
use servodance_drivers::{Bus, BusConfig, BusKind, SafeBus, SafetyConfig};
use servodance_sim::{ServoFault, SimBus, SimOptions};
use servodance_types::JointState;

#[test]
fn every_kind_dances_inside_its_limits_and_ends_without_torque() {
    for kind in KINDS {
        let (servos, sim, bus) = start(kind, 6);
        let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap();
        safe.arm(0.0).unwrap_or_else(|error| panic!("{kind:?}: {error}"));
        let mut states = vec![JointState::default(); 6];
        let swing = |t: f64| 0.5 * (1.0 - (3.0 * t).cos());
        let mut worst = 0.0f64;
        for k in 0..800 {
            let now_s = k as f64 * PERIOD_S;
            safe.command(now_s, &[swing(now_s); 6]);
            safe.tick(now_s, &mut states)
                .unwrap_or_else(|error| panic!("{kind:?} at {now_s}: {error}"));
            if !safe.is_ramping(now_s) {
                worst = worst.max((states[0].position_rad - swing(now_s - 0.03)).abs());
            }
            sim.advance(PERIOD_S);
        }
        assert!(worst < 0.05, "{kind:?}: off by {worst} rad from 30 ms before");
        assert_eq!(sim.violations().total(), 0, "{kind:?}: {:?}", sim.violation_notes());
        safe.disarm(8.0, "end").unwrap();
        assert!(!any_torque(&sim, &servos), "{kind:?}");
        let stats = safe.stats();
        assert_eq!((stats.cycles, stats.retries), (800, 0), "{kind:?}");
    }
}

#[test]
fn torque_is_off_after_drop() {
    for kind in KINDS {
        let (servos, sim, mut bus) = start(kind, 3);
        bus.arm().unwrap();
        assert!(any_torque(&sim, &servos));
        drop(bus);
        assert!(!any_torque(&sim, &servos), "{kind:?}");
    }
}

#[test]
fn a_motor_without_commands_stops_by_itself() {
    for kind in KINDS.into_iter().filter(|kind| kind.has_watchdog()) {
        let (servos, sim, mut bus) = start(kind, 3);
        bus.arm().unwrap();
        sim.advance(0.095);
        assert!(any_torque(&sim, &servos), "{kind:?}");
        sim.advance(0.01);
        assert!(!any_torque(&sim, &servos), "{kind:?}");
        // The next program finds them willing.
        drop(bus);
        let mut bus = open(kind, &sim, &servos);
        bus.arm().unwrap_or_else(|error| panic!("{kind:?}: {error}"));
        bus.disarm().unwrap();
    }
}

#[test]
fn the_default_watchdog_takes_the_torque_within_200_ms() {
    for kind in KINDS.into_iter().filter(|kind| kind.has_watchdog()) {
        let servos = can_robot(kind, 2);
        let sim = SimBus::start(&specs(&servos), SimOptions::lockstep(BITRATE, HZ)).unwrap();
        let config = BusConfig {
            watchdog_ms: BusConfig::of_kind(kind.bus(), BITRATE).watchdog_ms,
            ..can_patient(kind)
        };
        let mut bus = CanBus::open(&sim.port().to_string(), &config, servos.clone()).unwrap();
        bus.arm().unwrap();
        sim.advance(0.15);
        assert!(any_torque(&sim, &servos), "{kind:?}");
        sim.advance(0.03);
        assert!(!any_torque(&sim, &servos), "{kind:?}");
    }
}

#[test]
fn a_torque_limit_holds_in_mit_mode_whatever_is_asked() {
    use MotorKind::{CubeMars, Damiao, Myactuator, RobstrideMit};
    for kind in [CubeMars, Damiao, Myactuator, RobstrideMit] {
        let mut servos = can_robot(kind, 2);
        for servo in &mut servos {
            servo.motor.as_mut().unwrap().torque_limit_nm = 1.5;
        }
        let sim = SimBus::start(&specs(&servos), SimOptions::lockstep(BITRATE, HZ)).unwrap();
        let mut bus = open(kind, &sim, &servos);
        let mut states = bus.arm().unwrap().states;
        assert!(sim.set_servo_fault(1, ServoFault::Jam));
        let mut most_nm = [0.0f64; 2];
        for k in 0..300 {
            let target = 0.6 * (1.0 - (0.04 * f64::from(k)).cos());
            bus.cycle(&[target; 2], &mut states).unwrap();
            for _ in 0..10 {
                sim.advance(PERIOD_S / 10.0);
                for (index, most_nm) in most_nm.iter_mut().enumerate() {
                    // A simulated CAN motor draws an ampere a newton metre.
                    let torque_nm = sim.servo(index).unwrap().current_a.abs();
                    *most_nm = most_nm.max(torque_nm);
                }
            }
        }
        // The held motor is asked for far more than the limit and gives the limit.
        assert!((1.4..1.505).contains(&most_nm[1]), "{kind:?}: {most_nm:?}");
        assert!(most_nm[0] < 1.505, "{kind:?}: {most_nm:?}");
        assert!(states[0].position_rad > 0.1, "{kind:?}: {states:?}");
    }
}

#[test]
fn a_motor_without_a_watchdog_is_refused_unless_accepted() {
    for (kind, says) in [
        (MotorKind::CubeMars, "joint_1 (id 1): AK80-9 has no watchdog in MIT mode: a killed"),
        (MotorKind::Odrive, "joint_1 (id 1): the bus table has no watchdog_endpoints"),
    ] {
        let servos = can_robot(kind, 2);
        let sim = SimBus::start(&specs(&servos), SimOptions::lockstep(BITRATE, HZ)).unwrap();
        let config =
            BusConfig { accept_no_watchdog: false, watchdog_endpoints: None, ..can_patient(kind) };
        let mut bus = CanBus::open(&sim.port().to_string(), &config, servos.clone()).unwrap();
        let error = bus.arm().unwrap_err().to_string();
        assert!(error.starts_with(says), "{error}");
        assert!(error.contains("accept_no_watchdog = true"), "{error}");
        assert!(!any_torque(&sim, &servos));
    }
}

#[test]
fn silent_motors_are_all_named_at_once() {
    for kind in KINDS {
        let (servos, sim, _) = start(kind, 5);
        for index in [1, 3] {
            sim.set_servo_fault(index, ServoFault::Dead);
        }
        let config = BusConfig { reply_timeout_ms: 30.0, retries: 1, ..can_patient(kind) };
        let mut bus = CanBus::open(&sim.port().to_string(), &config, servos).unwrap();
        let error = bus.arm().unwrap_err().to_string();
        let says = "no answer from joint_2 (id 2), joint_4 (id 4) (";
        assert!(error.starts_with(says), "{kind:?}: {error}");
    }
}

#[test]
fn ranges_that_differ_are_refused_with_both() {
    let servos = can_robot(MotorKind::Damiao, 2);
    let mut specs = specs(&servos);
    specs[1].motor.as_mut().unwrap().model.velocity_rad_s = 45.0;
    let sim = SimBus::start(&specs, SimOptions::lockstep(BITRATE, HZ)).unwrap();
    let mut bus = open(MotorKind::Damiao, &sim, &servos);
    let error = bus.arm().unwrap_err().to_string();
    assert_eq!(error, "joint_2 (id 2): VMAX (rad/s) is 45, must be 30");
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn a_joint_outside_its_limits_gets_no_torque() {
    for kind in KINDS {
        let servos = can_robot(kind, 2);
        let mut specs = specs(&servos);
        specs[0].initial_rad = 2.0;
        let sim = SimBus::start(&specs, SimOptions::lockstep(BITRATE, HZ)).unwrap();
        let mut bus = open(kind, &sim, &servos);
        let error = bus.arm().unwrap_err().to_string();
        assert!(error.starts_with("joint_1 (id 1): position is 114.6 degrees"), "{error}");
        assert!(!any_torque(&sim, &servos));
    }
}

#[test]
fn a_bus_of_other_motors_is_refused() {
    let servos = can_robot(MotorKind::Robstride, 1);
    let config = BusConfig::of_kind(BusKind::Mit, BITRATE);
    let error =
        servodance_drivers::open_bus(&"udp:239.74.163.9:43199".parse().unwrap(), &config, servos);
    let error = error.err().unwrap().to_string();
    assert!(error.contains("joint joint_1: model RS02 does not speak"), "{error}");
}
