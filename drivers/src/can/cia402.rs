//! CiA 402 drives over CANopen, cyclic synchronous position.
//!
//! ```text
//! 200 + id  RPDO1  control word, target position      (6 bytes)
//! 180 + id  TPDO1  status word, position, torque      (8 bytes), on SYNC (080)
//! 600 + id  SDO to the drive, 580 + id its answer (expedited transfers only)
//! 700 + 127 our heartbeat, one a cycle; the drives watch it (1016)
//! 080 + id  emergency
//! ```
//!
//! The PDOs are mapped by this driver, with the drive pre-operational. Objects
//! are written with torque off and read back. When our heartbeat ends, the drive
//! switches its voltage off (6007 = 2).
//!
//! The drive's own position loop is used, so `kp` and `kd` mean nothing here.

use std::f64::consts::TAU;

use crate::can::exchange::{Exchange, Status};
use crate::can::frame::CanFrame;
use crate::can::motor::MotorSettings;
use crate::can::protocol::Protocol;
use crate::error::BusError;
use crate::servo::Servo;

/// Our node id.
const HOST: u32 = 127;
const OPERATIONAL: u8 = 5;
const NMT_START: u8 = 1;
const NMT_PRE_OPERATIONAL: u8 = 128;
const SYNC: u32 = 0x080;
/// Device profile in the low word of object 1000.
const PROFILE: u32 = 402;
const CYCLIC_POSITION: u32 = 8;
const DISABLE_VOLTAGE: u32 = 2;
/// A PDO that is not in use has this bit in its id.
const PDO_OFF: u32 = 1 << 31;

/// An object: index, subindex, bytes, name.
type Object = (u16, u8, u8, &'static str);

mod object {
    use super::Object;
    pub const DEVICE_TYPE: Object = (0x1000, 0, 4, "device type (1000)");
    pub const CONSUMER: Object = (0x1016, 1, 4, "consumer heartbeat (1016)");
    pub const ABORT_OPTION: Object = (0x6007, 0, 2, "abort option (6007)");
    pub const ERROR_CODE: Object = (0x603F, 0, 2, "error code (603F)");
    pub const CONTROL: Object = (0x6040, 0, 2, "control word (6040)");
    pub const STATUS: Object = (0x6041, 0, 2, "status word (6041)");
    pub const MODE: Object = (0x6060, 0, 1, "mode (6060)");
    pub const MODE_SHOWN: Object = (0x6061, 0, 1, "mode display (6061)");
    pub const POSITION: Object = (0x6064, 0, 4, "position (6064)");
    pub const MAX_TORQUE: Object = (0x6072, 0, 2, "max torque (6072)");
    pub const TARGET: Object = (0x607A, 0, 4, "target position (607A)");
}

/// The states of the drive that matter here: mask, value of the status word.
const OPERATION_ENABLED: (u16, u16) = (0x6F, 0x27);
const FAULT: u16 = 1 << 3;
const FAULT_RESET: u32 = 0x80;
/// What a drive says when our heartbeat ended.
const LOST: &str = "heartbeat lost";
/// Control words on the way to torque, and the status word each must bring.
const LADDER: [(u32, u16, &str); 3] = [
    (0x06, 0x21, "ready to switch on"),
    (0x07, 0x23, "switched on"),
    (0x0F, OPERATION_ENABLED.1, "operation enabled"),
];

/// CiA 402.
pub(crate) struct Cia402;

fn sdo(servo: &Servo, command: u8, object: Object, value: [u8; 4]) -> CanFrame {
    let [low, high] = object.0.to_le_bytes();
    let [a, b, c, d] = value;
    let data = [command, low, high, object.1, a, b, c, d];
    CanFrame::standard(0x600 + u32::from(servo.id), &data)
}

/// Sends one SDO; the value bytes of the answer.
fn transfer(
    bus: &mut Exchange,
    index: usize,
    command: u8,
    object: Object,
    value: [u8; 4],
) -> Result<[u8; 4], BusError> {
    let servo = bus.servos[index].clone();
    let question = sdo(&servo, command, object, value);
    let [low, high] = object.0.to_le_bytes();
    bus.ask(index, &question, object.3, |frame| {
        if frame.is_extended() || frame.id() != 0x580 + u32::from(servo.id) {
            return None;
        }
        let [said, l, h, sub, value @ ..] = frame.eight()?;
        if [l, h, sub] != [low, high, object.1] {
            return None;
        }
        match said {
            0x80 => Some(Err(abort_name(u32::from_le_bytes(value)))),
            0x60 if command != 0x40 => Some(Ok(value)),
            // Expedited, with or without a size.
            0x42..=0x4F if command == 0x40 => Some(Ok(value)),
            _ => None,
        }
    })
}

fn abort_name(code: u32) -> String {
    let name = match code {
        0x0601_0000 => "unsupported access",
        0x0601_0002 => "read only",
        0x0602_0000 => "no such object",
        0x0604_0041 => "cannot be mapped",
        0x0607_0010 => "wrong length",
        0x0609_0011 => "no such subindex",
        0x0609_0030 => "value out of range",
        0x0800_0022 => "not in this state",
        _ => "abort",
    };
    format!("{name} ({code:08X})")
}

fn read(bus: &mut Exchange, index: usize, object: Object) -> Result<u32, BusError> {
    let bytes = transfer(bus, index, 0x40, object, [0; 4])?;
    let unused = 8 * (4 - u32::from(object.2));
    Ok(u32::from_le_bytes(bytes) << unused >> unused)
}

fn write(bus: &mut Exchange, index: usize, object: Object, value: u32) -> Result<(), BusError> {
    let command = write_command(object);
    transfer(bus, index, command, object, value.to_le_bytes()).map(|_| ())
}

/// Expedited download of 1, 2 or 4 bytes.
fn write_command(object: Object) -> u8 {
    0x23 | (4 - object.2) << 2
}

/// Writes an object and reads it back.
fn set(bus: &mut Exchange, index: usize, object: Object, value: u32) -> Result<(), BusError> {
    write(bus, index, object, value)?;
    let actual = read(bus, index, object)?;
    if actual == value {
        return Ok(());
    }
    Err(bus.unfit(index, object.3, actual, value))
}

/// Maps objects (index << 16 | subindex << 8 | bits) into a PDO.
fn map_pdo(
    bus: &mut Exchange,
    index: usize,
    (communication, mapping): (u16, u16),
    id: u32,
    objects: &[u32],
) -> Result<(), BusError> {
    const NAME: &str = "PDO mapping";
    write(bus, index, (communication, 1, 4, NAME), id | PDO_OFF)?;
    write(bus, index, (communication, 2, 1, NAME), 1)?;
    write(bus, index, (mapping, 0, 1, NAME), 0)?;
    for (entry, object) in (1..).zip(objects) {
        set(bus, index, (mapping, entry, 4, NAME), *object)?;
    }
    set(bus, index, (mapping, 0, 1, NAME), objects.len() as u32)?;
    set(bus, index, (communication, 1, 4, NAME), id)
}

/// Increments of the motor for an angle after the gear.
fn counts(motor: &MotorSettings, motor_rad: f64) -> f64 {
    motor_rad / TAU * motor.gear_ratio * motor.counts_per_turn
}

fn angle_rad(motor: &MotorSettings, counts: i32) -> f64 {
    f64::from(counts) * TAU / (motor.gear_ratio * motor.counts_per_turn)
}

/// The nearest increment inside the joint's limits.
fn target_counts(servo: &Servo, motor: &MotorSettings, joint_rad: f64) -> i32 {
    let exact = |joint_rad| counts(motor, servo.motor_rad(joint_rad));
    let a = exact(servo.limits.lower_rad);
    let b = exact(servo.limits.upper_rad);
    let lowest = (a.min(b) - 1e-6).ceil();
    let highest = (a.max(b) + 1e-6).floor().max(lowest);
    exact(joint_rad).round().clamp(lowest, highest) as i32
}

fn is_enabled(status: u16) -> bool {
    status & OPERATION_ENABLED.0 == OPERATION_ENABLED.1
}

fn nmt(servo: &Servo, command: u8) -> CanFrame {
    CanFrame::standard(0, &[command, servo.id])
}

fn heartbeat() -> CanFrame {
    CanFrame::standard(0x700 + HOST, &[OPERATIONAL])
}

impl Cia402 {
    /// What a drive in fault says.
    fn fault(bus: &mut Exchange, index: usize, status: u16) -> Result<Option<String>, BusError> {
        if status & FAULT == 0 {
            return Ok(None);
        }
        let code = read(bus, index, object::ERROR_CODE)?;
        Ok(Some(format!("fault, {}", error_name(code as u16))))
    }
}

/// The error classes of CiA 402.
pub(crate) fn error_name(code: u16) -> String {
    let name = match code {
        0x2000..=0x2FFF => "over-current",
        0x3100..=0x31FF => "supply voltage",
        0x3210..=0x321F => "over-voltage",
        0x3220..=0x322F => "under-voltage",
        0x4000..=0x4FFF => "overheating",
        0x5000..=0x5FFF => "hardware",
        0x6000..=0x6FFF => "software",
        0x7121 => "motor blocked",
        0x7300..=0x73FF => "sensor",
        0x8130 => LOST,
        0x8611 => "following error",
        _ => "error",
    };
    format!("{name} (code {code:04X})")
}

impl Protocol for Cia402 {
    fn release(&self, bus: &mut Exchange, index: usize) -> Result<Status, BusError> {
        write(bus, index, object::CONTROL, 0)?;
        let status = read(bus, index, object::STATUS)? as u16;
        if is_enabled(status) {
            return Err(bus.unfit(
                index,
                object::STATUS.3,
                format!("{status:04X}"),
                "off after control word 0",
            ));
        }
        let mut fault = Self::fault(bus, index, status)?;
        // Silence before us is no reason to refuse us.
        if fault.as_ref().is_some_and(|fault| fault.contains(LOST)) {
            write(bus, index, object::CONTROL, FAULT_RESET)?;
            let status = read(bus, index, object::STATUS)? as u16;
            fault = Self::fault(bus, index, status)?;
        }
        let position = read(bus, index, object::POSITION)? as i32;
        let motor = bus.servos[index].motor.as_ref();
        Ok(Status {
            position_rad: motor.map_or(f64::NAN, |motor| angle_rad(motor, position)),
            velocity_rad_s: 0.0,
            active: false,
            fault,
            temperature_c: None,
        })
    }

    fn prepare(
        &self,
        bus: &mut Exchange,
        index: usize,
        _notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        let servo = bus.servos[index].clone();
        let id = u32::from(servo.id);
        let device = read(bus, index, object::DEVICE_TYPE)?;
        if device & 0xFFFF != PROFILE {
            let actual = format!("profile {}", device & 0xFFFF);
            return Err(bus.unfit(index, object::DEVICE_TYPE.3, actual, "profile 402"));
        }
        let deadline = bus.deadline(1);
        bus.transmit(&nmt(&servo, NMT_PRE_OPERATIONAL), deadline, "setting up")?;
        let rpdo = [0x6040_0010, 0x607A_0020];
        map_pdo(bus, index, (0x1400, 0x1600), 0x200 + id, &rpdo)?;
        let tpdo = [0x6041_0010, 0x6064_0020, 0x6077_0010];
        map_pdo(bus, index, (0x1800, 0x1A00), 0x180 + id, &tpdo)?;
        write(bus, index, object::MODE, CYCLIC_POSITION)?;
        let mode = read(bus, index, object::MODE_SHOWN)?;
        if mode != CYCLIC_POSITION {
            return Err(bus.unfit(index, object::MODE_SHOWN.3, mode, CYCLIC_POSITION));
        }
        if let Some(motor) = &servo.motor {
            let share = motor.torque_limit_nm / motor.model.torque_nm;
            let per_mille = (share * 1000.0).round() as u32;
            set(bus, index, object::MAX_TORQUE, per_mille)?;
        }
        set(bus, index, object::ABORT_OPTION, DISABLE_VOLTAGE)?;
        let watched = HOST << 16 | bus.config.watchdog_ms;
        set(bus, index, object::CONSUMER, watched)
    }

    fn enable(&self, bus: &mut Exchange, index: usize, motor_rad: f64) -> Result<(), BusError> {
        let servo = bus.servos[index].clone();
        let Some(motor) = &servo.motor else {
            return Ok(());
        };
        // The drive begins to watch with the first heartbeat it hears.
        let deadline = bus.deadline(2);
        bus.transmit(&heartbeat(), deadline, "torque on")?;
        bus.transmit(&nmt(&servo, NMT_START), deadline, "torque on")?;
        let hold = target_counts(&servo, motor, servo.joint_rad(motor_rad));
        set(bus, index, object::TARGET, hold as u32)?;
        for (control, wanted, name) in LADDER {
            write(bus, index, object::CONTROL, control)?;
            let status = read(bus, index, object::STATUS)? as u16;
            if let Some(fault) = Self::fault(bus, index, status)? {
                return Err(bus.faulty(index, &fault));
            }
            if status & OPERATION_ENABLED.0 != wanted {
                let actual = format!("{status:04X}");
                return Err(bus.unfit(index, object::STATUS.3, actual, name));
            }
        }
        bus.transmit(&heartbeat(), deadline, "torque on")
    }

    fn stop(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        let command = write_command(object::CONTROL);
        out.push(sdo(servo, command, object::CONTROL, [0; 4]));
    }

    fn command(&self, servo: &Servo, joint_rad: f64, _: &Status, out: &mut Vec<CanFrame>) {
        let Some(motor) = &servo.motor else {
            return;
        };
        let mut data = [0; 6];
        data[..2].copy_from_slice(&0x0Fu16.to_le_bytes());
        let target = target_counts(servo, motor, joint_rad);
        data[2..].copy_from_slice(&target.to_le_bytes());
        out.push(CanFrame::standard(0x200 + u32::from(servo.id), &data));
    }

    fn conclude(&self, out: &mut Vec<CanFrame>) {
        out.push(heartbeat());
        out.push(CanFrame::standard(SYNC, &[]));
    }

    fn hear(&self, servos: &[Servo], frame: &CanFrame, status: &mut [Status]) -> Option<usize> {
        if frame.is_extended() {
            return None;
        }
        let node = frame.id() & 0x7F;
        let index = servos
            .iter()
            .position(|servo| u32::from(servo.id) == node)?;
        let motor = servos[index].motor.as_ref()?;
        let status = &mut status[index];
        match (frame.id() & 0x780, frame.data()) {
            (0x180, &[s0, s1, p0, p1, p2, p3, _, _]) => {
                let word = u16::from_le_bytes([s0, s1]);
                let position = i32::from_le_bytes([p0, p1, p2, p3]);
                status.position_rad = angle_rad(motor, position);
                status.active = is_enabled(word);
                if word & FAULT != 0 && status.fault.is_none() {
                    status.fault = Some(format!("fault (status word {word:04X})"));
                }
                Some(index)
            }
            (0x080, &[c0, c1, ..]) => {
                let code = u16::from_le_bytes([c0, c1]);
                status.fault = (code != 0).then(|| error_name(code));
                None
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expedited_downloads_have_their_published_command_bytes() {
        let commands = [1, 2, 4].map(|bytes| write_command((0x6060, 0, bytes, "")));
        assert_eq!(commands, [0x2F, 0x2B, 0x23]);
    }

    #[test]
    fn codes_are_named() {
        assert_eq!(error_name(0x8130), "heartbeat lost (code 8130)");
        assert_eq!(abort_name(0x0602_0000), "no such object (06020000)");
    }
}
