//! The control table of an X series servo: layout, access and ranges.
//!
//! Reads may cover any addresses of the table; a write must cover whole
//! fields that may be written, EEPROM fields only while torque is off.
//! Indirect data addresses are resolved byte by byte.

use crate::spec::ServoModel;

/// The status error of a refused access, as the vendor numbers it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum AccessError {
    /// Outside the range of the field.
    Range = 4,
    /// Part of a field.
    Length = 5,
    /// Beyond another register's limit.
    Limit = 6,
    /// Read-only, undefined, or EEPROM while torque is on.
    Access = 7,
}

/// Addresses used by the servo itself.
#[allow(missing_docs)] // the names say it
pub mod at {
    pub const MODEL: u16 = 0;
    pub const FIRMWARE: u16 = 6;
    pub const ID: u16 = 7;
    pub const BAUD: u16 = 8;
    pub const RETURN_DELAY: u16 = 9;
    pub const DRIVE_MODE: u16 = 10;
    pub const OPERATING_MODE: u16 = 11;
    pub const SHADOW_ID: u16 = 12;
    pub const HOMING_OFFSET: u16 = 20;
    pub const MOVING_THRESHOLD: u16 = 24;
    pub const TEMPERATURE_LIMIT: u16 = 31;
    pub const MAX_VOLTAGE: u16 = 32;
    pub const MIN_VOLTAGE: u16 = 34;
    pub const PWM_LIMIT: u16 = 36;
    pub const CURRENT_LIMIT: u16 = 38;
    pub const VELOCITY_LIMIT: u16 = 44;
    pub const MAX_POSITION: u16 = 48;
    pub const MIN_POSITION: u16 = 52;
    pub const SHUTDOWN: u16 = 63;
    pub const TORQUE: u16 = 64;
    pub const STATUS_RETURN_LEVEL: u16 = 68;
    pub const REGISTERED: u16 = 69;
    pub const HARDWARE_ERROR: u16 = 70;
    pub const VELOCITY_I: u16 = 76;
    pub const VELOCITY_P: u16 = 78;
    pub const POSITION_D: u16 = 80;
    pub const POSITION_I: u16 = 82;
    pub const POSITION_P: u16 = 84;
    pub const BUS_WATCHDOG: u16 = 98;
    pub const GOAL_PWM: u16 = 100;
    pub const GOAL_CURRENT: u16 = 102;
    pub const GOAL_VELOCITY: u16 = 104;
    pub const PROFILE_ACCELERATION: u16 = 108;
    pub const PROFILE_VELOCITY: u16 = 112;
    pub const GOAL_POSITION: u16 = 116;
    pub const TICK_MS: u16 = 120;
    pub const MOVING: u16 = 122;
    pub const MOVING_STATUS: u16 = 123;
    pub const PRESENT_PWM: u16 = 124;
    pub const PRESENT_CURRENT: u16 = 126;
    pub const PRESENT_VELOCITY: u16 = 128;
    pub const PRESENT_POSITION: u16 = 132;
    pub const VELOCITY_TRAJECTORY: u16 = 136;
    pub const POSITION_TRAJECTORY: u16 = 140;
    pub const PRESENT_VOLTAGE: u16 = 144;
    pub const PRESENT_TEMPERATURE: u16 = 146;
    pub const BACKUP_READY: u16 = 147;
}

/// First address that survives a power cycle no more.
const RAM: u16 = 64;
/// One past the last address.
const END: u16 = 662;

/// One field.
#[derive(Clone, Copy, Debug)]
struct Field {
    address: u16,
    size: u16,
    /// Lowest and highest value that may be written; `None`: read only.
    range: Option<(i64, i64)>,
    default: i64,
}

/// The memory of one servo.
#[derive(Clone, Debug)]
pub struct Table {
    memory: Vec<u8>,
    fields: Vec<Field>,
    /// Which field each address belongs to.
    field_at: Vec<Option<u16>>,
    /// Indirect blocks: first address register, first data byte, how many.
    indirect: Vec<(u16, u16, u16)>,
}

impl Table {
    /// A table with the model's factory settings.
    pub fn new(model: &ServoModel, id: u8, baud_code: u8, firmware: u8) -> Self {
        let fields = fields(model, id, baud_code, firmware);
        let mut field_at = vec![None; usize::from(END)];
        for (index, field) in fields.iter().enumerate() {
            let start = usize::from(field.address);
            field_at[start..start + usize::from(field.size)].fill(Some(index as u16));
        }
        let mut table = Self {
            memory: vec![0; usize::from(END)],
            fields,
            field_at,
            indirect: model.indirect_blocks().to_vec(),
        };
        table.reset(0);
        table
    }

    /// Defaults for every field from RAM on: what a reboot does.
    pub fn reset_ram(&mut self) {
        self.reset(RAM);
    }

    /// Defaults for everything: a factory reset.
    pub fn reset_all(&mut self) {
        self.reset(0);
    }

    fn reset(&mut self, from: u16) {
        for field in self.fields.clone() {
            if field.address >= from {
                self.put(field.address, field.default);
            }
        }
    }

    /// The signed value of the field at `address`.
    pub fn get(&self, address: u16) -> i64 {
        let Some(field) = self.field(address) else {
            return 0;
        };
        let start = usize::from(field.address);
        sign_extended(&self.memory[start..start + usize::from(field.size)])
    }

    /// Stores a value without any check: the firmware's own writes.
    pub fn put(&mut self, address: u16, value: i64) {
        let Some(field) = self.field(address).copied() else {
            return;
        };
        let start = usize::from(field.address);
        let size = usize::from(field.size);
        self.memory[start..start + size].copy_from_slice(&value.to_le_bytes()[..size]);
    }

    fn field(&self, address: u16) -> Option<&Field> {
        let index = (*self.field_at.get(usize::from(address))?)?;
        self.fields.get(usize::from(index))
    }

    /// Where an address leads: indirect data bytes lead elsewhere.
    fn resolve(&self, address: u16) -> u16 {
        for &(pointers, data, count) in &self.indirect {
            if (data..data + count).contains(&address) {
                return self.get(pointers + 2 * (address - data)) as u16;
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

    /// Checks a write and returns the fields it would set, as (address, value).
    pub fn check_write(
        &self,
        address: u16,
        bytes: &[u8],
        torque_on: bool,
    ) -> Result<Vec<(u16, i64)>, AccessError> {
        if bytes.is_empty() {
            return Err(AccessError::Length);
        }
        if usize::from(address) + bytes.len() > usize::from(END) {
            return Err(AccessError::Access);
        }
        let targets: Vec<u16> = (address..address + bytes.len() as u16)
            .map(|address| self.resolve(address))
            .collect();
        let mut writes = Vec::new();
        let mut at = 0;
        while at < targets.len() {
            let field = self.field(targets[at]).ok_or(AccessError::Access)?;
            let (low, high) = field.range.ok_or(AccessError::Access)?;
            if field.address < RAM && torque_on {
                return Err(AccessError::Access);
            }
            let size = usize::from(field.size);
            let whole = (0..size).all(|i| targets.get(at + i) == Some(&(field.address + i as u16)));
            if !whole {
                return Err(AccessError::Length);
            }
            let raw = &bytes[at..at + size];
            let value = if low < 0 {
                sign_extended(raw)
            } else {
                unsigned(raw)
            };
            if !(low..=high).contains(&value) {
                return Err(AccessError::Range);
            }
            writes.push((field.address, value));
            at += size;
        }
        Ok(writes)
    }
}

fn unsigned(bytes: &[u8]) -> i64 {
    bytes
        .iter()
        .rev()
        .fold(0, |value, byte| value << 8 | i64::from(*byte))
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

/// The layout with the model's defaults.
fn fields(model: &ServoModel, id: u8, baud_code: u8, firmware: u8) -> Vec<Field> {
    let family = model.family();
    let mut fields = Vec::with_capacity(200);
    let mut read_only = |address, size, default| {
        fields.push(Field {
            address,
            size,
            range: None,
            default,
        });
    };
    read_only(at::MODEL, 2, i64::from(model.number));
    read_only(2, 4, 0);
    read_only(at::FIRMWARE, 1, i64::from(firmware));
    for (address, size) in [
        (at::REGISTERED, 1),
        (at::HARDWARE_ERROR, 1),
        (at::TICK_MS, 2),
        (at::MOVING, 1),
        (at::MOVING_STATUS, 1),
        (at::PRESENT_PWM, 2),
        (at::PRESENT_CURRENT, 2),
        (at::PRESENT_VELOCITY, 4),
        (at::PRESENT_POSITION, 4),
        (at::VELOCITY_TRAJECTORY, 4),
        (at::POSITION_TRAJECTORY, 4),
        (at::PRESENT_VOLTAGE, 2),
        (at::PRESENT_TEMPERATURE, 1),
        (at::BACKUP_READY, 1),
    ] {
        read_only(address, size, 0);
    }
    let any_i32 = (i64::from(i32::MIN), i64::from(i32::MAX));
    let limit = |value: i64| (0, value);
    let both = |value: i64| (-value, value);
    let top_voltage = (family.min_voltage, family.max_voltage);
    let mut writable = |address, size, default, range| {
        fields.push(Field {
            address,
            size,
            range: Some(range),
            default,
        });
    };
    writable(at::ID, 1, i64::from(id), (0, 252));
    writable(at::BAUD, 1, i64::from(baud_code), (0, family.top_baud_code));
    writable(at::RETURN_DELAY, 1, 250, (0, 254));
    writable(at::DRIVE_MODE, 1, 0, (0, 13));
    writable(at::OPERATING_MODE, 1, 3, (0, 16));
    writable(at::SHADOW_ID, 1, 255, (0, 255));
    writable(13, 1, 2, (1, 22));
    writable(at::HOMING_OFFSET, 4, 0, both(1_044_479));
    writable(at::MOVING_THRESHOLD, 4, 10, limit(1023));
    writable(
        at::TEMPERATURE_LIMIT,
        1,
        family.temperature_limit,
        limit(100),
    );
    writable(at::MAX_VOLTAGE, 2, family.max_voltage, top_voltage);
    writable(at::MIN_VOLTAGE, 2, family.min_voltage, top_voltage);
    writable(at::PWM_LIMIT, 2, 885, limit(885));
    writable(
        at::CURRENT_LIMIT,
        2,
        family.current_limit,
        limit(family.current_limit),
    );
    writable(40, 4, 32767, limit(32767));
    writable(at::VELOCITY_LIMIT, 4, family.velocity_limit, limit(2047));
    writable(at::MAX_POSITION, 4, 4095, limit(4095));
    writable(at::MIN_POSITION, 4, 0, limit(4095));
    writable(60, 1, 0, limit(3));
    writable(at::SHUTDOWN, 1, family.shutdown, limit(63));
    writable(at::TORQUE, 1, 0, limit(1));
    writable(65, 1, 0, limit(1));
    writable(at::STATUS_RETURN_LEVEL, 1, 2, limit(2));
    writable(at::VELOCITY_I, 2, family.velocity_i, limit(16383));
    writable(at::VELOCITY_P, 2, family.velocity_p, limit(16383));
    writable(at::POSITION_D, 2, 0, limit(16383));
    writable(at::POSITION_I, 2, 0, limit(16383));
    writable(at::POSITION_P, 2, family.position_p, limit(16383));
    writable(88, 2, 0, limit(16383));
    writable(90, 2, 0, limit(16383));
    writable(at::BUS_WATCHDOG, 1, 0, limit(127));
    writable(at::GOAL_PWM, 2, 885, both(885));
    writable(
        at::GOAL_CURRENT,
        2,
        family.current_limit,
        both(family.current_limit),
    );
    writable(at::GOAL_VELOCITY, 4, 0, both(2047));
    writable(at::PROFILE_ACCELERATION, 4, 0, limit(32767));
    writable(at::PROFILE_VELOCITY, 4, 0, limit(32767));
    writable(at::GOAL_POSITION, 4, 2048, any_i32);
    for (pointers, data, count) in model.indirect_blocks() {
        for i in 0..*count {
            writable(
                pointers + 2 * i,
                2,
                i64::from(data + i),
                (0, i64::from(END) - 1),
            );
            writable(data + i, 1, 0, (0, 255));
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        Table::new(ServoModel::from_number(1020).unwrap(), 1, 4, 45)
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
            assert_eq!(table.get(address), value, "address {address}");
        }
    }

    #[test]
    fn refusals_have_the_published_numbers() {
        let table = table();
        let refused = |address, bytes: &[u8], torque| table.check_write(address, bytes, torque);
        assert_eq!(
            refused(11, &[3], true),
            Err(AccessError::Access),
            "EEPROM with torque"
        );
        assert_eq!(
            refused(132, &[0; 4], false),
            Err(AccessError::Access),
            "read only"
        );
        assert_eq!(
            refused(116, &[0; 2], false),
            Err(AccessError::Length),
            "half a field"
        );
        assert_eq!(
            refused(64, &[2], false),
            Err(AccessError::Range),
            "out of range"
        );
        assert_eq!(
            refused(150, &[1], false),
            Err(AccessError::Access),
            "undefined"
        );
        assert_eq!(
            refused(660, &[0; 4], false),
            Err(AccessError::Access),
            "past the end"
        );
        assert_eq!(table.read(660, 4), Err(AccessError::Access));
    }

    #[test]
    fn one_write_may_cover_several_fields() {
        let writes = table().check_write(108, &[1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0], true);
        assert_eq!(writes, Ok(vec![(108, 1), (112, 2), (116, 3)]));
    }

    #[test]
    fn indirect_data_reaches_the_goal() {
        let mut table = table();
        for i in 0..4 {
            table.put(168 + 2 * i, i64::from(at::GOAL_POSITION + i));
        }
        table.put(at::GOAL_POSITION, 1000);
        assert_eq!(table.read(224, 4).unwrap(), 1000i32.to_le_bytes());
        let writes = table.check_write(224, &7i32.to_le_bytes(), true);
        assert_eq!(writes, Ok(vec![(at::GOAL_POSITION, 7)]));
    }
}
