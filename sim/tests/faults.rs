//! Every fault, against the driver inside the safety layer.
//!
//! For each: dance two seconds, let it happen, dance on or stop, and judge at
//! the servos. The table goes to `fault-table.md` in the test's output folder.

mod common;

use common::fault_table::{self, Event, HEAD, LostBy, Outcome, clock_for, row};
use common::*;
use servodance_drivers::{BusConfig, BusKind, SafetyConfig, ServoLost};
use servodance_sim::{ServoFault, SimBus, WireFault};

/// The drivers and the ways they read.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Fast,
    Plain,
    Feetech,
    /// Protocol 1.0, each servo asked by itself.
    Ax,
    /// Protocol 1.0, one Bulk Read.
    Mx1,
}

const KINDS: [Kind; 5] = [Kind::Fast, Kind::Plain, Kind::Feetech, Kind::Ax, Kind::Mx1];

impl Kind {
    /// Where a servo shuts itself down, Celsius.
    fn hottest_c(self) -> f64 {
        match self {
            Kind::Feetech | Kind::Ax => 70.0,
            _ => 80.0,
        }
    }

    /// Model, protocol and rate.
    fn bus(self) -> (&'static str, BusKind, u32) {
        match self {
            Kind::Fast | Kind::Plain => ("XM430-W350", BusKind::Dynamixel2, BAUD),
            Kind::Feetech => ("STS3215", BusKind::Feetech, 1_000_000),
            Kind::Ax => ("AX-18A", BusKind::Dynamixel1, 1_000_000),
            Kind::Mx1 => ("MX-28(1.0)", BusKind::Dynamixel1, 1_000_000),
        }
    }
}

/// Dances 5 joints, lets `happen` take place after 2 s, goes on for 3 s more.
fn dance(kind: Kind, happen: impl FnOnce(&mut SimBus)) -> Outcome {
    play(kind, |_| {}, vec![(2.0, Box::new(happen))])
}

fn on_the_wire(kind: Kind, fault: WireFault, share: f64) -> Outcome {
    let happen = move |sim: &mut SimBus| sim.set_wire_fault(Some((fault, share)));
    let events: Vec<Event> = vec![(2.0, Box::new(happen))];
    play_by(clock_for(fault), kind, |_| {}, events)
}

fn play(kind: Kind, safety: impl FnOnce(&mut SafetyConfig), events: Vec<Event<'_>>) -> Outcome {
    play_by(LostBy::Simulation, kind, safety, events)
}

fn play_by(
    clock: LostBy,
    kind: Kind,
    safety: impl FnOnce(&mut SafetyConfig),
    events: Vec<Event<'_>>,
) -> Outcome {
    let (model, bus_kind, baud) = kind.bus();
    let servos = robot_of(model, 5);
    let mut specs = specs(&servos);
    specs[0].firmware = if kind == Kind::Plain { 40 } else { 48 };
    let config =
        BusConfig { reply_timeout_ms: 50.0, retries: 3, ..BusConfig::of_kind(bus_kind, baud) };
    let mut safety_config = SafetyConfig::at_hz(HZ);
    safety(&mut safety_config);
    fault_table::play(&servos, &specs, config, clock, safety_config, events)
}

#[test]
fn every_fault_ends_safely_and_is_told() {
    let mut table = String::from(HEAD);
    for kind in KINDS {
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
            let outcome = on_the_wire(kind, fault, share);
            let what = format!("{kind:?}, {:.1} % of replies {name}", share * 100.0);
            row(&mut table, &what, &outcome);
            assert!(outcome.error.is_none(), "{what}: {outcome:?}");
        }
        // All the time.
        for (name, fault) in [("doubled", WireFault::Duplicate), ("after an echo", WireFault::Echo)]
        {
            let outcome = on_the_wire(kind, fault, 1.0);
            let what = format!("{kind:?}, every reply {name}");
            row(&mut table, &what, &outcome);
            assert!(outcome.error.is_none(), "{what}: {outcome:?}");
        }
        // A bus without sound replies.
        for (name, fault, says) in [
            ("lost", WireFault::Drop, "no answer from joint_1 (id 1), joint_2 (id 2), joint_3"),
            ("corrupt", WireFault::Corrupt, "(present state, tried 4 times)"),
        ] {
            let outcome = on_the_wire(kind, fault, 1.0);
            let what = format!("{kind:?}, every reply {name}");
            row(&mut table, &what, &outcome);
            let error = outcome.error.expect(&what);
            assert!(error.contains(says), "{what}: {error}");
            assert!(error.contains("torque may still be ON"), "{what}: {error}");
        }
        for (name, fault, says) in [
            ("cut off", ServoFault::Dead, "no answer from joint_3 (id 3) (present state"),
            ("rebooting", ServoFault::Reboot, "no answer from joint_3 (id 3) (present state"),
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
                "at another rate",
                ServoFault::Baud(57_600),
                "no answer from joint_3 (id 3) (present state",
            ),
            ("with a new id", ServoFault::Id(77), "no answer from joint_3 (id 3) (present state"),
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
        assert!(error.starts_with("serial port /dev/ttyUSB0"), "{what}: {error}");
    }
    recoveries(&mut table);
    let file = concat!(env!("CARGO_TARGET_TMPDIR"), "/fault-table.md");
    std::fs::write(file, &table).unwrap();
    println!("{table}");
}

/// Faults that a robot survives, if it may, and limits that it keeps away from.
fn recoveries(table: &mut String) {
    let suffer = |fault| move |sim: &mut SimBus| assert!(sim.set_servo_fault(2, fault));
    for kind in KINDS {
        let mut check = |what: &str, outcome: Outcome, says: &str| {
            let what = format!("{kind:?}, {what}");
            row(table, &what, &outcome);
            assert!(outcome.error.is_none(), "{what}: {outcome:?}");
            let told = outcome.remarks.iter().any(|remark| remark.contains(says));
            assert!(told, "{what}: {says} not in {:?}", outcome.remarks);
        };
        let back = "joint_3 (id 3) is back after";
        let reboot: Vec<Event> = vec![(2.0, Box::new(suffer(ServoFault::Reboot)))];
        let dance_on = |safety: &mut SafetyConfig| safety.on_servo_lost = ServoLost::DanceOn;
        let outcome = play(kind, dance_on, reboot);
        check("joint_3 rebooting, the others dance on", outcome, back);
        let cut: Vec<Event> = vec![
            (2.0, Box::new(suffer(ServoFault::Dead))),
            (3.0, Box::new(suffer(ServoFault::Revive))),
        ];
        let hold = |safety: &mut SafetyConfig| safety.on_servo_lost = ServoLost::Hold;
        let outcome = play(kind, hold, cut);
        check("joint_3 cut off for 1 s, the others hold", outcome, back);
        let unplug: Vec<Event> = vec![
            (2.0, Box::new(SimBus::unplug)),
            (3.0, Box::new(|sim: &mut SimBus| sim.replug().unwrap())),
        ];
        let outcome = play(kind, |safety| safety.rearm = true, unplug);
        let adapter = "the adapter is back after";
        check("adapter unplugged for 1 s, may arm again", outcome, adapter);
        let warm = ServoFault::Overheat(kind.hottest_c() - 8.0);
        let outcome = dance(kind, suffer(warm));
        let smaller = "smaller motion: joint_3 (id 3): temperature is";
        check("joint_3 8 C below its limit", outcome, smaller);
        let hot = ServoFault::Overheat(kind.hottest_c() - 1.0);
        let outcome = dance(kind, suffer(hot));
        let what = format!("{kind:?}, joint_3 1 C below its limit");
        row(table, &what, &outcome);
        let error = outcome.error.expect(&what);
        assert!(error.starts_with("joint_3 (id 3): temperature"), "{error}");
    }
}
