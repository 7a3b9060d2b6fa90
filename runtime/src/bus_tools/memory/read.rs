//! Registers of one servo, with their units.

use crate::bus_tools::memory::place::{ServoPlace, usage};
use servodance_drivers::BusError;
use servodance_drivers::serial::table::entry::TableEntry;

/// Says a line for each register that is named, or for every one that the servo has; `note`
/// gets a line about the servo. Unknown names are wrong usage.
pub fn read(
    place: &ServoPlace,
    names: &[String],
    say: impl Fn(&str),
    note: impl Fn(&str),
) -> anyhow::Result<()> {
    let mut open = place.open()?;
    let mut entries: Vec<&TableEntry> = Vec::with_capacity(names.len());
    for name in names {
        entries.push(open.table.find(name).map_err(usage)?);
    }
    if names.is_empty() {
        entries = open.table.entries();
        note(&open.who());
    }
    let widest = entries.iter().map(|entry| entry.name().len()).max().unwrap_or(0);
    for entry in entries {
        let bits = match open.probe.bits(&open.found, entry.register) {
            // Old firmware lacks some of its model's registers.
            Err(BusError::Refused { .. }) if names.is_empty() => continue,
            read => read?,
        };
        say(&format!("{:<widest$} {}", entry.name(), open.table.show(entry, bits)));
    }
    Ok(())
}
