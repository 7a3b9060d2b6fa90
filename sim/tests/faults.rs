//! Every fault, against the driver inside the safety layer.
//!
//! For each: dance two seconds, let it happen, dance on or stop, and judge at
//! the servos. The table goes to `fault-table.md` in the test's output folder.

mod common;

use std::fmt::Write;

use common::*;
use servodance_drivers::{BusConfig, BusKind, SafeBus, SafetyConfig, Servo, open_bus};
use servodance_sim::{ServoFault, SimBus, SimOptions, WireFault};
use servodance_types::JointState;

const HEAD: &str = "\
| fault | the user is told | safe after, ms | retries | goals beyond a limit | motion beyond a limit |
|---|---|---|---|---|---|
";

/// What one fault came to.
#[derive(Debug)]
struct Outcome {
    /// The error that the program saw, if it could not dance on.
    error: Option<String>,
    /// From the fault until every servo had no torque or stood by its own
    /// watchdog, simulated seconds. Zero periods when the dance went on.
    safe_after_s: f64,
    retries: u64,
    /// By the true motion, and by what was told.
    went: u64,
    told: u64,
    notes: Vec<String>,
}

/// The drivers and the ways they read.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Fast,
    Plain,
    Feetech,
}

/// Dances 5 joints, lets `happen` take place after 2 s, goes on for 3 s more.
fn dance(kind: Kind, happen: impl FnOnce(&mut SimBus)) -> Outcome {
    let (model, bus_kind, baud) = match kind {
        Kind::Feetech => ("STS3215", BusKind::Feetech, 1_000_000),
        _ => ("XM430-W350", BusKind::Dynamixel2, BAUD),
    };
    let servos = robot_of(model, 5);
    let mut specs = specs(&servos);
    specs[0].firmware = if kind == Kind::Plain { 40 } else { 48 };
    let mut sim = SimBus::start(&specs, SimOptions::lockstep(baud, HZ)).unwrap();
    let config = BusConfig {
        reply_timeout_ms: 50.0,
        retries: 3,
        accept_no_watchdog: true,
        ..BusConfig::of_kind(bus_kind, baud)
    };
    let bus = open_bus(&sim.port(), &config, servos.clone()).unwrap();
    let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap();
    safe.arm(0.0).unwrap();
    let mut states = vec![JointState::default(); servos.len()];
    let mut happen = Some(happen);
    let mut error = None;
    for k in 0..500 {
        let now_s = k as f64 * PERIOD_S;
        if k == 200
            && let Some(happen) = happen.take()
        {
            happen(&mut sim);
        }
        let target = 0.6 * (1.0 - (4.0 * now_s).cos());
        safe.command(now_s, &vec![target; servos.len()]);
        if let Err(reason) = safe.tick(now_s, &mut states) {
            error = Some(reason.to_string());
            break;
        }
        sim.advance(PERIOD_S);
    }
    let began_s = if error.is_some() { 2.0 } else { sim.time_s() };
    let mut waited = 0;
    while error.is_some() && !is_safe(&sim, &servos) && waited < 1000 {
        sim.advance(PERIOD_S);
        waited += 1;
    }
    Outcome {
        error,
        safe_after_s: sim.time_s() - began_s,
        retries: safe.stats().retries,
        went: sim.motion_violations().total(),
        told: sim.violations().total() - sim.motion_violations().total(),
        notes: sim.violation_notes(),
    }
}

/// No torque, stopped by its own watchdog, or (where there is none) at rest.
fn is_safe(sim: &SimBus, servos: &[Servo]) -> bool {
    servos.iter().enumerate().all(|(index, servo)| {
        let state = sim.servo(index).unwrap();
        let rests = servo.model.kind == BusKind::Feetech && state.velocity_rad_s.abs() < 0.02;
        !state.torque_enabled || state.watchdog_tripped || rests
    })
}

/// Adds a row, and checks what every row must hold.
fn row(table: &mut String, what: &str, outcome: &Outcome) {
    assert_eq!(outcome.went, 0, "{what}: {:?}", outcome.notes);
    // A lost goal makes the next a double step, and a servo with another's id
    // hears the other's goals: nobody can take that back.
    let astray = what.contains("damaged request") || what.contains("neighbour");
    assert!(outcome.told == 0 || astray, "{what}: {:?}", outcome.notes);
    let told = outcome.error.as_deref().unwrap_or("danced on");
    let safe_ms = outcome.safe_after_s * 1e3;
    assert!(
        outcome.error.is_none() || safe_ms < 2500.0,
        "{what}: {outcome:?}"
    );
    writeln!(
        table,
        "| {what} | {told} | {safe_ms:.0} | {} | {} | {} |",
        outcome.retries, outcome.told, outcome.went
    )
    .unwrap();
}

#[test]
fn every_fault_ends_safely_and_is_told() {
    let mut table = String::from(HEAD);
    for kind in [Kind::Fast, Kind::Plain, Kind::Feetech] {
        // Rare damage is repaired by retries.
        for (name, fault) in [
            ("lost", WireFault::Drop),
            ("corrupt", WireFault::Corrupt),
            ("cut short", WireFault::Truncate),
            ("preceded by noise", WireFault::Noise),
            ("late by 60 ms", WireFault::Late(0.06)),
            ("to a damaged request", WireFault::CorruptInstruction),
        ] {
            let share = if kind == Kind::Fast { 0.01 } else { 0.002 };
            let outcome = dance(kind, |sim| sim.set_wire_fault(Some((fault, share))));
            let what = format!("{kind:?}, {:.1} % of replies {name}", share * 100.0);
            row(&mut table, &what, &outcome);
            assert!(outcome.error.is_none(), "{what}: {outcome:?}");
        }
        // All the time.
        for (name, fault) in [
            ("doubled", WireFault::Duplicate),
            ("after an echo", WireFault::Echo),
        ] {
            let outcome = dance(kind, |sim| sim.set_wire_fault(Some((fault, 1.0))));
            let what = format!("{kind:?}, every reply {name}");
            row(&mut table, &what, &outcome);
            // The pieces of a fast reply, doubled one by one, are not a packet.
            let harmless = kind != Kind::Fast || fault == WireFault::Echo;
            assert_eq!(outcome.error.is_none(), harmless, "{what}: {outcome:?}");
        }
        // A bus without sound replies.
        for (name, fault, says) in [
            (
                "lost",
                WireFault::Drop,
                "no answer from joint_1 (id 1), joint_2 (id 2), joint_3",
            ),
            (
                "corrupt",
                WireFault::Corrupt,
                "(present state, tried 4 times)",
            ),
        ] {
            let outcome = dance(kind, |sim| sim.set_wire_fault(Some((fault, 1.0))));
            let what = format!("{kind:?}, every reply {name}");
            row(&mut table, &what, &outcome);
            let error = outcome.error.expect(&what);
            assert!(error.contains(says), "{what}: {error}");
            assert!(error.contains("torque may still be ON"), "{what}: {error}");
        }
        for (name, fault, says) in [
            (
                "cut off",
                ServoFault::Dead,
                "no answer from joint_3 (id 3) (present state",
            ),
            (
                "rebooting",
                ServoFault::Reboot,
                "no answer from joint_3 (id 3) (present state",
            ),
            ("jammed", ServoFault::Jam, "joint_3 (id 3) is "),
            (
                "overloaded",
                ServoFault::Overload,
                "joint_3 (id 3) reports a hardware error: overload",
            ),
            (
                "at 85 C",
                ServoFault::Overheat(85.0),
                "joint_3 (id 3) reports a hardware error: overheating",
            ),
            (
                "with a new id",
                ServoFault::Id(77),
                "no answer from joint_3 (id 3) (present state",
            ),
            ("with a neighbour's id", ServoFault::Id(4), "joint_3 (id 3)"),
        ] {
            let outcome = dance(kind, |sim| assert!(sim.set_servo_fault(2, fault)));
            let what = format!("{kind:?}, joint_3 {name}");
            row(&mut table, &what, &outcome);
            let error = outcome.error.expect(&what);
            assert!(error.contains(says), "{what}: {error}");
        }
        let outcome = dance(kind, SimBus::unplug);
        let what = format!("{kind:?}, adapter unplugged");
        row(&mut table, &what, &outcome);
        assert!(outcome.safe_after_s < 0.5, "{what}: {outcome:?}");
        let error = outcome.error.expect(&what);
        assert!(
            error.starts_with("serial port /dev/pts/"),
            "{what}: {error}"
        );
    }
    let file = concat!(env!("CARGO_TARGET_TMPDIR"), "/fault-table.md");
    std::fs::write(file, &table).unwrap();
    println!("{table}");
}
