//! Looking at a CAN bus while somebody else dances on it: everyone is found who
//! can be, and nobody moves or loses torque.

mod common;

use std::time::Duration;

use common::can::*;
use common::*;
use servodance_drivers::can::transport::udp::UdpLink;
use servodance_drivers::can::{CanBus, CanScanner, IdSetting};
use servodance_drivers::{Bus, BusConfig};
use servodance_sim::{ServoFault, SimBus, SimLink, SimOptions};

/// What a scan tells of each kind of motor.
fn told(kind: MotorKind) -> Option<(&'static str, Option<&'static str>, Option<&'static str>)> {
    match kind {
        MotorKind::CubeMars | MotorKind::RobstrideMit | MotorKind::Moteus => None,
        MotorKind::Damiao | MotorKind::DamiaoOwnLoops => {
            Some(("Damiao", Some("DM-J4310"), Some("20500")))
        }
        MotorKind::Robstride => Some(("RobStride", None, None)),
        MotorKind::Odrive => Some(("ODrive", None, Some("0.6.10"))),
        MotorKind::Cia402 => Some(("CiA 402", None, Some("revision 00000000"))),
        MotorKind::Myactuator => Some(("MyActuator", None, Some("20240501"))),
    }
}

#[test]
fn everyone_who_can_be_asked_is_found_and_nobody_moves() {
    // RobStride motors in MIT mode stay as silent as CubeMars motors; CAN FD is tried below.
    let other = [MotorKind::RobstrideMit, MotorKind::Moteus];
    let kinds = KINDS.into_iter().filter(|kind| !other.contains(kind));
    for (place, kind) in kinds.enumerate() {
        let group = format!("239.74.163.2:{}", 43980 + place).parse().unwrap();
        let servos = can_robot(kind, 3);
        let options =
            SimOptions { link: SimLink::Multicast(group), ..SimOptions::realtime(BITRATE, HZ) };
        let sim = SimBus::start(&specs(&servos), options).unwrap();
        let config = BusConfig {
            watchdog_ms: 2540,
            watchdog_endpoints: None,
            accept_no_watchdog: true,
            ..can_patient(kind)
        };
        let mut bus = CanBus::open(&format!("udp:{group}"), &config, servos.clone()).unwrap();
        // Those without a heartbeat of ours to wait for keep their torque meanwhile.
        let waits_for_us = !matches!(kind, MotorKind::CubeMars | MotorKind::Odrive);
        if !waits_for_us {
            bus.arm().unwrap();
        }
        let torques = || (0..3).map(|index| sim.servo(index).unwrap().torque_enabled);
        let positions = || (0..3).map(|index| sim.servo(index).unwrap().position_rad);
        let (before, stood): (Vec<_>, Vec<_>) = (torques().collect(), positions().collect());
        let link = UdpLink::open(group).unwrap();
        let (listen, wait) = (Duration::from_millis(400), Duration::from_millis(100));
        let mut scanner = CanScanner::over(Box::new(link), listen, wait);
        let found = scanner.everyone().unwrap();
        let ids: Vec<u8> = found.iter().map(|one| one.id).collect();
        match told(kind) {
            None => assert!(found.is_empty(), "{found:?}"),
            Some((family, model, firmware)) => {
                assert_eq!(ids, [1, 2, 3], "{found:?}");
                for one in &found {
                    assert_eq!(one.family, family);
                    assert_eq!((one.model, one.firmware.as_deref()), (model, firmware));
                    assert_eq!(one.error, None, "{one:?}");
                }
            }
        }
        assert_eq!(torques().collect::<Vec<_>>(), before, "{kind:?}");
        for (now, then) in positions().zip(stood) {
            assert!((now - then).abs() < 1e-3, "{kind:?}: from {then} to {now}");
        }
        assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
    }
}

#[test]
fn one_motor_gets_a_new_id_and_its_neighbour_keeps_its_own() {
    for (place, kind) in KINDS.into_iter().enumerate() {
        let servos = can_robot(kind, 9);
        let setting = CanScanner::id_setting(servos[0].model);
        let wanted = match kind {
            MotorKind::Damiao | MotorKind::DamiaoOwnLoops => IdSetting::OfOne,
            MotorKind::Robstride | MotorKind::Odrive => IdSetting::OfOne,
            MotorKind::Myactuator => IdSetting::OfAll,
            _ => IdSetting::Vendor,
        };
        assert_eq!(setting, wanted, "{kind:?}");
        if setting == IdSetting::Vendor {
            continue;
        }
        let alone = setting == IdSetting::OfAll;
        let group = format!("239.74.163.2:{}", 44020 + place).parse().unwrap();
        let options =
            SimOptions { link: SimLink::Multicast(group), ..SimOptions::realtime(BITRATE, HZ) };
        let count = if alone { 1 } else { 2 };
        let sim = SimBus::start(&specs(&servos[..count]), options).unwrap();
        let link = UdpLink::open(group).unwrap();
        let (listen, wait) = (Duration::from_millis(700), Duration::from_millis(30));
        let mut scanner = CanScanner::over(Box::new(link), listen, wait);
        assert!(scanner.set_id(1, &servos[8]).unwrap(), "{kind:?}");
        let ids = |scanner: &mut CanScanner| -> Vec<u8> {
            scanner.everyone().unwrap().iter().map(|found| found.id).collect()
        };
        let wanted: &[u8] = if alone { &[9] } else { &[2, 9] };
        assert_eq!(ids(&mut scanner), wanted, "{kind:?}");
        // It is kept without power, and the motor is driven by it.
        assert!(sim.set_servo_fault(0, ServoFault::Reboot));
        std::thread::sleep(Duration::from_millis(600));
        let mut bus = CanBus::open(
            &format!("udp:{group}"),
            &BusConfig { watchdog_ms: 2540, ..can_patient(kind) },
            vec![servos[8].clone()],
        )
        .unwrap();
        bus.arm().unwrap_or_else(|error| panic!("{kind:?}: {error}"));
        bus.disarm().unwrap();
    }
}

#[test]
fn what_a_motor_complains_about_is_told() {
    for (kind, says) in [
        (MotorKind::Damiao, "overload (error E)"),
        (MotorKind::Odrive, "current limit violation (error 00001000)"),
        (MotorKind::Cia402, "motor blocked (code 7121)"),
        (MotorKind::Myactuator, "motor stalled (errors 0002)"),
        (MotorKind::Moteus, "motor driver fault (fault 33)"),
    ] {
        let servos = can_robot(kind, 2);
        let sim = SimBus::start(&specs(&servos), SimOptions::realtime(BITRATE, HZ)).unwrap();
        assert!(sim.set_servo_fault(1, ServoFault::Overload));
        let mut scanner = CanScanner::open(&sim.port().to_string(), BITRATE).unwrap();
        let found = scanner.everyone().unwrap();
        let errors: Vec<_> = found.iter().map(|one| one.error.as_deref()).collect();
        assert_eq!(errors, [None, Some(says)], "{kind:?}");
    }
}

#[test]
fn at_another_bitrate_nobody_is_heard_and_nothing_reaches_the_bus() {
    let servos = can_robot(MotorKind::Damiao, 2);
    let sim = SimBus::start(&specs(&servos), SimOptions::realtime(BITRATE, HZ)).unwrap();
    let mut scanner = CanScanner::open(&sim.port().to_string(), 500_000).unwrap();
    let error = scanner.everyone().unwrap_err().to_string();
    assert!(error.starts_with("bus-off"), "{error}");
    assert_eq!(sim.wire_stats().packets_in, 0);
}
