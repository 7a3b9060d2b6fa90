//! The memory of one servo, register by register: read, written and read back, reset. Torque
//! is never turned on, and permanent memory is not written while torque is on.

use dynamixel2::instructions::instruction_id as instruction;

use crate::error::{BusError, BusResult};
use crate::serial::register::{Register, names_of};
use crate::serial::registers::{Measured, PresentState};
use crate::serial::scan::{FoundServo, SerialScanner, nameless, silent};
use crate::serial::table::RegisterTable;
use crate::serial::table::entry::{Access, TableEntry};

/// What a servo measures, in its own units.
#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    pub present: PresentState,
    pub voltage_v: f64,
    pub temperature_c: f64,
    /// Its errors in words, empty without any; `None` where it has no register of them.
    pub errors: Option<String>,
}

impl FoundServo {
    /// Its registers by name; `None` where this crate does not know its model.
    pub fn table(&self) -> Option<RegisterTable> {
        self.family.table(self.model_number)
    }
}

impl SerialScanner {
    /// The bits of one register. A servo may refuse one that its firmware does not have.
    pub fn bits(&mut self, servo: &FoundServo, register: Register) -> BusResult<u64> {
        self.know(servo);
        self.read(servo.id, register)?.ok_or_else(|| silent(servo.id, register.name))
    }

    /// Refuses a servo whose torque is on.
    pub fn refuse_torque(&mut self, servo: &FoundServo, table: &RegisterTable) -> BusResult<()> {
        match self.bits(servo, table.torque)? {
            0 => Ok(()),
            _ => Err(BusError::Unfit {
                servo: nameless(servo.id),
                what: "torque",
                actual: "on".into(),
                wanted: "off before permanent memory is written: hold what the servo carries, \
                         then `servos write` with torque_enable=0"
                    .into(),
            }),
        }
    }

    /// Writes one register, with bits that its table allows, and reads it back.
    ///
    /// Refused: permanent memory while torque is on.
    pub fn write_entry(
        &mut self,
        servo: &FoundServo,
        table: &RegisterTable,
        entry: &TableEntry,
        bits: u64,
    ) -> BusResult<()> {
        self.know(servo);
        if entry.access != Access::Eeprom {
            return self.set(servo.id, entry.register, bits);
        }
        self.refuse_torque(servo, table)?;
        if let Some(lock) = servo.service.lock {
            self.write(servo.id, lock, 0)?;
        }
        let written = self.set(servo.id, entry.register, bits);
        // Locked again, whether the servo took it or not; the first error is told.
        let locked = self.lock(servo, servo.id);
        written.and(locked)
    }

    /// Puts a servo back as it left the factory; `params` are those of its family
    /// ([`crate::serial::ServoFamily::reset_params`]). It is deaf for a while.
    ///
    /// Refused: a servo whose torque is on.
    pub fn factory_reset(
        &mut self,
        servo: &FoundServo,
        table: &RegisterTable,
        params: &[u8],
    ) -> BusResult<()> {
        const DOING: &str = "factory reset";
        self.refuse_torque(servo, table)?;
        // Asked once: a servo that did it and was not heard would do it again.
        match self.ask(servo.id, instruction::FACTORY_RESET, params, 0, DOING, 1) {
            Ok(_) | Err(BusError::Corrupt { .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// What a servo measures; `None` if it is silent.
    pub fn readings(&mut self, servo: &FoundServo) -> BusResult<Option<Readings>> {
        self.know(servo);
        let Some(present) = self.read_bytes(servo.id, servo.family.registers().present)? else {
            return Ok(None);
        };
        let register = servo.service.voltage_and_temperature();
        let Some(bytes) = self.read_bytes(servo.id, register)? else {
            return Ok(None);
        };
        let measured = Measured::new(register, &bytes);
        let errors = match servo.service.status {
            None => None,
            Some(status) => Some(match self.bits(servo, status)? as u8 {
                0 => String::new(),
                flags => names_of(flags, servo.family.conditions()),
            }),
        };
        Ok(Some(Readings {
            present: servo.family.parse(&present),
            voltage_v: measured.tenth_volts as f64 * 0.1,
            temperature_c: measured.celsius as f64,
            errors,
        }))
    }
}
