//! How a servo's firmware keeps its memory: what the simulator needs of a family
//! beyond what the driver reads and writes.

use crate::serial::register::Register;
use crate::serial::registers::Registers;

/// Which simulated firmware a servo runs.
#[derive(Clone, Copy, Debug)]
pub enum Firmware {
    /// That of the Dynamixel X series: a control table that refuses what is out of
    /// range, modes, profiles, indirect addresses (`sim/src/servo/dynamixel2/`).
    DynamixelX,
    /// Plain bytes with a position loop, Protocol 1 (`sim/src/servo/byte_servo.rs`).
    Bytes(&'static ByteMemory),
}

/// The rate that a value of a baud register means, bits a second; 0 for none.
pub type BaudDecoder = fn(u8) -> u32;

/// The memory of a servo that keeps plain bytes. What is `None` does not exist.
#[allow(missing_docs)] // a register's field says which one it is
#[derive(Debug)]
pub struct ByteMemory {
    /// Those that the driver uses; the position is the first word of the present state.
    pub registers: &'static Registers,
    pub size: usize,
    pub ram: usize,
    pub model: Option<Register>,
    /// The baud register, and the rate that it means; 0 for none.
    pub baud: Option<(Register, BaudDecoder)>,
    pub return_delay: Option<Register>,
    pub status_level: Option<Register>,
    pub goal_limits: Option<(Register, Register)>,
    pub p_gain: Option<Register>,
    pub offset: Option<Register>,
    /// The mode that the loops heed: `sim/src/servo/byte_loops.rs`.
    pub mode: Option<Register>,
    pub acceleration: Option<Register>,
    pub goal_time: Option<Register>,
    pub goal_speed: Option<Register>,
    pub torque_limit: Option<Register>,
    pub speed: Option<Register>,
    pub load: Option<Register>,
    pub moving: Option<Register>,
    pub current: Option<Register>,
    /// What makes the servo protect itself; without it nothing does.
    pub protection: Option<Protection>,
    /// What may be written: the addresses from the id up to this one, and the others.
    pub last_writable: usize,
    pub also_writable: &'static [usize],
    pub factory: &'static [(Register, u16)],
    /// The bit that is the sign of a speed.
    pub sign_bit: u32,
    pub refuses_goals: bool,
    pub sync_read: bool,
    pub bulk_read: bool,
    pub reboots: bool,
}

impl ByteMemory {
    /// The rate with which it leaves the factory, of those in `known`, bits a second.
    pub fn factory_baud(&self, known: &[u32]) -> Option<u32> {
        let (register, baud_of) = self.baud?;
        let written = self.factory.iter().find(|(factory, _)| *factory == register);
        let baud = baud_of(written.map_or(0, |(_, code)| *code) as u8);
        // 2 Mbps divided by 35 is 57,142: the servo's 57,600.
        known.iter().copied().find(|known| known.abs_diff(baud) * 50 < *known)
    }

    /// A memory of `size` bytes, all of which may be written, with the registers that
    /// every bus needs and nothing else.
    pub const fn bare(registers: &'static Registers, size: usize) -> Self {
        Self {
            registers,
            size,
            ram: 0,
            model: None,
            baud: None,
            return_delay: None,
            status_level: None,
            goal_limits: None,
            p_gain: None,
            offset: None,
            mode: None,
            acceleration: None,
            goal_time: None,
            goal_speed: None,
            torque_limit: None,
            speed: None,
            load: None,
            moving: None,
            current: None,
            protection: None,
            last_writable: size - 1,
            also_writable: &[],
            factory: &[],
            sign_bit: 15,
            refuses_goals: false,
            sync_read: false,
            bulk_read: false,
            reboots: false,
        }
    }
}

#[allow(missing_docs)] // a register's field says which one it is
#[derive(Clone, Copy, Debug)]
pub struct Protection {
    pub hottest: Register,
    pub max_voltage: Register,
    pub min_voltage: Register,
    /// The bits of voltage, heat and overload in an answer's error byte.
    pub conditions: (u8, u8, u8),
    /// Which conditions cut torque; `None`: all of them.
    pub shutdown: Option<Register>,
}
