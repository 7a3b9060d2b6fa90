//! Every fault against every CAN driver inside the safety layer, over slcan.
//!
//! The table goes to `can-fault-table-KIND.md` in the test's output folder; a copy
//! is kept in `reference/can-faults.md`.

mod common;

use common::can::*;
use common::fault_table::{self, HEAD, LostBy, Outcome, clock_for, row};
use common::*;
use servodance_drivers::BusConfig;
use servodance_sim::{ServoFault, SimBus, WireFault};

fn dance(kind: MotorKind, happen: impl FnOnce(&mut SimBus)) -> Outcome {
    dance_by(LostBy::Simulation, kind, happen)
}

fn on_the_wire(kind: MotorKind, fault: WireFault, share: f64) -> Outcome {
    let happen = |sim: &mut SimBus| sim.set_wire_fault(Some((fault, share)));
    dance_by(clock_for(fault), kind, happen)
}

fn dance_by(clock: LostBy, kind: MotorKind, happen: impl FnOnce(&mut SimBus)) -> Outcome {
    let servos = can_robot(kind, 5);
    let config = BusConfig { reply_timeout_ms: 200.0, retries: 4, ..can_patient(kind) };
    fault_table::dance(&servos, &specs(&servos), config, clock, happen)
}

/// What each motor calls an overload, and overheating.
fn names(kind: MotorKind) -> [&'static str; 3] {
    match kind {
        MotorKind::CubeMars => ["motor stalled", "motor overheating", "under-voltage"],
        MotorKind::Damiao | MotorKind::DamiaoOwnLoops => {
            ["overload (error E)", "coil overheating", "under-voltage"]
        }
        MotorKind::Robstride => ["overload", "overheating", "under-voltage"],
        MotorKind::Odrive => ["current limit violation", "motor overheating", "under-voltage"],
        MotorKind::Cia402 => ["motor blocked", "overheating", "under-voltage"],
        MotorKind::Myactuator => ["motor stalled", "motor overheating", "under-voltage"],
        MotorKind::Moteus => ["motor driver fault", "overheating", "under-voltage"],
        MotorKind::RobstrideMit => ["overload", "overheating", "under-voltage"],
    }
}

/// The part of the table for one kind of motor.
fn every_fault(kind: MotorKind) {
    let mut table = String::from(HEAD);
    wire_faults(kind, &mut table);
    motor_faults(kind, &mut table);
    adapter_faults(kind, &mut table);
    let folder = env!("CARGO_TARGET_TMPDIR");
    std::fs::write(format!("{folder}/can-fault-table-{kind:?}.md"), &table).unwrap();
    println!("{table}");
}

#[test]
fn every_fault_of_cubemars_motors_ends_safely_and_is_told() {
    every_fault(MotorKind::CubeMars);
}

#[test]
fn every_fault_of_damiao_motors_ends_safely_and_is_told() {
    every_fault(MotorKind::Damiao);
}

#[test]
fn every_fault_of_damiao_motors_in_position_velocity_mode_ends_safely_and_is_told() {
    every_fault(MotorKind::DamiaoOwnLoops);
}

#[test]
fn every_fault_of_robstride_motors_ends_safely_and_is_told() {
    every_fault(MotorKind::Robstride);
}

#[test]
fn every_fault_of_odrive_controllers_ends_safely_and_is_told() {
    every_fault(MotorKind::Odrive);
}

#[test]
fn every_fault_of_cia402_drives_ends_safely_and_is_told() {
    every_fault(MotorKind::Cia402);
}

#[test]
fn every_fault_of_myactuator_motors_ends_safely_and_is_told() {
    every_fault(MotorKind::Myactuator);
}

#[test]
fn every_fault_of_robstride_motors_in_mit_mode_ends_safely_and_is_told() {
    every_fault(MotorKind::RobstrideMit);
}

#[test]
fn every_fault_of_moteus_controllers_ends_safely_and_is_told() {
    every_fault(MotorKind::Moteus);
}

fn wire_faults(kind: MotorKind, table: &mut String) {
    for (name, fault, share) in [
        ("0.5 % of replies lost", WireFault::Drop, 0.005),
        ("0.5 % of replies cut short", WireFault::Truncate, 0.005),
        ("0.5 % of replies late by 250 ms", WireFault::Late(0.25), 0.005),
        ("0.5 % of commands lost in the adapter", WireFault::CorruptInstruction, 0.005),
        ("5 % of frames damaged (and repeated)", WireFault::Corrupt, 0.05),
        ("20 % of replies preceded by noise", WireFault::Noise, 0.2),
        ("every reply doubled", WireFault::Duplicate, 1.0),
        ("every command echoed", WireFault::Echo, 1.0),
    ] {
        let outcome = on_the_wire(kind, fault, share);
        let what = format!("{kind:?}, {name}");
        row(table, &what, &outcome);
        let waited_in_vain = matches!(fault, WireFault::Late(_)) && kind == MotorKind::Myactuator;
        if waited_in_vain {
            // Their time-out is shorter: nothing was said to the others meanwhile.
            let told = format!("{outcome:?}");
            assert!(told.contains("stopped by their own watchdog"), "{what}: {told}");
        } else {
            assert!(outcome.error.is_none(), "{what}: {outcome:?}");
        }
    }
    let outcome = on_the_wire(kind, WireFault::Drop, 1.0);
    let what = format!("{kind:?}, every reply lost");
    row(table, &what, &outcome);
    let error = outcome.error.expect(&what);
    let says = "no answer from joint_1 (id 1), joint_2 (id 2), joint_3 (id 3), joint_4 (id 4), \
                joint_5 (id 5) (target and state, tried 5 times)";
    assert!(error.starts_with(says), "{what}: {error}");
    assert!(error.contains("torque may still be ON"), "{what}: {error}");
}

fn motor_faults(kind: MotorKind, table: &mut String) {
    let [overload, heat, voltage] = names(kind);
    let silent = "no answer from joint_3 (id 3) (target and state";
    for (name, fault, says) in [
        ("cut off", ServoFault::Dead, silent),
        ("rebooting", ServoFault::Reboot, silent),
        ("jammed", ServoFault::Jam, "joint_3 (id 3) is "),
        ("overloaded", ServoFault::Overload, overload),
        ("at 120 C", ServoFault::Overheat(120.0), heat),
        ("at 10 V", ServoFault::Supply(10.0), voltage),
        ("at another bitrate", ServoFault::Baud(500_000), silent),
        ("with a new id", ServoFault::Id(77), silent),
        // There is no other question than the command.
        ("with a neighbour's id, asked by its command", ServoFault::Id(4), "joint_3 (id 3)"),
    ] {
        let outcome = dance(kind, |sim| assert!(sim.set_servo_fault(2, fault)));
        let what = format!("{kind:?}, joint_3 {name}");
        row(table, &what, &outcome);
        let error = outcome.error.expect(&what);
        assert!(error.contains(says), "{what}: {error}");
        assert!(error.contains("joint_3 (id 3)"), "{what}: {error}");
    }
}

fn adapter_faults(kind: MotorKind, table: &mut String) {
    let outcome = dance(kind, |sim| sim.set_bus_off(true));
    let what = format!("{kind:?}, bus-off");
    row(table, &what, &outcome);
    let error = outcome.error.expect(&what);
    // An fdcanusb says no more than that it refuses.
    let says = if kind == MotorKind::Moteus { "no answer from joint_1" } else { "is bus-off" };
    assert!(error.contains(says), "{what}: {error}");

    let outcome = dance(kind, SimBus::unplug);
    let what = format!("{kind:?}, adapter unplugged");
    row(table, &what, &outcome);
    // Their own time-out stops them; those without one stand at their last target.
    assert!(outcome.safe_after_s < 0.2, "{what}: {outcome:?}");
    let error = outcome.error.expect(&what);
    let adapter = if kind == MotorKind::Moteus { "fdcanusb" } else { "slcan" };
    let says = format!("CAN link {adapter}:/dev/ttyUSB0");
    assert!(error.starts_with(&says), "{what}: {error}");
}
