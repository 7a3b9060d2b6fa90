//! A backup written back into servos: what differs is shown, asked about, written and read
//! back.

use crate::bus_tools::Consent;
use crate::bus_tools::memory::backup_file::{BackupFile, SavedServo};
use crate::bus_tools::memory::place::{OpenServo, ServoPlace, ServoPlaces};
use crate::bus_tools::memory::write::written;
use anyhow::{Context, bail};
use servodance_drivers::serial::table::entry::TableEntry;
use std::path::Path;

/// A register that holds something else than the file says.
struct Difference {
    entry: &'static TableEntry,
    /// What the file says.
    bits: u64,
}

/// Writes the registers of `file` that differ, after consent, and says a line for each.
///
/// Nothing is written if anything is refused: a servo that does not answer or is of another
/// model, a register that it does not have, a value that may not be written, torque that is on.
pub fn restore(
    places: &ServoPlaces,
    file: &Path,
    consent: Consent,
    say: impl Fn(&str),
) -> anyhow::Result<()> {
    let backup = BackupFile::read(file)?;
    let mut plans: Vec<(ServoPlace, Vec<Difference>)> = Vec::new();
    let mut count = 0;
    for saved in &backup.servos {
        let place = place_of(places, saved)?;
        let mut open = place.open()?;
        let found = differences(&mut open, saved, &say)?;
        if !found.is_empty() {
            open.probe.refuse_torque(&open.found, &open.table)?;
        }
        count += found.len();
        plans.push((place, found));
    }
    if count == 0 {
        say(&format!("{} servos hold what the file says", plans.len()));
        return Ok(());
    }
    plans.retain(|(_, differences)| !differences.is_empty());
    let names: Vec<&str> = plans.iter().map(|(place, _)| place.label.as_str()).collect();
    consent.obtain(&format!("{count} registers of {} are written for good.", names.join(", ")))?;
    for (place, differences) in plans {
        let mut open = place.open()?;
        for Difference { entry, bits } in differences {
            say(&written(&mut open, entry, bits)?);
        }
    }
    Ok(())
}

/// Where a servo of the file is to be found now: by its joint, else by its id.
fn place_of(places: &ServoPlaces, saved: &SavedServo) -> anyhow::Result<ServoPlace> {
    match places.joint(&saved.name) {
        Some(place) => Ok(place),
        None => places.by_id(saved.id, Some(saved.baud)),
    }
}

/// What differs, with a line for each; every value of the file is looked at.
fn differences(
    open: &mut OpenServo,
    saved: &SavedServo,
    say: impl Fn(&str),
) -> anyhow::Result<Vec<Difference>> {
    if open.found.model_number != saved.model_number {
        bail!(
            "{} is {} (model number {}), but the backup is of {} ({}): nothing was written",
            open.label,
            open.table.model,
            open.found.model_number,
            saved.model,
            saved.model_number
        );
    }
    let mut differences = Vec::new();
    for (name, value) in &saved.registers {
        let refused = || format!("the backup of {}", saved.name);
        let entry = open.table.find(name).with_context(refused)?;
        let bits = open.table.bits(entry, *value).with_context(refused)?;
        let actual = open.probe.bits(&open.found, entry.register)?;
        if actual != bits {
            let (is, was) = (open.table.show(entry, actual), open.table.show(entry, bits));
            say(&format!("{}: {name} is {is}, the file says {was}", open.label));
            differences.push(Difference { entry, bits });
        }
    }
    Ok(differences)
}
