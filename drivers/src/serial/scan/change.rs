//! A new id or a new rate for one servo, in its permanent memory. Torque goes off first,
//! and what was set is read back where the servo then answers.

use crate::error::{BusError, BusResult};
use crate::serial::scan::{FoundServo, SerialScanner, silent};
use crate::servo::model::ServoModel;

/// How often a register that changes by itself is read to tell two servos from one.
const LOOKS: u32 = 6;

impl SerialScanner {
    /// Whether two servos seem to answer to this id: their answers to what differs from
    /// servo to servo come damaged. Two that say the very same cannot be told from one.
    pub fn is_doubled(&mut self, servo: &FoundServo) -> BusResult<bool> {
        let service = servo.service;
        self.know(servo);
        let differing = [Some(service.position), service.clock, Some(service.voltage)];
        for _ in 0..LOOKS {
            for register in differing.into_iter().flatten() {
                match self.read_once(servo.id, register) {
                    Ok(_) => {}
                    Err(BusError::Corrupt { .. }) => return Ok(true),
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(false)
    }

    /// Gives a servo another id, in its permanent memory: torque off first, the id read back
    /// where it then answers. The caller has looked that `id` is free.
    pub fn set_id(&mut self, servo: &FoundServo, id: u8) -> BusResult<()> {
        let service = servo.service;
        self.families.insert(id, servo.family);
        self.unlock(servo)?;
        // Some firmware confirms from the old id, some from the new one, some
        // not at all: the id that is read back decides.
        self.send_write(servo.id, service.id, u64::from(id))?;
        let actual = self.read(id, service.id)?;
        if actual != Some(u64::from(id)) {
            return Err(silent(id, service.id.name));
        }
        self.lock(servo, id)
    }

    /// Has a servo speak at another rate. It is deaf here from then on: the caller looks
    /// for it at the new rate, and locks its memory again there.
    pub fn send_baud(&mut self, servo: &FoundServo, code: u8) -> BusResult<()> {
        self.unlock(servo)?;
        // The answer comes at the old rate, at the new one, or not at all.
        self.send_write(servo.id, servo.service.baud, u64::from(code))
    }

    /// Torque off, and permanent memory may be written.
    fn unlock(&mut self, servo: &FoundServo) -> BusResult<()> {
        self.torque_off(servo)?;
        match servo.service.lock {
            Some(lock) => self.write(servo.id, lock, 0),
            None => Ok(()),
        }
    }

    /// Permanent memory may not be written any more, where a servo knows such a thing.
    pub fn lock(&mut self, servo: &FoundServo, id: u8) -> BusResult<()> {
        self.families.insert(id, servo.family);
        match servo.service.lock {
            Some(lock) => self.write(id, lock, 1),
            None => Ok(()),
        }
    }
}

impl FoundServo {
    /// What its baud register holds for a rate; the rates that it knows where this is none.
    pub fn baud_code(&self, baud: u32) -> Result<u8, Vec<u32>> {
        let Some(model) = ServoModel::from_number(self.model_number) else {
            return Err(Vec::new());
        };
        let code = self.family.baud_code(model, baud);
        code.ok_or_else(|| self.family.bauds(model).to_vec())
    }
}
