//! The driver against simulated servos over a pseudo-terminal.

mod common;

use common::*;
use servodance_drivers::{Bus, BusConfig, BusError, BusStats, Framing, SerialBus, SerialScanner};
use servodance_sim::{ServoFault, SimBus, SimOptions, SimServoSpec};
use servodance_types::JointState;

#[test]
fn armed_servos_hold_where_they_stand() {
    let servos = robot(20);
    let mut specs = specs(&servos);
    specs[3].initial_rad = 0.7;
    let sim = SimBus::start(&specs, SimOptions::lockstep(BAUD, HZ)).unwrap();
    let mut bus = driver(&sim, &patient(), &servos);
    let report = bus.arm().unwrap();
    let plain = report.notes.iter().any(|note| note.contains("plain Sync Read"));
    assert!(!plain, "{:?}", report.notes);
    assert!((report.states[3].position_rad - 0.7).abs() < 1e-3);
    assert!(
        report
            .notes
            .iter()
            .any(|note| note.contains("joint_4 (id 4): return delay time changed from 250 to 0"))
    );
    for index in 0..20 {
        let servo = sim.servo(index).unwrap();
        assert!(servo.torque_enabled);
        assert!((servo.goal_rad - report.states[index].position_rad).abs() < 1e-9);
    }
    bus.disarm().unwrap();
    assert!(!any_torque(&sim, &servos));
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
}

#[test]
fn a_smooth_dance_is_followed_with_a_small_lag_and_no_violation() {
    let servos = robot(20);
    let sim = lockstep(&servos);
    let mut bus = driver(&sim, &patient(), &servos);
    bus.arm().unwrap();
    let mut states = vec![JointState::default(); 20];
    let swing = |t: f64, joint: usize| {
        let rate = 3.0 + 0.1 * joint as f64;
        0.5 * (1.0 - (rate * t).cos())
    };
    let mut worst_lagged = 0.0f64;
    let mut worst = 0.0f64;
    for k in 0..600 {
        let t = k as f64 * PERIOD_S;
        let targets: Vec<f64> = (0..20).map(|joint| swing(t, joint)).collect();
        bus.cycle(&targets, &mut states).unwrap();
        for (joint, state) in states.iter().enumerate() {
            worst = worst.max((state.position_rad - targets[joint]).abs());
            let late = swing((t - 0.055).max(0.0), joint);
            worst_lagged = worst_lagged.max((state.position_rad - late).abs());
        }
        sim.advance(PERIOD_S);
    }
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
    assert!((0.02..0.25).contains(&worst), "largest distance to the command {worst} rad");
    assert!(worst_lagged < 0.03, "off by {worst_lagged} rad from the command 55 ms before");
    let stats = bus.stats();
    assert_eq!((stats.cycles, stats.retries, stats.timeouts, stats.crc_errors), (600, 0, 0, 0));
}

#[test]
fn the_play_of_a_gear_costs_less_than_itself_and_breaks_no_limit() {
    let servos = robot(6);
    // How far the shaft is from where it should be, at most and on average.
    let off_rad = |specs: Vec<SimServoSpec>| {
        let sim = SimBus::start(&specs, SimOptions::lockstep(BAUD, HZ)).unwrap();
        let mut bus = driver(&sim, &patient(), &servos);
        bus.arm().unwrap();
        let mut states = vec![JointState::default(); 6];
        let (mut worst_rad, mut sum_rad) = (0.0f64, 0.0);
        for k in 0..600 {
            let swing = |t: f64| 0.5 * (1.0 - (5.0 * t).cos());
            let now_s = k as f64 * PERIOD_S;
            bus.cycle(&[swing(now_s); 6], &mut states).unwrap();
            let wanted_rad = swing((now_s - 0.055).max(0.0));
            let off_rad = (sim.servo(0).unwrap().position_rad - wanted_rad).abs();
            worst_rad = worst_rad.max(off_rad);
            sum_rad += off_rad;
            sim.advance(PERIOD_S);
        }
        assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
        (worst_rad, sum_rad / 600.0)
    };
    let stated = specs(&servos).into_iter();
    let stated: Vec<_> = stated.map(SimServoSpec::with_stated_backlash).collect();
    let play_rad = stated[0].backlash_rad;
    assert!((play_rad.to_degrees() - 0.25).abs() < 1e-9);
    let (without, with) = (off_rad(specs(&servos)), off_rad(stated));
    println!("{without:?} rad without play, {with:?} rad with {play_rad}");
    // It is felt, and costs less than itself.
    assert_ne!(with, without);
    assert!(with.0 - without.0 < play_rad, "{without:?}, {with:?}");
}

#[test]
fn a_servo_at_another_rate_is_silent_until_it_is_spoken_to_at_that_rate() {
    let servos = robot(3);
    let sim = SimBus::start(&specs(&servos), SimOptions::realtime(BAUD, HZ)).unwrap();
    assert!(sim.set_servo_fault(1, ServoFault::Baud(57_600)));
    let wait = std::time::Duration::from_millis(300);
    let found = |baud| {
        let mut probe =
            SerialScanner::open(sim.port_path(), baud, Framing::Protocol2, wait).unwrap();
        let ids = (1..=3).filter(|id| probe.ping(*id).unwrap().is_some());
        ids.collect::<Vec<u8>>()
    };
    assert_eq!(found(BAUD), [1, 3]);
    assert_eq!(found(57_600), [2]);
    let mut bus = driver(&sim, &hasty(), &servos);
    let error = bus.arm().unwrap_err().to_string();
    assert!(error.starts_with("no answer from joint_2 (id 2) (ping"), "{error}");
}

#[test]
fn full_speed_inside_the_limits_is_clean() {
    // Hard up to full speed, across, and hard to a stop, again and again.
    let servos = robot(2);
    let sim = lockstep(&servos);
    let mut bus = driver(&sim, &patient(), &servos);
    bus.arm().unwrap();
    let mut limiter = servodance_drivers::Limiter::new(servos[0].limits, PERIOD_S, 0.0);
    let mut states = vec![JointState::default(); 2];
    for k in 0..1000 {
        let end =
            if k / 100 % 2 == 0 { servos[0].limits.upper_rad } else { servos[0].limits.lower_rad };
        let target = limiter.step(end).position_rad;
        bus.cycle(&[target, target], &mut states).unwrap();
        sim.advance(PERIOD_S);
    }
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
    let travelled = states[0].position_rad;
    assert!(travelled < servos[0].limits.lower_rad + 0.01, "ended at {travelled}");
}

#[test]
fn same_commands_give_the_same_bytes_and_states() {
    let servos = robot(6);
    let run = || {
        let sim = lockstep(&servos);
        let mut bus = driver(&sim, &patient(), &servos);
        bus.arm().unwrap();
        let mut states = vec![JointState::default(); 6];
        let mut log = Vec::new();
        for k in 0..300 {
            let target = 0.4 * (1.0 - (0.05 * k as f64).cos());
            bus.cycle(&[target; 6], &mut states).unwrap();
            log.extend(states.iter().map(|s| (s.position_rad.to_bits(), s.current_a.to_bits())));
            sim.advance(PERIOD_S);
        }
        bus.disarm().unwrap();
        let truth: Vec<_> = (0..6).map(|i| sim.servo(i).unwrap()).collect();
        // How late answers come is this machine's.
        (log, truth, sim.wire_stats(), BusStats { delay_us: 0, ..bus.stats() })
    };
    let (first, again) = (run(), run());
    assert_eq!((first.2, first.3), (again.2, again.3));
    assert!(first.1 == again.1, "the servos ended elsewhere");
    assert!(first.0 == again.0, "the states read on the way differ");
}

#[test]
fn torque_is_off_after_drop() {
    let servos = robot(3);
    let sim = lockstep(&servos);
    let mut bus = driver(&sim, &patient(), &servos);
    bus.arm().unwrap();
    assert!(any_torque(&sim, &servos));
    drop(bus);
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn silent_servos_are_named_and_nothing_gets_torque() {
    let all = robot(5);
    let sim = lockstep(&all[..3]);
    let mut bus = driver(&sim, &hasty(), &all);
    let error = bus.arm().unwrap_err().to_string();
    let says =
        "no answer from joint_4 (id 4), joint_5 (id 5) (ping, tried 2 times) at 2000000 baud";
    assert!(error.starts_with(says), "{error}");
    assert!(!any_torque(&sim, &all[..3]));
}

#[test]
fn a_servo_that_dies_while_dancing_is_named() {
    for firmware in [48, 40] {
        let servos = robot(5);
        let mut specs = specs(&servos);
        specs[0].firmware = firmware;
        let sim = SimBus::start(&specs, SimOptions::lockstep(BAUD, HZ)).unwrap();
        let mut bus = driver(&sim, &hasty(), &servos);
        let report = bus.arm().unwrap();
        let plain = report.notes.iter().any(|note| {
            note == "plain Sync Read: joint_1 (id 1) runs firmware 40, Fast Sync Read needs 45"
        });
        assert_eq!(plain, firmware == 40, "{:?}", report.notes);
        let mut states = vec![JointState::default(); 5];
        bus.cycle(&[0.0; 5], &mut states).unwrap();
        sim.set_servo_fault(2, ServoFault::Dead);
        let lost = (0..30).find_map(|_| {
            sim.advance(PERIOD_S);
            bus.cycle(&[0.0; 5], &mut states).err()
        });
        match lost.map_or(Ok(()), Err) {
            Err(BusError::Silent { servos, .. }) => {
                assert_eq!(servos.len(), 1);
                assert_eq!(servos[0].to_string(), "joint_3 (id 3)");
            }
            other => panic!("{other:?}"),
        }
        let error = bus.disarm().unwrap_err().to_string();
        assert!(
            error.starts_with("torque may still be ON at joint_3 (id 3): cut the power"),
            "{error}"
        );
        let others = [0, 1, 3, 4].map(|index| sim.servo(index).unwrap().torque_enabled);
        assert_eq!(others, [false; 4]);
    }
}

#[test]
fn a_wrong_model_is_refused_by_name() {
    let servos = robot(2);
    let mut specs = specs(&servos);
    specs[1].model_number = 1060;
    let sim = SimBus::start(&specs, SimOptions::lockstep(BAUD, HZ)).unwrap();
    let error = driver(&sim, &patient(), &servos).arm().unwrap_err().to_string();
    assert_eq!(
        error,
        "joint_2 (id 2) is model number 1060 (XL430-W250), but the robot file says XM430-W350 (number 1020)"
    );
}

#[test]
fn another_firmware_than_wanted_is_refused_with_both_numbers() {
    let mut servos = robot(2);
    servos[0].firmware = Some(48);
    let sim = lockstep(&servos);
    driver(&sim, &patient(), &servos).arm().unwrap();
    servos[1].firmware = Some(45);
    let mut bus = driver(&sim, &patient(), &servos);
    let error = bus.arm().unwrap_err().to_string();
    assert_eq!(error, "joint_2 (id 2): firmware is 48, must be 45, as the robot file says");
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn a_servo_that_may_not_turn_as_fast_as_its_joint_is_refused() {
    let mut servos = robot(2);
    let sim = lockstep(&servos);
    servos[1].limits.velocity_rad_s = 500f64.to_radians();
    let mut bus = driver(&sim, &patient(), &servos);
    let error = bus.arm().unwrap_err().to_string();
    assert_eq!(
        error,
        "joint_2 (id 2): velocity limit in the servo, degrees a second, is 480.9, \
         must be at least velocity_deg_s = 500.0"
    );
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn a_plain_read_that_the_wire_does_not_carry_is_refused_before_torque() {
    let servos = robot(20);
    let mut specs = specs(&servos);
    specs[4].firmware = 40;
    let sim = SimBus::start(&specs, SimOptions::lockstep(BAUD, HZ)).unwrap();
    let arm = |control_hz| {
        let config = BusConfig { control_hz: Some(control_hz), ..patient() };
        driver(&sim, &config, &servos).arm()
    };
    let error = arm(400.0).unwrap_err().to_string();
    assert_eq!(
        error,
        "joint_5 (id 5) runs firmware 40, Fast Sync Read needs 45, and 20 servos at 2000000 baud \
         carry at most 352 cycles a second with a plain Sync Read (568 bytes each), but the robot \
         asks for 400: update the firmware, raise the baud or lower control_hz"
    );
    assert!(!any_torque(&sim, &servos));
    let notes = arm(350.0).unwrap().notes;
    let told = |note: &String| note.starts_with("plain Sync Read: joint_5 (id 5) runs firmware 40");
    assert!(notes.iter().any(told), "{notes:?}");
}

#[test]
fn wrong_supply_is_refused_with_numbers() {
    let servos = robot(1);
    let options = SimOptions { supply_v: Some(8.0), ..SimOptions::lockstep(BAUD, HZ) };
    let sim = SimBus::start(&specs(&servos), options).unwrap();
    let error = driver(&sim, &patient(), &servos).arm().unwrap_err().to_string();
    assert_eq!(error, "joint_1 (id 1): input voltage is 8.0 V, must be 9.5 V to 16.0 V");
}

#[test]
fn a_joint_outside_its_limits_is_refused() {
    let servos = robot(1);
    let mut specs = specs(&servos);
    specs[0].initial_rad = -1.3;
    let sim = SimBus::start(&specs, SimOptions::lockstep(BAUD, HZ)).unwrap();
    let error = driver(&sim, &patient(), &servos).arm().unwrap_err().to_string();
    assert!(
        error.contains("joint_1 (id 1): position is -74.4 degrees, must be -60.0 to 90.0"),
        "{error}"
    );
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn targets_that_are_not_numbers_are_never_sent() {
    let servos = robot(2);
    let sim = lockstep(&servos);
    let mut bus = driver(&sim, &patient(), &servos);
    bus.arm().unwrap();
    let mut states = vec![JointState::default(); 2];
    let before = sim.wire_stats();
    for bad in [f64::NAN, f64::INFINITY] {
        let error = bus.cycle(&[0.0, bad], &mut states).unwrap_err().to_string();
        assert!(error.starts_with("target for joint_2 (id 2) is"), "{error}");
    }
    assert!(matches!(bus.cycle(&[0.0], &mut states), Err(BusError::Length { .. })));
    assert_eq!(sim.wire_stats(), before);
}

#[test]
fn the_servos_stop_by_themselves_when_the_host_goes_silent() {
    let servos = robot(2);
    let sim = lockstep(&servos);
    let mut bus = driver(&sim, &patient(), &servos);
    bus.arm().unwrap();
    let mut states = vec![JointState::default(); 2];
    for k in 0..100 {
        let target = 0.01 * k as f64;
        bus.cycle(&[target; 2], &mut states).unwrap();
        sim.advance(PERIOD_S);
    }
    // With the default watchdog, within what a killed program may cost.
    sim.advance(0.2);
    let stopped = sim.servo(0).unwrap();
    assert!(stopped.watchdog_tripped && stopped.velocity_rad_s.abs() < 0.05, "{stopped:?}");
    sim.advance(1.0);
    assert!((sim.servo(0).unwrap().position_rad - stopped.position_rad).abs() < 0.01);
    // It refuses goals now, and torque can still be turned off.
    bus.cycle(&[0.0; 2], &mut states).unwrap();
    sim.advance(1.0);
    assert!((sim.servo(0).unwrap().position_rad - stopped.position_rad).abs() < 0.01);
    bus.disarm().unwrap();
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn a_hardware_error_stops_the_cycle_by_name() {
    let servos = robot(3);
    let sim = lockstep(&servos);
    let mut bus = driver(&sim, &patient(), &servos);
    bus.arm().unwrap();
    sim.set_servo_fault(1, ServoFault::Overload);
    let mut states = vec![JointState::default(); 3];
    let error = bus.cycle(&[0.0; 3], &mut states).unwrap_err().to_string();
    assert_eq!(
        error,
        "joint_2 (id 2) reports a hardware error: overload; only a reboot or a power cycle clears it"
    );
    bus.disarm().unwrap();
    assert!(bus.arm().is_err(), "armed in spite of the error");
}

#[test]
fn commands_outside_each_limit_are_seen_at_the_servo() {
    let servos = robot(1);
    let run = |goals: &mut dyn FnMut(usize) -> f64| {
        let sim = lockstep(&servos);
        let mut bus = driver(&sim, &patient(), &servos);
        bus.arm().unwrap();
        let mut states = vec![JointState::default()];
        for k in 0..60 {
            bus.cycle(&[goals(k)], &mut states).unwrap();
            sim.advance(PERIOD_S);
        }
        sim.violations()
    };
    // 30 rad/s2 up to 4.4 rad/s, where 4.01 is allowed.
    let mut state = (0.0, 0.0);
    let speeding = run(&mut |_| {
        let room = 1.4 - state.0;
        let top: f64 = if room > 0.4 { 4.4 } else { 0.0 };
        state.1 = f64::clamp(top, state.1 - 0.3, state.1 + 0.3);
        state.0 += state.1 * PERIOD_S;
        state.0
    });
    assert!(speeding.velocity > 0 && speeding.acceleration == 0, "{speeding:?}");
    let jump = run(&mut |k| if k < 10 { 0.0 } else { 0.03 });
    assert!(jump.acceleration > 0 && jump.velocity == 0, "{jump:?}");
    // The driver never sends a goal beyond a limit: tell the servo another way.
    let sim = lockstep(&servos);
    let mut wide = servos.clone();
    wide[0].limits.upper_rad = 2.0;
    let mut bus = driver(&sim, &patient(), &wide);
    bus.arm().unwrap();
    let mut states = vec![JointState::default()];
    let mut limiter = servodance_drivers::Limiter::new(wide[0].limits, PERIOD_S, 0.0);
    for _ in 0..100 {
        bus.cycle(&[limiter.step(1.7).position_rad], &mut states).unwrap();
        sim.advance(PERIOD_S);
    }
    let outside = sim.violations();
    assert!(outside.position > 100 && outside.velocity + outside.acceleration == 0, "{outside:?}");
}

#[test]
fn a_missing_port_is_one_clear_line() {
    let error = SerialBus::open("/dev/ttyNOPE", &patient(), robot(1)).err().unwrap().to_string();
    assert!(error.starts_with("cannot open /dev/ttyNOPE: "), "{error}");
    assert!(!error.contains('\n'));
}

#[test]
fn a_scan_finds_everyone_with_model_firmware_and_errors() {
    let servos = robot(20);
    let mut specs = specs(&servos);
    specs[4].firmware = 41;
    specs[5].model_number = 1060;
    let sim = SimBus::start(&specs, SimOptions::lockstep(BAUD, HZ)).unwrap();
    sim.set_servo_fault(7, ServoFault::Overload);
    sim.set_servo_fault(9, ServoFault::Dead);
    let wait = std::time::Duration::from_millis(300);
    let mut probe = SerialScanner::open(sim.port_path(), BAUD, Framing::Protocol2, wait).unwrap();
    let found = probe.everyone().unwrap();
    let ids: Vec<u8> = found.iter().map(|servo| servo.id).collect();
    assert_eq!(ids, (1..=20).filter(|id| *id != 10).collect::<Vec<u8>>());
    assert_eq!((found[4].firmware, found[5].model), (41, Some("XL430-W250")));
    assert_eq!(found[7].hardware_error.as_deref(), Some("overload"));
    assert_eq!(found[8].hardware_error, None);
    assert_eq!(probe.ping(8).unwrap().unwrap(), found[7]);
    assert_eq!(probe.ping(10).unwrap(), None);
    assert_eq!(probe.vitals(&found[2]).unwrap().unwrap().temperature_c, 25);
    // An id given twice: two of a model answer a ping alike, but stand elsewhere.
    sim.set_servo_fault(0, ServoFault::Moved(0.3));
    sim.set_servo_fault(0, ServoFault::Id(3));
    let error = probe.vitals(&found[2]).unwrap_err();
    assert!(error.to_string().contains("corrupt"), "{error}");
}

#[test]
fn an_id_is_changed_only_where_it_answers_and_with_torque_off() {
    let servos = robot(3);
    let sim = lockstep(&servos);
    let wait = std::time::Duration::from_millis(300);
    let mut torque_on = Vec::new();
    for id in 1..=3 {
        Framing::Protocol2.encode(&mut torque_on, id, 3, &[64, 0, 1]);
    }
    let mut port = serialport::new(sim.port_path(), BAUD).open().unwrap();
    port.write_all(&torque_on).unwrap();
    while !sim.servo(2).unwrap().torque_enabled {}
    drop(port);
    let mut probe = SerialScanner::open(sim.port_path(), BAUD, Framing::Protocol2, wait).unwrap();
    let found = probe.ping(2).unwrap().unwrap();
    probe.set_id(&found, 42).unwrap();
    assert_eq!(probe.ping(2).unwrap(), None);
    assert_eq!(probe.ping(42).unwrap().unwrap().id, 42);
    assert!(!sim.servo(1).unwrap().torque_enabled);
    assert!(sim.servo(0).unwrap().torque_enabled);
}
