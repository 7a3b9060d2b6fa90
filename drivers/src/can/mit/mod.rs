//! MIT mode: CubeMars, Damiao and switched RobStride motors, 11-bit ids.
//!
//! Damiao motors have registers as well: the ranges are read and must be those of the
//! configuration, and the time-out is set and read back. CubeMars motors have none:
//! their ranges are believed, and arming them needs `accept_no_watchdog`. The reply of
//! a CubeMars motor does not say whether it drives: its answer alone confirms torque off.
//! RobStride motors that were switched to MIT mode (`RS02(MIT)`) are the same, and their
//! replies tell no faults: those are asked for, one motor a cycle.
//!
//! MIT mode has no torque limit but the motor's own peak. The gains keep
//! `torque_limit_nm`: where they would ask for more than that, from where the motor
//! stood last, both shrink until they ask for the limit. Between two commands a joint
//! that is pushed about may exceed it by what the (shrunk) gains make of the push.
//!
//! A Damiao motor can be driven in position-velocity mode instead (`DM-J4310(PV)`): its own
//! loops take it to the position, at most 1.5 times as fast as the joint may be. There
//! are no gains that could keep `torque_limit_nm`: the motor's own peak is the limit.
//!
//! The reply carries torque, not current: [`servodance_types::JointState`] shows a
//! current of 0.

#[doc(hidden)]
pub mod framing;
mod models;
#[doc(hidden)] // public for the simulated motors alone
pub mod registers;
mod scan;

use std::io;

use crate::can::family::prelude::*;

use self::framing::{from_code, pack_command, position_code, span_code, to_code, unpack_reply};
use self::registers::{
    CLEAR, DISABLE, ENABLE, LOST, MIT_MODE, MODE, MOTOR_ID, MitRegister, OVER_TEMPERATURE, PMAX,
    POSITION_VELOCITY, POSITION_VELOCITY_MODE, READ, REGISTER_ID, REPLY_ID, SAVE, TIMEOUT,
    TIMEOUT_UNITS_PER_MS, TMAX, VMAX, WRITE, cubemars_fault, damiao_fault, robstride_fault,
};

/// A goal is one step of a motion that this side shapes: the motor may be so much faster.
const HEADROOM: f64 = 1.5;

pub(crate) struct Mit;

fn settings(servo: &Servo) -> Option<&MotorSettings> {
    servo.motor.as_ref()
}

fn mode_command(servo: &Servo, last: u8) -> CanFrame {
    let mut data = [0xFF; 8];
    data[7] = last;
    CanFrame::standard(u32::from(servo.id), &data)
}

/// The report in a motor's reply; `None` if the frame is none of this motor.
fn parse_reply(servo: &Servo, frame: &CanFrame) -> Option<MotorStatus> {
    let motor = settings(servo)?;
    if frame.is_extended() || frame.is_remote() {
        return None;
    }
    let data = frame.data();
    let (first, [p, v, _]) = (*data.first()?, unpack_reply(data)?);
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
    } else if model.tells_tenths {
        let is_ours = first == servo.id && frame.id() == u32::from(motor.reply_id);
        if !is_ours || is_fault_report(data) {
            return None;
        }
        let [.., high, low] = frame.eight()?;
        (None, true, Some(f64::from(u16::from_be_bytes([high, low])) * 0.1))
    } else {
        let from = [u32::from(motor.reply_id), u32::from(servo.id)];
        if first != servo.id || !from.contains(&frame.id()) {
            return None;
        }
        let code = data.get(7).copied().unwrap_or(0);
        let name = cubemars_fault(code).map(|name| format!("{name} (error {code})"));
        (name, true, celsius(6))
    };
    Some(MotorStatus {
        position_rad: from_code(p, model.position_rad, 16),
        velocity_rad_s: from_code(v, model.velocity_rad_s, 12),
        active,
        fault,
        temperature_c,
    })
}

/// A RobStride motor's answer to the question for its faults ends with three zeros; a
/// temperature is never zero.
fn is_fault_report(data: &[u8]) -> bool {
    data.len() == 8 && data[5..] == [0; 3]
}

/// The faults that a RobStride motor was asked for.
fn parse_faults(servo: &Servo, frame: &CanFrame) -> Option<Option<String>> {
    let motor = settings(servo).filter(|motor| motor.model.tells_tenths)?;
    let data = frame.eight().filter(|data| !frame.is_extended() && is_fault_report(data))?;
    let is_ours = frame.id() == u32::from(motor.reply_id) && data[0] == servo.id;
    let [_, a, b, c, d, ..] = data;
    let faults = u32::from_le_bytes([a, b, c, d]);
    is_ours.then(|| (faults != 0).then(|| robstride_fault(faults)))
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
    client: &mut MotorClient,
    command: u8,
    (register, name): MitRegister,
    value: [u8; 4],
) -> BusResult<[u8; 4]> {
    let [a, b, c, d] = value;
    let data = [client.servo().id, 0, command, register, a, b, c, d];
    let question = CanFrame::standard(REGISTER_ID, &data);
    client.ask(&question, name, |servo, frame| {
        parse_register(servo, frame, command, register).map(Ok)
    })
}

fn read(client: &mut MotorClient, at: MitRegister) -> BusResult<[u8; 4]> {
    access(client, READ, at, [0; 4])
}

/// Writes a whole number where it differs and reads it back; `notes` gets the change
/// of a register that the motor keeps without power.
fn set(
    client: &mut MotorClient,
    at: MitRegister,
    value: u32,
    notes: Option<&mut Notes>,
) -> BusResult<()> {
    let old = u32::from_le_bytes(read(client, at)?);
    if old == value {
        return Ok(());
    }
    access(client, WRITE, at, value.to_le_bytes())?;
    let now = u32::from_le_bytes(read(client, at)?);
    client.verify(at.1, now, value)?;
    if let Some(notes) = notes {
        let servo = client.bus.id_of(client.index);
        notes.push(format!("{servo}: {} changed from {old} to {value}", at.1));
    }
    Ok(())
}

/// How much of the gains a command may have, 0 to 1, so that the torque that it
/// asks for where the motor stood last stays within the limit.
fn gain_share(motor: &MotorSettings, goal_rad: f64, status: &MotorStatus) -> f64 {
    let error_rad = goal_rad - status.position_rad;
    let asked_nm = motor.kp * error_rad - motor.kd * status.velocity_rad_s;
    (motor.torque_limit_nm / asked_nm.abs()).min(1.0)
}

/// The eight bytes of a command to go to `joint_rad`, with gains that keep the torque limit.
pub(crate) fn limited_command(
    servo: &Servo,
    motor: &MotorSettings,
    joint_rad: f64,
    status: &MotorStatus,
) -> [u8; 8] {
    let model = &motor.model;
    let position = position_code(servo, model.position_rad, joint_rad);
    let share = gain_share(motor, from_code(position, model.position_rad, 16), status);
    // Downwards: the limit is not passed by rounding either.
    let gain = |code: u32| (f64::from(code) * share) as u32;
    pack_command([
        position,
        to_code(0.0, model.velocity_rad_s, 12),
        gain(span_code(motor.kp, model.kp_max, 12)),
        gain(span_code(motor.kd, model.kd_max, 12)),
        to_code(0.0, model.torque_nm, 12),
    ])
}

/// Goes to `joint_rad` by the motor's own loops.
fn position_velocity_command(servo: &Servo, motor: &MotorSettings, joint_rad: f64) -> CanFrame {
    let limits = &servo.limits;
    let motor_rad = servo.motor_rad(joint_rad.clamp(limits.lower_rad, limits.upper_rad));
    let fastest = (HEADROOM * limits.velocity_rad_s).min(motor.model.velocity_rad_s);
    let [[a, b, c, d], [e, f, g, h]] = [motor_rad, fastest].map(|v| (v as f32).to_le_bytes());
    let id = POSITION_VELOCITY + u32::from(servo.id);
    CanFrame::standard(id, &[a, b, c, d, e, f, g, h])
}

impl Mit {
    fn set_up_damiao(
        client: &mut MotorClient,
        model: MotorModel,
        notes: &mut Notes,
    ) -> BusResult<()> {
        for (at, wanted) in
            [(PMAX, model.position_rad), (VMAX, model.velocity_rad_s), (TMAX, model.torque_nm)]
        {
            let actual = f32::from_le_bytes(read(client, at)?);
            client.verify_f32(at.1, f64::from(actual), wanted)?;
        }
        let reply_id = settings(client.servo()).map_or(0, |motor| u32::from(motor.reply_id));
        let actual = u32::from_le_bytes(read(client, REPLY_ID)?);
        client.verify(REPLY_ID.1, actual, reply_id)?;
        if model.own_loops {
            let limit_nm = settings(client.servo()).map_or(0.0, |motor| motor.torque_limit_nm);
            if limit_nm < model.torque_nm {
                let wanted =
                    format!("left out: {} keeps none but its own", client.servo().model.name);
                return Err(client.unfit("torque_limit_nm", limit_nm, wanted));
            }
        }
        let mode = if model.own_loops { POSITION_VELOCITY_MODE } else { MIT_MODE };
        set(client, MODE, mode, Some(notes))?;
        let timeout = client.config().watchdog_ms * TIMEOUT_UNITS_PER_MS;
        set(client, TIMEOUT, timeout, None)
    }
}

impl CanFamily for Mit {
    fn models(&self) -> &'static [ServoModel] {
        models::MODELS
    }

    fn cycle_frames(&self) -> CycleFrames {
        CycleFrames::new(false, &[], &[8, 8])
    }

    fn torque_off(&self, client: &mut MotorClient) -> BusResult<MotorStatus> {
        let has_registers = settings(client.servo()).is_some_and(|motor| motor.model.has_registers);
        let ask = |client: &mut MotorClient, last| {
            let request = mode_command(client.servo(), last);
            client.ask(&request, "torque off", |servo, frame| {
                let status = parse_reply(servo, frame)?;
                // A reply that was under way before still shows torque on.
                (!has_registers || !status.active).then_some(Ok(status))
            })
        };
        let mut status = ask(client, DISABLE)?;
        // A time-out before this program began is cleared.
        let fault = status.fault.as_deref().unwrap_or_default();
        if fault.starts_with(LOST) {
            status = ask(client, CLEAR)?;
        }
        status.active = false;
        Ok(status)
    }

    fn set_up(&self, client: &mut MotorClient, notes: &mut Notes) -> BusResult<()> {
        let Some(model) = settings(client.servo()).map(|motor| motor.model) else {
            return Ok(());
        };
        if model.has_registers {
            return Self::set_up_damiao(client, model, notes);
        }
        let name = client.servo().model.name;
        let note = client.without_watchdog(format!("{name} has no watchdog in MIT mode"))?;
        notes.push(format!("{note}; its ranges cannot be read and are believed"));
        Ok(())
    }

    fn torque_on(&self, client: &mut MotorClient, motor_rad: f64) -> BusResult<()> {
        let servo = client.servo().clone();
        let on = mode_command(&servo, ENABLE);
        client.ask(&on, "torque on", |servo, frame| {
            let status = parse_reply(servo, frame)?;
            match status.fault {
                Some(fault) => Some(Err(fault)),
                None => status.active.then_some(Ok(())),
            }
        })?;
        // Until its first command the motor is on without torque.
        let mut hold = Vec::with_capacity(1);
        let here = MotorStatus { position_rad: motor_rad, ..MotorStatus::default() };
        self.target_frames(client.config(), &servo, servo.joint_rad(motor_rad), &here, &mut hold);
        for frame in &hold {
            client.ask(frame, "hold position", |servo, frame| {
                parse_reply(servo, frame).map(|_| Ok(()))
            })?;
        }
        Ok(())
    }

    fn read_health(&self, client: &mut MotorClient, status: &MotorStatus) -> BusResult<Health> {
        let motor = settings(client.servo());
        let limit = match motor.is_some_and(|motor| motor.model.has_registers) {
            true => {
                let limit = read(client, OVER_TEMPERATURE);
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

    fn torque_off_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(mode_command(servo, DISABLE));
    }

    fn target_frames(
        &self,
        _: &BusConfig,
        servo: &Servo,
        joint_rad: f64,
        status: &MotorStatus,
        out: &mut Vec<CanFrame>,
    ) {
        let Some(motor) = settings(servo) else {
            return;
        };
        out.push(match motor.model.own_loops {
            true => position_velocity_command(servo, motor, joint_rad),
            false => {
                let data = limited_command(servo, motor, joint_rad, status);
                CanFrame::standard(u32::from(servo.id), &data)
            }
        });
    }

    fn parse_frame(
        &self,
        servos: &[Servo],
        frame: &CanFrame,
        status: &mut [MotorStatus],
    ) -> Option<usize> {
        let faults = servos.iter().enumerate();
        let faults = faults.filter_map(|(index, servo)| Some((index, parse_faults(servo, frame)?)));
        for (index, fault) in faults {
            status[index].fault = fault;
        }
        let mut replies = servos.iter().map(|servo| parse_reply(servo, frame));
        let index = replies.position(|reply| reply.is_some())?;
        let told = parse_reply(&servos[index], frame)?;
        let is_silent = settings(&servos[index]).is_some_and(|motor| motor.model.tells_tenths);
        // What was asked for stays until it is asked again.
        let fault = if is_silent { status[index].fault.take() } else { told.fault };
        status[index] = MotorStatus { fault, ..told };
        Some(index)
    }

    fn watch_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        if settings(servo).is_some_and(|motor| motor.model.tells_tenths) {
            let ask = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0, CLEAR];
            out.push(CanFrame::standard(u32::from(servo.id), &ask));
        }
    }

    fn id_setting(&self, model: &ServoModel) -> IdSetting {
        match model.motor.is_some_and(|motor| motor.has_registers) {
            true => IdSetting::OfOne,
            false => IdSetting::Vendor,
        }
    }

    fn id_frames(
        &self,
        _: &mut ScanLink,
        from: u8,
        servo: &Servo,
    ) -> io::Result<Option<Vec<CanFrame>>> {
        let Some(motor) = settings(servo).filter(|motor| motor.model.has_registers) else {
            return Ok(None);
        };
        let write = |to: u8, at: MitRegister, value: u16| {
            let [low, high] = value.to_le_bytes();
            CanFrame::standard(REGISTER_ID, &[to, 0, WRITE, at.0, low, high, 0, 0])
        };
        let save = CanFrame::standard(REGISTER_ID, &[servo.id, 0, SAVE, 1, 0, 0, 0, 0]);
        // Its own id last: until then it listens to the old one.
        let ids = [
            write(from, REPLY_ID, motor.reply_id),
            write(from, MOTOR_ID, u16::from(servo.id)),
            save,
        ];
        Ok(Some(ids.to_vec()))
    }

    fn scan(&self, scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
        match scanner.may_send_standard {
            true => scan::damiao_motors(scanner),
            false => Ok(Vec::new()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_shrink_to_the_torque_limit_and_not_before() {
        let motor = MotorSettings {
            model: crate::ServoModel::from_name("DM-J4310").unwrap().motor.unwrap(),
            kp: 20.0,
            kd: 0.5,
            torque_limit_nm: 2.0,
            gear_ratio: 1.0,
            reply_id: 0,
            counts_per_turn: 1.0,
        };
        let at = |position_rad, velocity_rad_s| MotorStatus {
            position_rad,
            velocity_rad_s,
            ..MotorStatus::default()
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
}
