//! New values for registers of one servo, each read back.

use crate::bus_tools::memory::place::{OpenServo, ServoPlace, usage};
use crate::process::wrong_usage::WrongUsage;
use servodance_drivers::serial::table::entry::{Access, TableEntry};

/// Writes `NAME=VALUE` after `NAME=VALUE` and says a line for each. All are looked at before
/// the first is written.
///
/// Wrong usage: names and values that cannot be, goals, ids and rates, whatever turns torque
/// on. Refused: permanent memory while torque is on.
pub fn write(place: &ServoPlace, settings: &[String], say: impl Fn(&str)) -> anyhow::Result<()> {
    let mut open = place.open()?;
    let mut changes = Vec::with_capacity(settings.len());
    for setting in settings {
        changes.push(change(&open, setting)?);
    }
    let lets_go = |entry: &TableEntry| entry.register == open.table.torque;
    let is_permanent = |entry: &TableEntry| entry.access == Access::Eeprom;
    // Nothing is to be half written: torque that is on and stays on is refused at once.
    if changes.iter().any(|(entry, _)| is_permanent(entry))
        && !changes.iter().any(|(entry, _)| lets_go(entry))
    {
        open.probe.refuse_torque(&open.found, &open.table)?;
    }
    for (entry, bits) in changes {
        say(&written(&mut open, entry, bits)?);
    }
    Ok(())
}

fn change(open: &OpenServo, setting: &str) -> anyhow::Result<(&'static TableEntry, u64)> {
    let (name, text) = setting
        .split_once('=')
        .ok_or_else(|| WrongUsage(format!("\"{setting}\" sets nothing; say REGISTER=VALUE")))?;
    let entry = open.table.find(name.trim()).map_err(usage)?;
    Ok((entry, open.table.bits_of_text(entry, text).map_err(usage)?))
}

/// Writes one register if it holds something else; a line about it.
pub(super) fn written(
    open: &mut OpenServo,
    entry: &TableEntry,
    bits: u64,
) -> anyhow::Result<String> {
    let OpenServo { label, probe, found, table } = open;
    let name = entry.name();
    let old = probe.bits(found, entry.register)?;
    let new = table.show(entry, bits);
    if old == bits {
        return Ok(format!("{label}: {name} is {new} already"));
    }
    probe.write_entry(found, table, entry, bits)?;
    let old = table.show(entry, old);
    Ok(format!("{label}: {name} changed from {old} to {new}, read back"))
}
