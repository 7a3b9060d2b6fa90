//! The settings of one servo as arming wants them, and what arming would refuse: limits of the
//! servo's own that cut the joint's, an offset that the robot file does not name.

use crate::bus_tools::listen::SerialListener;
use anyhow::Context;
use servodance_drivers::serial::Register;
use servodance_drivers::serial::table::RegisterTable;
use servodance_drivers::serial::table::entry::TableEntry;
use servodance_drivers::{Bus, BusConfig, FoundServo, Port, SerialScanner, Servo, open_bus};

/// Torque off, then every setting, each read back, with a line for each change; in the end the
/// checks of arming. The servo keeps its id and rate.
pub(super) fn settle(
    port: &Port,
    listener: &SerialListener,
    config: &BusConfig,
    servo: &Servo,
    found: &FoundServo,
    say: &dyn Fn(&str),
) -> anyhow::Result<()> {
    settle_registers(listener, servo, found, say)?;
    let config = BusConfig {
        baud: found.baud,
        // One servo, at its own rate: nothing is cycled.
        control_hz: None,
        imu: None,
        accept_no_watchdog: true,
        ..config.clone()
    };
    let as_it_is = Servo { id: found.id, ..servo.clone() };
    let mut bus = open_bus(port, &config, vec![as_it_is])?;
    for change in bus.set_up()? {
        say(&change);
    }
    bus.prepare()?;
    Ok(())
}

/// What no arming writes.
fn settle_registers(
    listener: &SerialListener,
    servo: &Servo,
    found: &FoundServo,
    say: &dyn Fn(&str),
) -> anyhow::Result<()> {
    let mut probe = listener.patient_probe(found.family.framing(), found.baud)?;
    probe.torque_off(found)?;
    let table = found.table();
    let table = table.with_context(|| format!("{}: its registers are not known", servo.name))?;
    for (entry, value) in wanted(&mut probe, &table, servo, found)? {
        let bits = table.bits(entry, value)?;
        let old = probe.bits(found, entry.register)?;
        if old != bits {
            probe.write_entry(found, &table, entry, bits)?;
            let (name, old, new) = (entry.name(), table.show(entry, old), table.show(entry, bits));
            say(&format!("{}: {name} changed from {old} to {new}", servo.name));
        }
    }
    Ok(())
}

/// Registers that the robot file decides about, with what they are to hold.
fn wanted(
    probe: &mut SerialScanner,
    table: &RegisterTable,
    servo: &Servo,
    found: &FoundServo,
) -> anyhow::Result<Vec<(&'static TableEntry, i64)>> {
    let mut wanted = Vec::new();
    let mut actual = |register: Register| -> anyhow::Result<Option<(&'static TableEntry, i64)>> {
        let Some(entry) = table.entry(register) else { return Ok(None) };
        Ok(Some((entry, entry.decode(probe.bits(found, register)?))))
    };
    if let Some((low, high)) = table.places.goals
        && let (Some((low, lowest)), Some((high, highest))) = (actual(low)?, actual(high)?)
    {
        let (needs_low, needs_high) = servo.goal_range_ticks();
        let cuts = lowest > i64::from(needs_low) || highest < i64::from(needs_high);
        // Both limits zero is a servo without limits.
        if cuts && (lowest, highest) != (0, 0) {
            wanted.push((low, low.range.0));
            wanted.push((high, high.range.1));
        }
    }
    if let Some(register) = table.places.offset
        && let Some((entry, _)) = actual(register)?
    {
        wanted.push((entry, i64::from(servo.settings.homing_offset.unwrap_or(0))));
    }
    if let Some(register) = table.places.speed
        && let Some((entry, fastest)) = actual(register)?
    {
        let needed = servo.limits.velocity_rad_s / servo.model.velocity_rad_s_per_unit;
        let needed = needed.ceil() as i64;
        if fastest < needed {
            wanted.push((entry, needed));
        }
    }
    Ok(wanted)
}
