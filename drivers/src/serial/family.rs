//! What one family of serial servos does differently from the others.
//!
//! [`crate::SerialBus`] knows how a bus is checked, armed, cycled and left; a
//! family knows its registers, framing, models, rates and instructions. Each family
//! is one folder beside this file, registered in [`crate::serial::families`];
//! `docs/guides/add-a-servo-family.md` leads through adding one.

use std::fmt;

use self::prelude::*;
use crate::serial::deviation::Deviation;

/// What the files of a family need of this crate.
pub(crate) mod prelude {
    pub(crate) use super::ServoFamily;
    pub(crate) use crate::bus::Notes;
    pub(crate) use crate::bus::kind::BusKind;
    pub(crate) use crate::error::BusResult;
    pub(crate) use crate::serial::client::ServoClient;
    pub(crate) use crate::serial::limits::LimitRegisters;
    pub(crate) use crate::serial::memory::{ByteMemory, Firmware, Protection};
    pub(crate) use crate::serial::register::{Register, names_of, sign_magnitude};
    pub(crate) use crate::serial::registers::{
        CycleBytes, Identity, OwnLimits, PresentState, Registers, ServiceRegisters,
    };
    pub(crate) use crate::serial::table::entry::TableEntry;
    pub(crate) use crate::serial::table::measure::{Measure, ServoUnits};
    pub(crate) use crate::serial::table::{Places, RegisterTable};
    pub(crate) use crate::serial::wire::framing::Framing;
    pub(crate) use crate::serial::wire::protocol1::ErrorFlags;
    pub(crate) use crate::servo::Servo;
    pub(crate) use crate::servo::model::{DataSheet, ServoModel};
}

/// The id of every servo that leaves a factory.
pub const FACTORY_ID: u8 = 1;

/// One family of serial servos.
///
/// `index` is a servo's place on its bus, `notes` takes a line for each thing that
/// the user should know. Methods with a default are for families that can do more.
pub trait ServoFamily: Sync {
    /// Its name, for debugging.
    fn name(&self) -> &'static str;

    /// How its packets are framed.
    fn framing(&self) -> Framing;

    /// What the error flags of its answers mean, in the framing of Protocol 1.
    fn error_flags(&self) -> ErrorFlags {
        ErrorFlags::Dynamixel
    }

    /// The models that it has.
    fn models(&self) -> &'static [ServoModel];

    /// The rates that a model can be set to, in the order of its baud register.
    fn bauds(&self, model: &ServoModel) -> &'static [u32];

    /// What the baud register holds for a rate; `None` where the model does not know it.
    fn baud_code(&self, model: &ServoModel, baud: u32) -> Option<u8> {
        self.bauds(model).iter().position(|known| *known == baud).map(|code| code as u8)
    }

    /// The registers that every cycle needs.
    fn registers(&self) -> &'static Registers;

    /// The registers of a model by name, for tools that read and write single ones; `None`
    /// where this family has no such model, or no table.
    fn table(&self, _model_number: u16) -> Option<RegisterTable> {
        None
    }

    /// The rate with which a model leaves the factory, bits a second; its id is
    /// [`FACTORY_ID`] then. `None` where nobody knows.
    fn factory_baud(&self, model: &ServoModel) -> Option<u32> {
        match self.firmware(model) {
            Firmware::Bytes(memory) => memory.factory_baud(self.bauds(model)),
            Firmware::DynamixelX => None,
        }
    }

    /// Parameters of the instruction that puts a servo back as it left the factory, with the
    /// id and rate that it has or without; `None` where it cannot be told so.
    fn reset_params(&self, _keeps_address: bool) -> Option<&'static [u8]> {
        None
    }

    /// The firmware that the simulator runs for a model.
    fn firmware(&self, model: &ServoModel) -> Firmware;

    /// What one cycle of these servos puts on the wire.
    fn cycle_bytes(&self, servos: &[Servo]) -> CycleBytes;

    /// What the present registers say.
    fn parse(&self, bytes: &[u8]) -> PresentState;

    /// The position register as a number of ticks.
    fn ticks(&self, raw: u64) -> i32 {
        raw as i32
    }

    /// Where model number and firmware stand; `None` where a ping tells them.
    fn identity_register(&self) -> Option<Register> {
        None
    }

    /// What those bytes say; `None` from servos that do not say what they are.
    fn identity(&self, _bytes: &[u8]) -> Option<Identity> {
        None
    }

    /// Why a servo cannot stop by itself when the host goes silent; `None` where it can.
    fn lacks_watchdog(&self) -> Option<&'static str> {
        None
    }

    /// The conditions that a servo reports, by the bits of its flags.
    fn conditions(&self) -> &'static [(u8, &'static str)] {
        &[]
    }

    /// The condition that a servo reports, in words; `None` when it is well.
    fn condition(&self, _client: &mut ServoClient, _index: usize) -> BusResult<Option<String>> {
        Ok(None)
    }

    /// The limits in a servo's memory; `None` where it keeps none.
    fn own_limits(&self, _client: &mut ServoClient, _index: usize) -> BusResult<Option<OwnLimits>> {
        Ok(None)
    }

    /// Torque off, then the settings that the driver relies on.
    fn set_up(&self, client: &mut ServoClient, index: usize, notes: &mut Notes) -> BusResult<()> {
        client.settle(index, self.registers().torque, 0, notes)
    }

    /// What of a servo's settings is not as it should be; nothing is written.
    fn deviations(&self, _client: &mut ServoClient, _index: usize) -> BusResult<Vec<Deviation>> {
        Ok(Vec::new())
    }

    /// What the servo adds to its angle, ticks; `None` where it has no such setting.
    fn homing_offset(&self, _client: &mut ServoClient, _index: usize) -> BusResult<Option<i32>> {
        Ok(None)
    }

    /// Arms the servo's own watchdog and reads it back.
    fn arm_watchdog(&self, _client: &mut ServoClient, _index: usize) -> BusResult<()> {
        Ok(())
    }

    /// The servos that their own watchdog has stopped: `who` alone, or all of them.
    fn tripped(&self, _client: &mut ServoClient, _who: Option<usize>) -> BusResult<Vec<usize>> {
        Ok(Vec::new())
    }

    /// Has a servo that its watchdog has stopped take goals again, its watchdog off.
    fn clear_watchdog(&self, _client: &mut ServoClient, _index: usize) -> BusResult<()> {
        Ok(())
    }

    /// Finds the best way to read everyone.
    fn choose_read(&self, _client: &mut ServoClient, _notes: &mut Notes) -> BusResult<()> {
        Ok(())
    }

    /// Asks those who have not answered for their present registers, once.
    /// Returns the first servo that raised its alert bit.
    fn read_all(&self, client: &mut ServoClient, present: &mut [u8]) -> BusResult<Option<usize>> {
        client.read_each(self.registers().present, present)
    }

    /// Restarts a servo that has shut itself down; it is deaf for a while.
    /// False where there is no such instruction.
    fn reboot(&self, _client: &mut ServoClient, _index: usize) -> BusResult<bool> {
        Ok(false)
    }
}

impl fmt::Debug for dyn ServoFamily {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl PartialEq for dyn ServoFamily {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for dyn ServoFamily {}
