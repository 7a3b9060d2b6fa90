//! MIT mode: CubeMars and Damiao motors, 11-bit ids.
//!
//! ```text
//! command  p[16] v[12] kp[12] kd[12] t[12], big-endian
//! reply    id (Damiao: id | error << 4), p[16] v[12] t[12], temperatures or error
//! FF x7 FC enable, FD disable, FE zero
//! ```
//!
//! Damiao motors have registers as well (id 7FF: 33 read, 55 write): the ranges
//! are read and must be those of the configuration, and the time-out is set and
//! read back. CubeMars motors have neither: their ranges are believed, and arming
//! them needs `accept_no_watchdog`. The reply of a CubeMars motor does not say
//! whether it drives, so that its torque off is confirmed by an answer alone.
//!
//! MIT mode knows no torque limit but the motor's own peak. `torque_limit_nm` is
//! kept by the gains: where they would ask for more than that, from where the
//! motor stood last, both shrink until they ask for the limit. Between two
//! commands a joint that is pushed about may pass it by what the (shrunk) gains
//! make of the way it was pushed.
//!
//! TIMEOUT counts 50 us (the vendor's register list; almond-bot/axol, pull
//! request 163, has it so from the motors themselves); 0 turns it off.
//!
//! The reply carries torque, not current: [`servodance_types::JointState`]
//! shows a current of 0.

use crate::bus::Health;
use crate::can::exchange::{Exchange, Status};
use crate::can::frame::CanFrame;
use crate::can::motor::{MotorModel, MotorSettings};
use crate::can::protocol::Protocol;
use crate::error::BusError;
use crate::servo::Servo;

/// The last byte of a mode command.
const ENABLE: u8 = 0xFC;
const DISABLE: u8 = 0xFD;
const CLEAR: u8 = 0xFB;
/// Where Damiao registers are read and written.
const REGISTER_ID: u32 = 0x7FF;
const READ: u8 = 0x33;
const WRITE: u8 = 0x55;

/// What a motor says after its time-out.
const LOST: &str = "communication lost";

mod register {
    pub const OT_VALUE: (u8, &str) = (2, "OT_Value (C)");
    pub const REPLY_ID: (u8, &str) = (7, "MST_ID");
    pub const TIMEOUT: (u8, &str) = (9, "TIMEOUT (50 us)");
    pub const MODE: (u8, &str) = (10, "CTRL_MODE");
    pub const PMAX: (u8, &str) = (21, "PMAX (rad)");
    pub const VMAX: (u8, &str) = (22, "VMAX (rad/s)");
    pub const TMAX: (u8, &str) = (23, "TMAX (Nm)");
}

/// Units of the time-out register a millisecond.
const TIMEOUT_UNITS_PER_MS: u32 = 20;
const MIT_MODE: u32 = 1;

/// CubeMars and Damiao.
pub(crate) struct Mit;

/// `value` as an unsigned code of `bits` over +- `range`, the nearest.
pub(crate) fn to_code(value: f64, range: f64, bits: u32) -> u32 {
    span_code(value + range, 2.0 * range, bits)
}

/// The value of a code over +- `range`.
pub(crate) fn from_code(code: u32, range: f64, bits: u32) -> f64 {
    let top = f64::from((1u32 << bits) - 1);
    f64::from(code) * 2.0 * range / top - range
}

/// `value` as an unsigned code of `bits` from 0 to `span`. What is no number
/// or outside becomes an end of the range.
pub(crate) fn span_code(value: f64, span: f64, bits: u32) -> u32 {
    let top = f64::from((1u32 << bits) - 1);
    nearest(value / span * top).clamp(0.0, top) as u32
}

/// The nearest code; between two the lower one, as the vendors' own code, which
/// cuts off, has it for zero.
fn nearest(exact: f64) -> f64 {
    (exact - 0.5).ceil()
}

/// The 16-bit code of a joint position: the nearest one inside the joint's limits.
pub(crate) fn position_code(servo: &Servo, range: f64, joint_rad: f64) -> u32 {
    let exact = |joint_rad: f64| {
        let motor_rad = servo.motor_rad(joint_rad);
        (motor_rad + range) / (2.0 * range) * 65_535.0
    };
    let a = exact(servo.limits.lower_rad);
    let b = exact(servo.limits.upper_rad);
    // A limit that is a whole code must survive its own rounding error.
    let lowest = (a.min(b) - 1e-6).ceil();
    let highest = (a.max(b) + 1e-6).floor().max(lowest);
    nearest(exact(joint_rad))
        .clamp(lowest, highest)
        .clamp(0.0, 65_535.0) as u32
}

/// A command's eight bytes.
pub(crate) fn pack(p: u32, v: u32, kp: u32, kd: u32, t: u32) -> [u8; 8] {
    [
        (p >> 8) as u8,
        p as u8,
        (v >> 4) as u8,
        ((v & 0xF) << 4 | kp >> 8) as u8,
        kp as u8,
        (kd >> 4) as u8,
        ((kd & 0xF) << 4 | t >> 8) as u8,
        t as u8,
    ]
}

/// Position (16), velocity (12) and torque (12) of a reply.
pub(crate) fn unpack(data: &[u8]) -> Option<(u32, u32, u32)> {
    let &[_, p1, p0, v1, v0_t1, t0, ..] = data else {
        return None;
    };
    let [p1, p0, v1, v0_t1, t0] = [p1, p0, v1, v0_t1, t0].map(u32::from);
    Some((p1 << 8 | p0, v1 << 4 | v0_t1 >> 4, (v0_t1 & 0xF) << 8 | t0))
}

/// What Damiao's error nibble says; `None` for 0 (disabled) and 1 (enabled).
pub(crate) fn damiao_fault(nibble: u8) -> Option<&'static str> {
    Some(match nibble {
        0 | 1 => return None,
        8 => "over-voltage",
        9 => "under-voltage",
        0xA => "over-current",
        0xB => "MOSFET overheating",
        0xC => "coil overheating",
        0xD => LOST,
        0xE => "overload",
        _ => "an unknown error",
    })
}

/// What a CubeMars error byte says.
fn cubemars_fault(code: u8) -> Option<&'static str> {
    Some(match code {
        0 => return None,
        1 => "motor overheating",
        2 => "over-current",
        3 => "over-voltage",
        4 => "under-voltage",
        5 => "encoder fault",
        6 => "MOSFET overheating",
        7 => "motor stalled",
        _ => "an unknown error",
    })
}

fn settings(servo: &Servo) -> Option<&MotorSettings> {
    servo.motor.as_ref()
}

fn mode_command(servo: &Servo, last: u8) -> CanFrame {
    let mut data = [0xFF; 8];
    data[7] = last;
    CanFrame::standard(u32::from(servo.id), &data)
}

/// What a motor's reply says, if the frame is one of this motor.
fn parse_reply(servo: &Servo, frame: &CanFrame) -> Option<Status> {
    let motor = settings(servo)?;
    if frame.is_extended() || frame.is_remote() {
        return None;
    }
    let data = frame.data();
    let (first, (p, v, _)) = (*data.first()?, unpack(data)?);
    let model = &motor.model;
    // Damiao: inverter, then coil; CubeMars: the motor.
    let celsius = |at: usize| data.get(at).map(|byte| f64::from(*byte));
    let (fault, active, temperature_c) = if model.has_registers {
        let is_ours = frame.id() == u32::from(motor.reply_id) && first & 0xF == servo.id & 0xF;
        if !is_ours || data.len() != 8 {
            return None;
        }
        let nibble = first >> 4;
        let name = damiao_fault(nibble).map(|name| format!("{name} (error {nibble:X})"));
        let hottest = celsius(6).into_iter().chain(celsius(7)).reduce(f64::max);
        (name, nibble == 1, hottest)
    } else {
        let from = [u32::from(motor.reply_id), u32::from(servo.id)];
        if first != servo.id || !from.contains(&frame.id()) {
            return None;
        }
        let code = data.get(7).copied().unwrap_or(0);
        let name = cubemars_fault(code).map(|name| format!("{name} (error {code})"));
        (name, true, celsius(6))
    };
    Some(Status {
        position_rad: from_code(p, model.position_rad, 16),
        velocity_rad_s: from_code(v, model.velocity_rad_s, 12),
        active,
        fault,
        temperature_c,
    })
}

/// The bytes of a register that a Damiao motor answers with.
fn parse_register(servo: &Servo, frame: &CanFrame, command: u8, register: u8) -> Option<[u8; 4]> {
    let motor = settings(servo)?;
    if frame.is_extended() || frame.id() != u32::from(motor.reply_id) {
        return None;
    }
    let [id, high, said, which, value @ ..] = frame.eight()?;
    let is_ours = id == servo.id && high == 0 && said == command && which == register;
    is_ours.then_some(value)
}

/// Reads or writes a register; its bytes afterwards.
fn access(
    bus: &mut Exchange,
    index: usize,
    command: u8,
    (register, name): (u8, &'static str),
    value: [u8; 4],
) -> Result<[u8; 4], BusError> {
    let servo = bus.servos[index].clone();
    let [a, b, c, d] = value;
    let data = [servo.id, 0, command, register, a, b, c, d];
    let question = CanFrame::standard(REGISTER_ID, &data);
    bus.ask(index, &question, name, |frame| {
        parse_register(&servo, frame, command, register).map(Ok)
    })
}

fn read(bus: &mut Exchange, index: usize, at: (u8, &'static str)) -> Result<[u8; 4], BusError> {
    access(bus, index, READ, at, [0; 4])
}

/// Writes a whole number and reads it back; a change of something that the
/// motor keeps is noted.
fn settle(
    bus: &mut Exchange,
    index: usize,
    at: (u8, &'static str),
    value: u32,
    notes: Option<&mut Vec<String>>,
) -> Result<(), BusError> {
    let old = u32::from_le_bytes(read(bus, index, at)?);
    if old == value {
        return Ok(());
    }
    access(bus, index, WRITE, at, value.to_le_bytes())?;
    let now = u32::from_le_bytes(read(bus, index, at)?);
    if now != value {
        return Err(bus.unfit(index, at.1, now, value));
    }
    if let Some(notes) = notes {
        let servo = bus.id_of(index);
        notes.push(format!("{servo}: {} changed from {old} to {value}", at.1));
    }
    Ok(())
}

/// How much of the gains a command may have, 0 to 1, so that the torque that it
/// asks for where the motor stood last stays within the limit.
fn gain_share(motor: &MotorSettings, goal_rad: f64, status: &Status) -> f64 {
    let error_rad = goal_rad - status.position_rad;
    let asked_nm = motor.kp * error_rad - motor.kd * status.velocity_rad_s;
    (motor.torque_limit_nm / asked_nm.abs()).min(1.0)
}

impl Mit {
    /// A Damiao motor's ranges, mode and time-out.
    fn prepare_damiao(
        bus: &mut Exchange,
        index: usize,
        model: MotorModel,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        for (at, wanted) in [
            (register::PMAX, model.position_rad),
            (register::VMAX, model.velocity_rad_s),
            (register::TMAX, model.torque_nm),
        ] {
            let actual = f32::from_le_bytes(read(bus, index, at)?);
            bus.same(index, at.1, f64::from(actual), wanted)?;
        }
        let reply_id = settings(&bus.servos[index]).map_or(0, |motor| u32::from(motor.reply_id));
        let actual = u32::from_le_bytes(read(bus, index, register::REPLY_ID)?);
        if actual != reply_id {
            return Err(bus.unfit(index, register::REPLY_ID.1, actual, reply_id));
        }
        settle(bus, index, register::MODE, MIT_MODE, Some(notes))?;
        let timeout = bus.config.watchdog_ms * TIMEOUT_UNITS_PER_MS;
        settle(bus, index, register::TIMEOUT, timeout, None)
    }
}

impl Protocol for Mit {
    fn release(&self, bus: &mut Exchange, index: usize) -> Result<Status, BusError> {
        let servo = bus.servos[index].clone();
        let has_registers = settings(&servo).is_some_and(|motor| motor.model.has_registers);
        let ask = |bus: &mut Exchange, last| {
            bus.ask(index, &mode_command(&servo, last), "torque off", |frame| {
                let status = parse_reply(&servo, frame)?;
                // A reply that was under way before still shows torque on.
                (!has_registers || !status.active).then_some(Ok(status))
            })
        };
        let mut status = ask(bus, DISABLE)?;
        // Silence before us is no reason to refuse us.
        if status
            .fault
            .as_ref()
            .is_some_and(|fault| fault.starts_with(LOST))
        {
            status = ask(bus, CLEAR)?;
        }
        status.active = false;
        Ok(status)
    }

    fn prepare(
        &self,
        bus: &mut Exchange,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        let Some(model) = settings(&bus.servos[index]).map(|motor| motor.model) else {
            return Ok(());
        };
        if model.has_registers {
            return Self::prepare_damiao(bus, index, model, notes);
        }
        let name = bus.servos[index].model.name;
        if !bus.config.accept_no_watchdog {
            return Err(BusError::NoWatchdog {
                servo: bus.id_of(index),
                why: format!("{name} has no watchdog in MIT mode"),
            });
        }
        let servo = bus.id_of(index);
        notes.push(format!(
            "{servo}: no watchdog: without a host it holds its last target; \
             its ranges cannot be read and are believed"
        ));
        Ok(())
    }

    fn enable(&self, bus: &mut Exchange, index: usize, motor_rad: f64) -> Result<(), BusError> {
        let servo = bus.servos[index].clone();
        let on = mode_command(&servo, ENABLE);
        bus.ask(index, &on, "torque on", |frame| {
            let status = parse_reply(&servo, frame)?;
            match status.fault {
                Some(fault) => Some(Err(fault)),
                None => status.active.then_some(Ok(())),
            }
        })?;
        // Until its first command the motor is on without torque.
        let mut hold = Vec::with_capacity(1);
        let here = Status {
            position_rad: motor_rad,
            ..Status::default()
        };
        self.command(&servo, servo.joint_rad(motor_rad), &here, &mut hold);
        for frame in &hold {
            bus.ask(index, frame, "hold position", |frame| {
                parse_reply(&servo, frame).map(|_| Ok(()))
            })?;
        }
        Ok(())
    }

    fn examine(
        &self,
        bus: &mut Exchange,
        index: usize,
        status: &Status,
    ) -> Result<Health, BusError> {
        let motor = settings(&bus.servos[index]);
        let limit = match motor.is_some_and(|motor| motor.model.has_registers) {
            true => {
                let limit = bus.once(|bus| read(bus, index, register::OT_VALUE));
                Some(f32::from_le_bytes(limit?))
            }
            false => None,
        };
        Ok(Health {
            temperature_c: status.temperature_c,
            highest_temperature_c: limit.map(f64::from),
            ..Health::default()
        })
    }

    fn stop(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(mode_command(servo, DISABLE));
    }

    fn command(&self, servo: &Servo, joint_rad: f64, status: &Status, out: &mut Vec<CanFrame>) {
        let Some(motor) = settings(servo) else {
            return;
        };
        let model = &motor.model;
        let position = position_code(servo, model.position_rad, joint_rad);
        let share = gain_share(motor, from_code(position, model.position_rad, 16), status);
        // Downwards: the limit is not passed by rounding either.
        let gain = |code: u32| (f64::from(code) * share) as u32;
        let data = pack(
            position,
            to_code(0.0, model.velocity_rad_s, 12),
            gain(span_code(motor.kp, model.kp_max, 12)),
            gain(span_code(motor.kd, model.kd_max, 12)),
            to_code(0.0, model.torque_nm, 12),
        );
        out.push(CanFrame::standard(u32::from(servo.id), &data));
    }

    fn hear(&self, servos: &[Servo], frame: &CanFrame, status: &mut [Status]) -> Option<usize> {
        let mut replies = servos.iter().map(|servo| parse_reply(servo, frame));
        let index = replies.position(|reply| reply.is_some())?;
        status[index] = parse_reply(&servos[index], frame)?;
        Some(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_survive_packing() {
        let data = pack(0x1234, 0xABC, 0xDEF, 0x123, 0x456);
        assert_eq!(data, [0x12, 0x34, 0xAB, 0xCD, 0xEF, 0x12, 0x34, 0x56]);
        let reply = [7, 0x12, 0x34, 0xAB, 0xCD, 0xEF, 0, 0];
        assert_eq!(unpack(&reply), Some((0x1234, 0xABC, 0xDEF)));
        assert_eq!(unpack(&reply[..5]), None);
    }

    /// The command of the published protocol that asks for nothing.
    #[test]
    fn zero_has_its_published_bytes() {
        let (p, v, t) = (
            to_code(0.0, 12.5, 16),
            to_code(0.0, 50.0, 12),
            to_code(0.0, 18.0, 12),
        );
        let published = [0x7F, 0xFF, 0x7F, 0xF0, 0x00, 0x00, 0x07, 0xFF];
        assert_eq!(pack(p, v, 0, 0, t), published);
    }

    #[test]
    fn gains_shrink_to_the_torque_limit_and_not_before() {
        let motor = MotorSettings {
            model: crate::ServoModel::from_name("DM-J4310")
                .unwrap()
                .motor
                .unwrap(),
            kp: 20.0,
            kd: 0.5,
            torque_limit_nm: 2.0,
            gear_ratio: 1.0,
            reply_id: 0,
            counts_per_turn: 1.0,
        };
        let at = |position_rad, velocity_rad_s| Status {
            position_rad,
            velocity_rad_s,
            ..Status::default()
        };
        for (position_rad, velocity_rad_s, share) in [
            (1.0, 0.0, 1.0),
            (0.95, 0.0, 1.0),
            (0.8, 0.0, 0.5),
            (1.2, 0.0, 0.5),
            // Braking counts too.
            (1.0, 8.0, 0.5),
        ] {
            let seen = gain_share(&motor, 1.0, &at(position_rad, velocity_rad_s));
            assert!((seen - share).abs() < 1e-9, "{seen} at {position_rad}");
        }
    }

    #[test]
    fn codes_cover_their_range_and_nothing_more() {
        assert_eq!(to_code(-12.5, 12.5, 16), 0);
        assert_eq!(to_code(12.5, 12.5, 16), 65_535);
        assert_eq!(to_code(99.0, 12.5, 16), 65_535);
        assert_eq!(to_code(f64::NAN, 12.5, 16), 0);
        for code in [0, 1, 32_767, 32_768, 65_535] {
            assert_eq!(to_code(from_code(code, 12.5, 16), 12.5, 16), code);
        }
    }
}
