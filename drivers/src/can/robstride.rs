//! RobStride motors: their own protocol, 29-bit ids.
//!
//! ```text
//! id         type << 24 | data16 << 8 | motor          (to the motor)
//! feedback   2 << 24 | mode << 22 | faults << 16 | motor << 8 | host
//!            p[16] v[16] t[16] temperature[16], big-endian
//! control    type 1, data16 = torque, p[16] v[16] kp[16] kd[16], big-endian
//! parameters type 17 read, 18 write: index u16, 0, 0, value, little-endian
//! ```
//!
//! Operation control (mode 0) is used: position, gains and torque in each
//! command. The torque limit and the time-out (parameter 7028)
//! are written and read back. The time-out counts 50 us, 20000 a second, and 0
//! turns it off: RobStride's parameter list (canTimeout), as repeated on
//! motorbridge.seeedstudio.com/reference/robstride-parameter-tables.

use crate::can::exchange::{Exchange, Status};
use crate::can::frame::CanFrame;
use crate::can::mit::{from_code, position_code, span_code, to_code};
use crate::can::protocol::Protocol;
use crate::error::BusError;
use crate::servo::Servo;

/// Our id on the bus.
const HOST: u32 = 0xFD;

mod kind {
    pub const CONTROL: u32 = 1;
    pub const FEEDBACK: u32 = 2;
    pub const ENABLE: u32 = 3;
    pub const STOP: u32 = 4;
    pub const READ: u32 = 17;
    pub const WRITE: u32 = 18;
    pub const FAULT: u32 = 21;
}

mod parameter {
    pub const MODE: (u16, &str) = (0x7005, "run mode (7005)");
    pub const TORQUE_LIMIT: (u16, &str) = (0x700B, "torque limit (700B)");
    pub const BUS_VOLTAGE: (u16, &str) = (0x701C, "bus voltage (701C)");
    pub const TIMEOUT: (u16, &str) = (0x7028, "CAN time-out (7028)");
}

/// Units of the time-out a millisecond.
const TIMEOUT_UNITS_PER_MS: u32 = 20;
/// Mode in a feedback's id: the motor drives.
const RUNNING: u32 = 2;
/// What the motors are made for.
const VOLTAGE_V: std::ops::RangeInclusive<f64> = 15.0..=60.0;

/// RobStride.
pub(crate) struct Robstride;

fn frame(kind: u32, data16: u32, servo: &Servo, data: &[u8; 8]) -> CanFrame {
    CanFrame::extended(kind << 24 | data16 << 8 | u32::from(servo.id), data)
}

/// What the six fault bits of a feedback say.
fn fault_names(faults: u32) -> Option<String> {
    const NAMES: [&str; 6] = [
        "under-voltage",
        "over-current",
        "overheating",
        "magnetic encoder fault",
        "overload",
        "not calibrated",
    ];
    let named = NAMES.iter().enumerate();
    let set: Vec<&str> = named
        .filter(|(bit, _)| faults >> bit & 1 == 1)
        .map(|(_, name)| *name)
        .collect();
    (!set.is_empty()).then(|| set.join(", "))
}

/// A frame of this motor: its type, and the bits 16 to 23 of its id.
fn from_motor(servo: &Servo, frame: &CanFrame) -> Option<(u32, u32, [u8; 8])> {
    let id = frame.id();
    let is_ours = frame.is_extended() && id & 0xFF == HOST && id >> 8 & 0xFF == u32::from(servo.id);
    is_ours.then_some(())?;
    Some((id >> 24, id >> 16 & 0xFF, frame.eight()?))
}

fn parse_feedback(servo: &Servo, frame: &CanFrame) -> Option<Status> {
    let (kind, bits, data) = from_motor(servo, frame)?;
    let model = servo.motor.as_ref()?.model;
    let word = |at: usize| u32::from(u16::from_be_bytes([data[at], data[at + 1]]));
    (kind == kind::FEEDBACK).then(|| Status {
        position_rad: from_code(word(0), model.position_rad, 16),
        velocity_rad_s: from_code(word(2), model.velocity_rad_s, 16),
        active: bits >> 6 == RUNNING,
        fault: fault_names(bits & 0x3F),
        temperature_c: Some(f64::from(word(6)) * 0.1),
    })
}

fn read(bus: &mut Exchange, index: usize, at: (u16, &'static str)) -> Result<[u8; 4], BusError> {
    let servo = bus.servos[index].clone();
    let [low, high] = at.0.to_le_bytes();
    let question = frame(kind::READ, HOST, &servo, &[low, high, 0, 0, 0, 0, 0, 0]);
    bus.ask(index, &question, at.1, |frame| {
        let (kind, refused, data) = from_motor(&servo, frame)?;
        let [l, h, _, _, value @ ..] = data;
        if kind != kind::READ || [l, h] != [low, high] {
            return None;
        }
        Some(match refused {
            0 => Ok(value),
            code => Err(format!("it does not know this parameter (error {code})")),
        })
    })
}

/// Writes a parameter; the motor answers with a feedback.
fn write(
    bus: &mut Exchange,
    index: usize,
    at: (u16, &'static str),
    value: [u8; 4],
) -> Result<(), BusError> {
    let servo = bus.servos[index].clone();
    let [low, high] = at.0.to_le_bytes();
    let [a, b, c, d] = value;
    let order = frame(kind::WRITE, HOST, &servo, &[low, high, 0, 0, a, b, c, d]);
    bus.ask(index, &order, at.1, |frame| {
        parse_feedback(&servo, frame).map(|_| Ok(()))
    })
}

/// Writes a whole number and reads it back.
fn set(
    bus: &mut Exchange,
    index: usize,
    at: (u16, &'static str),
    value: u32,
) -> Result<(), BusError> {
    write(bus, index, at, value.to_le_bytes())?;
    let actual = u32::from_le_bytes(read(bus, index, at)?);
    if actual == value {
        return Ok(());
    }
    Err(bus.unfit(index, at.1, actual, value))
}

fn stop_frame(servo: &Servo) -> CanFrame {
    frame(kind::STOP, HOST, servo, &[0; 8])
}

impl Protocol for Robstride {
    fn release(&self, bus: &mut Exchange, index: usize) -> Result<Status, BusError> {
        let servo = bus.servos[index].clone();
        bus.ask(index, &stop_frame(&servo), "torque off", |frame| {
            let status = parse_feedback(&servo, frame)?;
            (!status.active).then_some(Ok(status))
        })
    }

    fn prepare(
        &self,
        bus: &mut Exchange,
        index: usize,
        _notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        let volts = f64::from(f32::from_le_bytes(read(
            bus,
            index,
            parameter::BUS_VOLTAGE,
        )?));
        if !VOLTAGE_V.contains(&volts) {
            let wanted = format!("{} to {} V", VOLTAGE_V.start(), VOLTAGE_V.end());
            return Err(bus.unfit(
                index,
                parameter::BUS_VOLTAGE.1,
                format!("{volts:.1} V"),
                wanted,
            ));
        }
        set(bus, index, parameter::MODE, 0)?;
        let motor = bus.servos[index].motor.as_ref();
        let limit_nm = motor.map_or(0.0, |motor| motor.torque_limit_nm);
        let value = (limit_nm as f32).to_le_bytes();
        write(bus, index, parameter::TORQUE_LIMIT, value)?;
        let actual = f32::from_le_bytes(read(bus, index, parameter::TORQUE_LIMIT)?);
        let name = parameter::TORQUE_LIMIT.1;
        bus.same(index, name, f64::from(actual), limit_nm)?;
        let timeout = bus.config.watchdog_ms * TIMEOUT_UNITS_PER_MS;
        set(bus, index, parameter::TIMEOUT, timeout)
    }

    fn enable(&self, bus: &mut Exchange, index: usize, motor_rad: f64) -> Result<(), BusError> {
        let servo = bus.servos[index].clone();
        let on = frame(kind::ENABLE, HOST, &servo, &[0; 8]);
        let mut orders = vec![on];
        let joint_rad = servo.joint_rad(motor_rad);
        self.command(&servo, joint_rad, &Status::default(), &mut orders);
        for order in &orders {
            bus.ask(index, order, "torque on", |frame| {
                let status = parse_feedback(&servo, frame)?;
                match status.fault {
                    Some(fault) => Some(Err(fault)),
                    None => status.active.then_some(Ok(())),
                }
            })?;
        }
        Ok(())
    }

    fn stop(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(stop_frame(servo));
    }

    fn command(&self, servo: &Servo, joint_rad: f64, _: &Status, out: &mut Vec<CanFrame>) {
        let Some(motor) = &servo.motor else {
            return;
        };
        let model = &motor.model;
        let words = [
            position_code(servo, model.position_rad, joint_rad),
            to_code(0.0, model.velocity_rad_s, 16),
            span_code(motor.kp, model.kp_max, 16),
            span_code(motor.kd, model.kd_max, 16),
        ];
        let mut data = [0; 8];
        for (pair, word) in data.chunks_exact_mut(2).zip(words) {
            pair.copy_from_slice(&(word as u16).to_be_bytes());
        }
        let torque = to_code(0.0, model.torque_nm, 16);
        out.push(frame(kind::CONTROL, torque, servo, &data));
    }

    fn hear(&self, servos: &[Servo], frame: &CanFrame, status: &mut [Status]) -> Option<usize> {
        let motor = frame.id() >> 8 & 0xFF;
        let index = servos
            .iter()
            .position(|servo| u32::from(servo.id) == motor)?;
        let servo = &servos[index];
        if let Some(heard) = parse_feedback(servo, frame) {
            status[index] = heard;
            return Some(index);
        }
        let (kind, _, data) = from_motor(servo, frame)?;
        let [a, b, c, d, ..] = data;
        let faults = u32::from_le_bytes([a, b, c, d]);
        if kind == kind::FAULT && faults != 0 {
            status[index].fault = Some(format!("fault report {faults:08X}"));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_named() {
        assert_eq!(
            fault_names(0b10_0100).as_deref(),
            Some("overheating, not calibrated")
        );
        assert_eq!(fault_names(0), None);
    }
}
