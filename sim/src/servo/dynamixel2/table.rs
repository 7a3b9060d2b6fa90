//! The control table of an X series servo: layout, access and ranges.
//!
//! Reads may cover any addresses of the table; a write must cover whole
//! fields that may be written, EEPROM fields only while torque is off.
//! Indirect data addresses are resolved byte by byte.

use servodance_drivers::ServoModel;
use servodance_drivers::serial::Register;
use servodance_drivers::serial::dynamixel2::registers as at;

use crate::servo::dynamixel2::factory::{factory_settings, indirect_blocks};

/// The status error of a refused access, as the vendor numbers it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum AccessError {
    Range = 4,
    Length = 5,
    Limit = 6,
    /// Read-only, undefined, or EEPROM while torque is on.
    Access = 7,
}

/// What a power cycle does not keep begins here.
pub const RAM: u16 = 64;
const END: u16 = 662;

#[derive(Clone, Copy, Debug)]
struct Field {
    register: Register,
    /// Lowest and highest value that may be written; `None`: read only.
    range: Option<(i64, i64)>,
    default: i64,
}

#[derive(Clone, Debug)]
pub struct ControlTable {
    memory: Vec<u8>,
    fields: Vec<Field>,
    field_at: Vec<Option<u16>>,
    /// Indirect blocks: first address register, first data byte, how many.
    indirect: &'static [(u16, u16, u16)],
}

impl ControlTable {
    pub fn new(model: &ServoModel, id: u8, baud_code: u8, firmware: u8) -> Self {
        let fields = fields(model, id, baud_code, firmware);
        let mut field_at = vec![None; usize::from(END)];
        for (index, field) in fields.iter().enumerate() {
            field_at[field.register.range()].fill(Some(index as u16));
        }
        let mut table = Self {
            memory: vec![0; usize::from(END)],
            fields,
            field_at,
            indirect: indirect_blocks(model),
        };
        table.reset(0);
        table
    }

    /// Defaults from this address on: from [`RAM`] what a reboot does, from 0 a factory reset.
    pub fn reset(&mut self, from: u16) {
        for field in self.fields.clone() {
            if field.register.address >= from {
                self.put(field.register, field.default);
            }
        }
    }

    pub fn get(&self, register: Register) -> i64 {
        sign_extended(&self.memory[register.range()])
    }

    /// Stores a value without any check: the firmware's own writes.
    pub fn put(&mut self, register: Register, value: i64) {
        let range = register.range();
        let size = range.len();
        self.memory[range].copy_from_slice(&value.to_le_bytes()[..size]);
    }

    fn field(&self, address: u16) -> Option<&Field> {
        let index = (*self.field_at.get(usize::from(address))?)?;
        self.fields.get(usize::from(index))
    }

    /// Where an address leads: indirect data bytes lead elsewhere.
    fn resolve(&self, address: u16) -> u16 {
        for &(pointers, data, count) in self.indirect {
            if (data..data + count).contains(&address) {
                return self.get(pointer(pointers, address - data)) as u16;
            }
        }
        address
    }

    /// `size` bytes from `address` on.
    pub fn read(&self, address: u16, size: u16) -> Result<Vec<u8>, AccessError> {
        if u32::from(address) + u32::from(size) > u32::from(END) {
            return Err(AccessError::Access);
        }
        let byte = |address: u16| self.memory.get(usize::from(address)).copied();
        (address..address + size)
            .map(|address| byte(self.resolve(address)).ok_or(AccessError::Access))
            .collect()
    }

    /// Checks a write and returns the registers it would set, with their values.
    pub fn check_write(
        &self,
        address: u16,
        bytes: &[u8],
        torque_on: bool,
    ) -> Result<Vec<(Register, i64)>, AccessError> {
        if bytes.is_empty() {
            return Err(AccessError::Length);
        }
        if usize::from(address) + bytes.len() > usize::from(END) {
            return Err(AccessError::Access);
        }
        let targets: Vec<u16> =
            (address..address + bytes.len() as u16).map(|address| self.resolve(address)).collect();
        let mut writes = Vec::new();
        let mut at = 0;
        while at < targets.len() {
            let field = self.field(targets[at]).ok_or(AccessError::Access)?;
            let (low, high) = field.range.ok_or(AccessError::Access)?;
            if field.register.address < RAM && torque_on {
                return Err(AccessError::Access);
            }
            let Register { address, size, .. } = field.register;
            let size = usize::from(size);
            let whole = (0..size).all(|i| targets.get(at + i) == Some(&(address + i as u16)));
            if !whole {
                return Err(AccessError::Length);
            }
            let raw = &bytes[at..at + size];
            let value = if low < 0 { sign_extended(raw) } else { unsigned(raw) };
            if !(low..=high).contains(&value) {
                return Err(AccessError::Range);
            }
            writes.push((field.register, value));
            at += size;
        }
        Ok(writes)
    }
}

fn unsigned(bytes: &[u8]) -> i64 {
    bytes.iter().rev().fold(0, |value, byte| value << 8 | i64::from(*byte))
}

/// One byte is unsigned in this table; two and four bytes are signed.
fn sign_extended(bytes: &[u8]) -> i64 {
    match *bytes {
        [one] => i64::from(one),
        [a, b] => i64::from(i16::from_le_bytes([a, b])),
        [a, b, c, d] => i64::from(i32::from_le_bytes([a, b, c, d])),
        _ => unsigned(bytes),
    }
}

fn fields(model: &ServoModel, id: u8, baud_code: u8, firmware: u8) -> Vec<Field> {
    let family = factory_settings(model);
    let mut fields = Vec::with_capacity(200);
    let mut read_only = |register, default| {
        fields.push(Field { register, range: None, default });
    };
    read_only(at::MODEL, i64::from(model.number));
    read_only(Register::new(2, 4, "model information"), 0);
    read_only(at::FIRMWARE, i64::from(firmware));
    for register in [
        at::REGISTERED,
        at::HARDWARE_ERROR,
        at::TICK_MS,
        at::MOVING,
        at::MOVING_STATUS,
        at::PRESENT_PWM,
        at::PRESENT_CURRENT,
        at::PRESENT_VELOCITY,
        at::PRESENT_POSITION,
        at::VELOCITY_TRAJECTORY,
        at::POSITION_TRAJECTORY,
        at::PRESENT_VOLTAGE,
        at::PRESENT_TEMPERATURE,
        at::BACKUP_READY,
    ] {
        read_only(register, 0);
    }
    let any_i32 = (i64::from(i32::MIN), i64::from(i32::MAX));
    let limit = |value: i64| (0, value);
    let both = |value: i64| (-value, value);
    let most_current = family.current_limit;
    let top_voltage = (family.min_voltage, family.max_voltage);
    let mut writable = |register, default, range| {
        fields.push(Field { register, range: Some(range), default });
    };
    writable(at::ID, i64::from(id), (0, 252));
    writable(at::BAUD, i64::from(baud_code), (0, family.top_baud_code));
    writable(at::RETURN_DELAY, 250, (0, 254));
    writable(at::DRIVE_MODE, 0, (0, 13));
    writable(at::OPERATING_MODE, 3, (0, 16));
    writable(at::SHADOW_ID, 255, (0, 255));
    writable(at::PROTOCOL_TYPE, 2, (1, 22));
    writable(at::HOMING_OFFSET, 0, both(1_044_479));
    writable(at::MOVING_THRESHOLD, 10, limit(1023));
    writable(at::TEMPERATURE_LIMIT, family.temperature_limit, limit(100));
    writable(at::MAX_VOLTAGE, family.max_voltage, top_voltage);
    writable(at::MIN_VOLTAGE, family.min_voltage, top_voltage);
    writable(at::PWM_LIMIT, 885, limit(885));
    writable(at::CURRENT_LIMIT, most_current, limit(most_current));
    writable(at::ACCELERATION_LIMIT, 32767, limit(32767));
    writable(at::VELOCITY_LIMIT, family.velocity_limit, limit(2047));
    writable(at::MAX_POSITION, 4095, limit(4095));
    writable(at::MIN_POSITION, 0, limit(4095));
    writable(at::STARTUP, 0, limit(3));
    writable(at::SHUTDOWN, family.shutdown, limit(63));
    writable(at::TORQUE, 0, limit(1));
    writable(at::LED, 0, limit(1));
    writable(at::STATUS_RETURN_LEVEL, 2, limit(2));
    writable(at::VELOCITY_I, family.velocity_i, limit(16383));
    writable(at::VELOCITY_P, family.velocity_p, limit(16383));
    writable(at::POSITION_D, 0, limit(16383));
    writable(at::POSITION_I, 0, limit(16383));
    writable(at::POSITION_P, family.position_p, limit(16383));
    writable(at::FEED_FORWARD_2, 0, limit(16383));
    writable(at::FEED_FORWARD_1, 0, limit(16383));
    writable(at::BUS_WATCHDOG, 0, limit(127));
    writable(at::GOAL_PWM, 885, both(885));
    writable(at::GOAL_CURRENT, most_current, both(most_current));
    writable(at::GOAL_VELOCITY, 0, both(2047));
    writable(at::PROFILE_ACCELERATION, 0, limit(32767));
    writable(at::PROFILE_VELOCITY, 0, limit(32767));
    writable(at::GOAL_POSITION, 2048, any_i32);
    for &(pointers, data, count) in indirect_blocks(model) {
        for i in 0..count {
            let in_ram = (i64::from(RAM), i64::from(END) - 1);
            writable(pointer(pointers, i), i64::from(data + i), in_ram);
            writable(Register::new(data + i, 1, "indirect data"), 0, (0, 255));
        }
    }
    fields
}

/// The register that says where the indirect data byte `index` leads.
fn pointer(pointers: u16, index: u16) -> Register {
    Register::new(pointers + 2 * index, 2, "indirect address")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> ControlTable {
        ControlTable::new(ServoModel::from_number(1020).unwrap(), 1, 4, 45)
    }

    #[test]
    fn factory_settings_are_the_published_ones() {
        let table = table();
        for (address, value) in [
            (0, 1020),
            (7, 1),
            (9, 250),
            (11, 3),
            (31, 80),
            (32, 160),
            (34, 95),
            (36, 885),
            (38, 1193),
            (44, 350),
            (48, 4095),
            (63, 52),
            (68, 2),
            (84, 800),
            (168, 224),
        ] {
            let register = table.field(address).unwrap().register;
            assert_eq!(table.get(register), value, "address {address}");
        }
    }

    #[test]
    fn refusals_have_the_published_numbers() {
        let table = table();
        let refused = |address, bytes: &[u8], torque| table.check_write(address, bytes, torque);
        assert_eq!(refused(11, &[3], true), Err(AccessError::Access), "EEPROM with torque");
        assert_eq!(refused(132, &[0; 4], false), Err(AccessError::Access), "read only");
        assert_eq!(refused(116, &[0; 2], false), Err(AccessError::Length), "half a field");
        assert_eq!(refused(64, &[2], false), Err(AccessError::Range), "out of range");
        assert_eq!(refused(150, &[1], false), Err(AccessError::Access), "undefined");
        assert_eq!(refused(660, &[0; 4], false), Err(AccessError::Access), "past the end");
        assert_eq!(table.read(660, 4), Err(AccessError::Access));
    }

    #[test]
    fn one_write_may_cover_several_fields() {
        let writes = table().check_write(108, &[1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0], true);
        assert_eq!(
            writes,
            Ok(vec![
                (at::PROFILE_ACCELERATION, 1),
                (at::PROFILE_VELOCITY, 2),
                (at::GOAL_POSITION, 3)
            ])
        );
    }

    #[test]
    fn indirect_data_reaches_the_goal() {
        let mut table = table();
        for i in 0..4 {
            table.put(pointer(168, i), i64::from(at::GOAL_POSITION.address + i));
        }
        table.put(at::GOAL_POSITION, 1000);
        assert_eq!(table.read(224, 4).unwrap(), 1000i32.to_le_bytes());
        let writes = table.check_write(224, &7i32.to_le_bytes(), true);
        assert_eq!(writes, Ok(vec![(at::GOAL_POSITION, 7)]));
    }
}
