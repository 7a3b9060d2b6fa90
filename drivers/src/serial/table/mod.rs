//! The registers of one servo by name, for the tools that read and write single ones.
//!
//! A family keeps its rows in a file `table.rs` of its folder, beside its `registers.rs`:
//! what each number means, and what may be written. What a number is worth in degrees or
//! amperes differs from model to model ([`ServoUnits`]).
//!
//! Nothing here turns torque on or moves anything: goals, and the bits that would turn
//! torque on, now or when the servo is switched on, are refused.

pub mod entry;
pub mod error;
pub mod measure;
mod names;

use crate::serial::register::Register;
use crate::serial::table::entry::{Access, TableEntry};
use crate::serial::table::error::TableError;
use crate::serial::table::measure::{Measure, ServoUnits};
use crate::serial::table::names::close_names;

/// The registers of one model.
#[derive(Clone, Copy, Debug)]
pub struct RegisterTable {
    /// The model's name.
    pub model: &'static str,
    /// What its numbers are worth.
    pub units: ServoUnits,
    /// 1 where torque is on.
    pub torque: Register,
    /// Where the registers that a robot file decides about are.
    pub places: Places,
    parts: &'static [&'static [TableEntry]],
}

/// Registers that a robot file decides about; `None` where a model has none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Places {
    /// The lowest and the highest goal that the servo takes, ticks.
    pub goals: Option<(Register, Register)>,
    /// The highest speed that it takes, in its units.
    pub speed: Option<Register>,
    /// What it adds to its angle (Feetech: takes away), ticks.
    pub offset: Option<Register>,
}

impl RegisterTable {
    pub(crate) const fn new(
        model: &'static str,
        units: ServoUnits,
        torque: Register,
        places: Places,
        parts: &'static [&'static [TableEntry]],
    ) -> Self {
        Self { model, units, torque, places, parts }
    }

    /// Every register that this model has, by address.
    pub fn entries(&self) -> Vec<&'static TableEntry> {
        let parts = self.parts.iter().copied().flatten();
        let mut entries: Vec<_> = parts.filter(|entry| self.has(entry)).collect();
        entries.sort_by_key(|entry| entry.register.address);
        entries
    }

    /// Those that the servo keeps for good and that may be written.
    pub fn permanent(&self) -> Vec<&'static TableEntry> {
        let mut entries = self.entries();
        entries.retain(|entry| entry.access == Access::Eeprom);
        entries
    }

    /// A model without a sensor has a load where others have a current, and no limit of it.
    fn has(&self, entry: &TableEntry) -> bool {
        let of_current = matches!(entry.measure, Measure::Current) && entry.access != Access::Read;
        self.units.current_a_per_unit.is_some() || !of_current
    }

    /// The register of this name; the error lists names that are close to it.
    pub fn find(&self, name: &str) -> Result<&'static TableEntry, TableError> {
        let entries = self.entries();
        let found = entries.iter().find(|entry| entry.name() == name.to_lowercase());
        found.copied().ok_or_else(|| {
            let names: Vec<String> = entries.iter().map(|entry| entry.name()).collect();
            TableError::Unknown {
                name: name.into(),
                model: self.model,
                close: close_names(name, &names),
            }
        })
    }

    /// The row of a register of this model.
    pub fn entry(&self, register: Register) -> Option<&'static TableEntry> {
        self.entries().into_iter().find(|entry| entry.register == register)
    }

    /// What a register's bits say, with its unit: `12.3 deg (2188)`.
    pub fn show(&self, entry: &TableEntry, bits: u64) -> String {
        entry.measure.show(entry.decode(bits), &self.units)
    }

    /// The bits to write for `text`: a number with the register's unit, one of its words, or
    /// a raw number. Refused: what is no number, out of range, or may not be written.
    pub fn bits_of_text(&self, entry: &TableEntry, text: &str) -> Result<u64, TableError> {
        self.writable(entry)?;
        match entry.measure.parse(text, &self.units) {
            Some(value) => self.bits(entry, value),
            None => Err(TableError::NoValue {
                register: entry.name(),
                text: text.into(),
                wanted: self.wanted(entry),
            }),
        }
    }

    /// The bits to write for a raw number. Refused: out of range, or not to be written.
    pub fn bits(&self, entry: &TableEntry, value: i64) -> Result<u64, TableError> {
        self.writable(entry)?;
        let (lowest, highest) = entry.range;
        if !(lowest..=highest).contains(&value) {
            return Err(TableError::OutOfRange {
                register: entry.name(),
                value,
                wanted: self.wanted(entry),
            });
        }
        if value & entry.torque_bits != 0 {
            return Err(TableError::Torque { register: entry.name(), value });
        }
        Ok(entry.encode(value))
    }

    fn writable(&self, entry: &TableEntry) -> Result<(), TableError> {
        let register = entry.name();
        match entry.access {
            Access::Ram | Access::Eeprom => Ok(()),
            Access::Read => Err(TableError::ReadOnly { register }),
            Access::Goal => Err(TableError::Goal { register }),
            Access::Address => Err(TableError::Address { register }),
        }
    }

    /// What may be written, in words.
    fn wanted(&self, entry: &TableEntry) -> String {
        let (lowest, highest) = entry.range;
        match lowest == highest {
            true => format!("{lowest} alone"),
            false => {
                format!("{lowest} to {highest}{}", entry.measure.span(entry.range, &self.units))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::serial::FAMILIES;
    use crate::serial::ServoFamily;
    use crate::serial::dynamixel2::Dynamixel2;
    use crate::serial::table::RegisterTable;
    use crate::serial::table::entry::Access;

    fn table(number: u16) -> RegisterTable {
        Dynamixel2.table(number).expect("a table")
    }

    #[test]
    fn every_model_has_a_table_whose_registers_do_not_overlap() {
        for family in FAMILIES {
            for model in family.models() {
                let table = family.table(model.number).expect(model.name);
                let entries = table.entries();
                for pair in entries.windows(2) {
                    let (low, high) = (pair[0].register, pair[1].register);
                    assert!(
                        low.range().end <= high.range().start,
                        "{}: {low:?} {high:?}",
                        model.name
                    );
                }
                for entry in &entries {
                    assert_eq!(table.find(&entry.name()).expect("it"), *entry, "{}", model.name);
                    let written = matches!(entry.access, Access::Ram | Access::Eeprom);
                    let size = u32::from(entry.register.size) * 8;
                    assert!(!written || entry.range.1 < 1 << size, "{}", entry.name());
                }
                let torque = table.entry(table.torque).expect("torque");
                assert_eq!(table.bits(torque, 0), Ok(0));
                assert!(table.bits(torque, 1).is_err(), "{}: torque comes on", model.name);
                let places = [table.places.goals.map(|(low, _)| low), table.places.speed];
                for place in places.into_iter().flatten() {
                    assert!(table.entry(place).is_some(), "{}: {place:?}", model.name);
                }
            }
        }
    }

    #[test]
    fn numbers_are_shown_with_their_units() {
        let table = table(1020);
        for (name, bits, shown) in [
            ("present_position", 2188, "12.3 deg (2188)"),
            ("present_position", 0xFFFF_FF38, "-197.6 deg (-200)"),
            ("homing_offset", 0xFFFF_FF38, "-17.6 deg (-200)"),
            ("present_input_voltage", 121, "12.1 V (121)"),
            ("present_current", 0xFFF6, "-0.027 A (-10)"),
            ("return_delay_time", 250, "500 us (250)"),
            ("baud_rate", 3, "1000000 baud (3)"),
            ("operating_mode", 3, "position (3)"),
            ("operating_mode", 7, "unknown (7)"),
            ("shutdown", 52, "overheating, electrical shock, overload (52)"),
            ("shutdown", 0, "none (0)"),
            ("bus_watchdog", 0xFF, "-1"),
            ("id", 14, "14"),
        ] {
            let entry = table.find(name).expect(name);
            assert_eq!(table.show(entry, bits), shown, "{name}");
        }
    }

    #[test]
    fn values_are_taken_raw_with_a_unit_or_as_a_word() {
        let table = table(1020);
        for (name, text, bits) in [
            ("maximum_position_limit", "3072", 3072),
            ("maximum_position_limit", "90deg", 3072),
            ("minimum_position_limit", " -90.0 deg", 1024),
            ("homing_offset", "-200", 0xFFFF_FF38),
            ("return_delay_time", "0x10", 16),
            ("temperature_limit", "72 C", 72),
            ("operating_mode", "extended position", 4),
            ("torque_enable", "off", 0),
        ] {
            let entry = table.find(name).expect(name);
            assert_eq!(table.bits_of_text(entry, text), Ok(bits), "{name}={text}");
        }
    }

    #[test]
    fn what_cannot_be_meant_or_would_move_is_refused_with_the_reason() {
        let table = table(1020);
        for (name, text, says) in [
            ("maximum_position_limit", "5000", "0 to 4095, -180.0 to 179.9 deg"),
            ("maximum_position_limit", "nan deg", "no value"),
            ("maximum_position_limit", "inf deg", "no value"),
            ("maximum_position_limit", "3 V", "no value"),
            ("maximum_position_limit", "2.5", "no value"),
            ("temperature_limit", "1e300 C", "out of range"),
            ("status_return_level", "0", "2 alone"),
            ("torque_enable", "on", "torque"),
            ("drive_mode", "8", "torque"),
            ("startup_configuration", "1", "torque"),
            ("goal_position", "2048", "jog"),
            ("present_position", "2048", "only be read"),
            ("id", "3", "set-id"),
        ] {
            let entry = table.find(name).expect(name);
            let error = table.bits_of_text(entry, text).expect_err(name).to_string();
            assert!(error.contains(says) && error.contains(name), "{name}={text}: {error}");
        }
    }

    #[test]
    fn an_unknown_name_lists_the_close_ones() {
        let error = table(1020).find("present_positon").expect_err("a typing error").to_string();
        assert!(error.contains("present_position"), "{error}");
        let error = table(1020).find("limit").expect_err("half a name").to_string();
        assert!(error.contains("temperature_limit") && error.contains("velocity_limit"), "{error}");
        let error = table(1020).find("zzz").expect_err("nothing").to_string();
        assert!(error.contains("servos read"), "{error}");
    }

    #[test]
    fn a_model_without_a_sensor_has_a_load_and_no_limit_of_current() {
        let table = table(30);
        assert!(table.find("current_limit").is_err());
        let load = table.find("present_current").expect("the load");
        assert_eq!(table.show(load, 0xFFF6), "-1.0 % (-10)");
    }

    #[test]
    fn an_xl_320_has_a_table_of_its_own() {
        let table = table(350);
        let shown = |name, bits| table.show(table.find(name).expect(name), bits);
        assert_eq!(shown("present_position", 512), "0.0 deg (512)");
        assert_eq!(shown("present_speed", 0x405), "-3.3 deg/s (-5)");
        assert_eq!(shown("baud_rate", 1), "57600 baud (1)");
    }
}
