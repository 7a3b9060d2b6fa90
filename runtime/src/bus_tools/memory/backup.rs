//! A backup of servos: what each keeps for good, into a file.

use crate::bus_tools::memory::backup_file::{SavedRegister, SavedServo, head, servo_text};
use crate::bus_tools::memory::place::{OpenServo, ServoPlaces};
use crate::telemetry::pending_file::PendingFile;
use servodance_drivers::BusError;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

/// Writes the permanent registers of every servo into `file`, which appears whole or not at
/// all; says a line for each servo. Every servo of a robot must answer.
pub fn back_up(places: &ServoPlaces, file: &Path, say: impl Fn(&str)) -> anyhow::Result<()> {
    // A file that cannot be written is told before servos are asked.
    let pending = PendingFile::create(file)?;
    let mut text = head();
    for place in places.all()? {
        let mut open = place.open()?;
        let registers = permanent(&mut open)?;
        let servo = SavedServo {
            name: open.label.clone(),
            id: open.found.id,
            baud: open.found.baud,
            model: open.table.model.into(),
            model_number: open.found.model_number,
            firmware: open.found.firmware,
            registers: BTreeMap::new(),
        };
        text += &servo_text(&servo, &registers);
        say(&format!("{}: {}, {} registers", open.label, open.who(), registers.len()));
    }
    let mut out = pending.writer()?;
    out.write_all(text.as_bytes())?;
    out.flush()?;
    pending.finish()
}

/// What a servo keeps for good, but for its id and rate.
pub(super) fn permanent(open: &mut OpenServo) -> anyhow::Result<Vec<SavedRegister>> {
    let mut registers = Vec::new();
    for entry in open.table.permanent() {
        let bits = match open.probe.bits(&open.found, entry.register) {
            // Old firmware lacks some of its model's registers.
            Err(BusError::Refused { .. }) => continue,
            read => read?,
        };
        registers.push(SavedRegister {
            name: entry.name(),
            value: entry.decode(bits),
            shown: open.table.show(entry, bits),
        });
    }
    Ok(registers)
}
