//! The file of a backup: TOML, a table for each servo, its permanent registers by name.
//!
//! Raw numbers, for a file of one program must mean the same to the next; what they are in
//! units stands behind them as a comment.

use anyhow::{Context, bail};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// The one version of the format.
const VERSION: u32 = 1;

/// What a backup holds.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BackupFile {
    version: u32,
    #[serde(rename = "servo")]
    pub servos: Vec<SavedServo>,
}

/// One servo of a backup.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedServo {
    /// The joint, or `id 14` where there was no robot.
    pub name: String,
    pub id: u8,
    /// Bits a second.
    pub baud: u32,
    pub model: String,
    pub model_number: u16,
    pub firmware: u8,
    /// Raw numbers by the names of registers.
    pub registers: BTreeMap<String, i64>,
}

/// A register as it is written into a file.
pub(super) struct SavedRegister {
    pub name: String,
    pub value: i64,
    /// The same in units.
    pub shown: String,
}

impl BackupFile {
    /// Reads a file. Refused: what is no such file, another version, a file without servos.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path);
        let text = text.with_context(|| format!("cannot read {}", path.display()))?;
        let file: Self = toml::from_str(&text)
            .with_context(|| format!("{} is no backup of servos", path.display()))?;
        if file.version != VERSION {
            let (path, version) = (path.display(), file.version);
            bail!("{path} has version {version}; this program reads version {VERSION}");
        }
        if file.servos.is_empty() {
            bail!("{} holds no servo", path.display());
        }
        Ok(file)
    }
}

/// The beginning of a file.
pub(super) fn head() -> String {
    format!(
        "# Permanent memory of servos: raw numbers, what they mean behind them.\n\
         # `servodance servos restore` writes back what differs.\n\
         version = {VERSION}\n"
    )
}

/// The part of a file about one servo.
pub(super) fn servo_text(servo: &SavedServo, registers: &[SavedRegister]) -> String {
    let SavedServo { name, id, baud, model, model_number, firmware, .. } = servo;
    let quoted = |text: &String| toml::Value::String(text.clone()).to_string();
    let mut text = format!(
        "\n[[servo]]\nname = {}\nid = {id}\nbaud = {baud}\nmodel = {}\n\
         model_number = {model_number}\nfirmware = {firmware}\n\n[servo.registers]\n",
        quoted(name),
        quoted(model)
    );
    for SavedRegister { name, value, shown } in registers {
        // The raw number stands before it already; without a unit there is nothing to add.
        let in_units = shown.strip_suffix(&format!(" ({value})"));
        let comment = in_units.map_or(String::new(), |in_units| format!("  # {in_units}"));
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name} = {value}{comment}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let registers = BTreeMap::from([("drive_mode".into(), 0), ("homing_offset".into(), -200)]);
        let servo = SavedServo {
            name: "l \"knee\"".into(),
            id: 14,
            baud: 1_000_000,
            model: "XM430-W350".into(),
            model_number: 1020,
            firmware: 48,
            registers: registers.clone(),
        };
        let saved = registers.iter().map(|(name, value)| SavedRegister {
            name: name.clone(),
            value: *value,
            shown: if *value == 0 { "none (0)".into() } else { "-17.6 deg (-200)".into() },
        });
        let text = head() + &servo_text(&servo, &saved.collect::<Vec<_>>());
        assert!(text.contains("homing_offset = -200  # -17.6 deg\n"), "{text}");
        let file: BackupFile = toml::from_str(&text).unwrap();
        assert_eq!(file.servos, [servo]);
    }
}
