//! The registers of the XL-320: Protocol 2.0 with a memory of its own, not that of the X
//! series. It is read, written and backed up; no robot dances with it yet.

use crate::serial::family::prelude::*;
use crate::serial::table::measure::of_rpm;

/// What it answers to a ping.
pub(super) const NUMBER: u16 = 350;

const VOLTS: Measure = Measure::Scaled(0.1, "V");
const CELSIUS: Measure = Measure::Scaled(1.0, "C");
/// Full scale of torques and loads is 1023; the sign is bit 10.
const SHARE: Measure = Measure::Scaled(100.0 / 1023.0, "%");
const SIGN_BIT: u32 = 10;
const TORQUE: Register = Register::byte(24, "torque enable");
const LOWEST: Register = Register::word(6, "clockwise angle limit");
const HIGHEST: Register = Register::word(8, "counterclockwise angle limit");
const BAUDS: [u32; 4] = [9_600, 57_600, 115_200, 1_000_000];
const ERRORS: Measure =
    Measure::Flags(&[(0, "overload"), (1, "overheating"), (2, "input voltage")]);

/// 300 degrees in 1024 ticks, 0.111 rpm a unit of speed, no sensor of current.
const UNITS: ServoUnits = ServoUnits {
    rad_per_tick: std::f64::consts::TAU * 300.0 / 360.0 / 1024.0,
    middle_ticks: 512.0,
    velocity_rad_s_per_unit: of_rpm(0.111),
    current_a_per_unit: None,
};

fn baud_of(code: u8) -> u32 {
    BAUDS.get(usize::from(code)).copied().unwrap_or(0)
}

const ENTRIES: &[TableEntry] = &[
    TableEntry::read(Register::word(0, "model number")),
    TableEntry::read(Register::byte(2, "firmware")),
    TableEntry::address(Register::byte(3, "id")),
    TableEntry::address(Register::byte(4, "baud rate")).measured(Measure::Rate(baud_of)),
    TableEntry::eeprom(Register::byte(5, "return delay time"), 0, 254)
        .measured(Measure::Scaled(2.0, "us")),
    TableEntry::eeprom(LOWEST, 0, 1023).measured(Measure::Angle),
    TableEntry::eeprom(HIGHEST, 0, 1023).measured(Measure::Angle),
    TableEntry::eeprom(Register::byte(11, "control mode"), 1, 2)
        .measured(Measure::Choice(&[(1, "wheel"), (2, "joint")])),
    TableEntry::eeprom(Register::byte(12, "temperature limit"), 0, 150).measured(CELSIUS),
    TableEntry::eeprom(Register::byte(13, "lowest voltage"), 50, 250).measured(VOLTS),
    TableEntry::eeprom(Register::byte(14, "highest voltage"), 50, 250).measured(VOLTS),
    TableEntry::eeprom(Register::word(15, "maximum torque"), 0, 1023).measured(SHARE),
    TableEntry::eeprom(Register::byte(17, "status return level"), 2, 2),
    TableEntry::eeprom(Register::byte(18, "shutdown"), 0, 7).measured(ERRORS),
    TableEntry::ram(TORQUE, 0, 1)
        .measured(Measure::Choice(&[(0, "off"), (1, "on")]))
        .torque_bits(1),
    TableEntry::ram(Register::byte(25, "LED"), 0, 7),
    TableEntry::ram(Register::byte(27, "D gain"), 0, 254),
    TableEntry::ram(Register::byte(28, "I gain"), 0, 254),
    TableEntry::ram(Register::byte(29, "P gain"), 0, 254),
    TableEntry::goal(Register::word(30, "goal position")).measured(Measure::Angle),
    TableEntry::goal(Register::word(32, "goal velocity"))
        .sign_bit(SIGN_BIT)
        .measured(Measure::Speed),
    TableEntry::goal(Register::word(35, "goal torque")).measured(SHARE),
    TableEntry::read(Register::word(37, "present position")).measured(Measure::Angle),
    TableEntry::read(Register::word(39, "present speed"))
        .sign_bit(SIGN_BIT)
        .measured(Measure::Speed),
    TableEntry::read(Register::word(41, "present load")).sign_bit(SIGN_BIT).measured(SHARE),
    TableEntry::read(Register::byte(45, "present input voltage")).measured(VOLTS),
    TableEntry::read(Register::byte(46, "present temperature")).measured(CELSIUS),
    TableEntry::read(Register::byte(47, "registered instruction")),
    TableEntry::read(Register::byte(49, "moving")),
    TableEntry::read(Register::byte(50, "hardware error status")).measured(ERRORS),
    TableEntry::ram(Register::word(51, "punch"), 0, 1023),
];

pub(super) fn table() -> RegisterTable {
    let places = Places { goals: Some((LOWEST, HIGHEST)), speed: None, offset: None };
    RegisterTable::new("XL-320", UNITS, TORQUE, places, &[ENTRIES])
}
