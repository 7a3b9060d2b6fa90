//! MyActuator RMD motors (motion protocol V4.2): motion mode, 11-bit ids.
//!
//! Motion mode is MIT mode under other ids: position, gains and torque in each command, and
//! the gains keep `torque_limit_nm` as there. Its answer tells no errors: those are asked for,
//! one motor a cycle.
//!
//! The time-out is written and confirmed; the protocol cannot read it back. A motor whose
//! time-out has passed goes on with the next command as if nothing had been, so that after a
//! silence of its own this side takes every motor on again where it stands, or stops
//! (`CanFamily::forgets_trips`).

#[doc(hidden)] // public for the simulated motors alone
pub mod registers;
mod scan;

use std::io;

use crate::can::family::prelude::*;
use crate::can::mit::framing::{from_code, unpack_reply};
use crate::can::mit::limited_command;

use self::registers::{
    ANGLE, ANSWER, COMMAND, ID_SETTING, MOTION, MOTION_ANSWER, SET_ID, SHUTDOWN, STATUS, TIMEOUT,
    error_names,
};

/// The ranges of motion mode, as the protocol has them for every motor; a robot file can have
/// others.
static MODELS: [ServoModel; 1] = [motor(
    "RMD-V3",
    BusKind::Myactuator,
    MotorModel {
        position_rad: 12.5,
        velocity_rad_s: 45.0,
        torque_nm: 24.0,
        kp_max: 500.0,
        kd_max: 5.0,
        has_registers: true,
        tells_tenths: false,
        own_loops: false,
    },
)];

pub(crate) struct Myactuator;

fn command(servo: &Servo, data: [u8; 8]) -> CanFrame {
    CanFrame::standard(COMMAND + u32::from(servo.id), &data)
}

fn plain(servo: &Servo, which: u8) -> CanFrame {
    command(servo, [which, 0, 0, 0, 0, 0, 0, 0])
}

/// The eight bytes of a motor's answer to a command.
fn answer(servo: &Servo, frame: &CanFrame, which: u8) -> Option<[u8; 8]> {
    let is_ours = !frame.is_extended() && frame.id() == ANSWER + u32::from(servo.id);
    frame.eight().filter(|data| is_ours && data[0] == which)
}

/// What the answer to STATUS tells: errors and temperature.
fn parse_status(data: &[u8; 8]) -> MotorStatus {
    let errors = u16::from_le_bytes([data[6], data[7]]);
    MotorStatus {
        fault: error_names(errors),
        temperature_c: Some(f64::from(data[1] as i8)),
        ..MotorStatus::default()
    }
}

/// Position and velocity in an answer of motion mode.
fn parse_motion(servo: &Servo, frame: &CanFrame) -> Option<(f64, f64)> {
    let model = &servo.motor.as_ref()?.model;
    let is_ours = !frame.is_extended() && frame.id() == MOTION_ANSWER + u32::from(servo.id);
    let data = frame.eight().filter(|data| is_ours && data[0] == servo.id)?;
    let [p, v, _] = unpack_reply(&data)?;
    Some((from_code(p, model.position_rad, 16), from_code(v, model.velocity_rad_s, 12)))
}

/// Asks for something that has no arguments.
fn ask(client: &mut MotorClient, which: u8, doing: &'static str) -> BusResult<[u8; 8]> {
    let request = plain(client.servo(), which);
    client.ask(&request, doing, |servo, frame| answer(servo, frame, which).map(Ok))
}

impl CanFamily for Myactuator {
    fn models(&self) -> &'static [ServoModel] {
        &MODELS
    }

    fn cycle_frames(&self) -> CycleFrames {
        CycleFrames::new(false, &[8, 8], &[8, 8])
    }

    fn torque_off(&self, client: &mut MotorClient) -> BusResult<MotorStatus> {
        ask(client, SHUTDOWN, "torque off")?;
        let hundredths = i32::from_le_bytes(word(&ask(client, ANGLE, "angle")?, 4));
        let status = parse_status(&ask(client, STATUS, "errors")?);
        Ok(MotorStatus { position_rad: (f64::from(hundredths) * 0.01).to_radians(), ..status })
    }

    fn set_up(&self, client: &mut MotorClient, _notes: &mut Notes) -> BusResult<()> {
        let wanted_ms = client.config().watchdog_ms;
        let [a, b, c, d] = wanted_ms.to_le_bytes();
        let write = command(client.servo(), [TIMEOUT, 0, 0, 0, a, b, c, d]);
        let told_ms = client.ask(&write, "time-out", |servo, frame| {
            let data = answer(servo, frame, TIMEOUT)?;
            Some(Ok(u32::from_le_bytes(word(&data, 4))))
        })?;
        // Some firmwares answer with zeros, as an example of the protocol has it.
        client.verify("time-out (B3)", if told_ms == 0 { wanted_ms } else { told_ms }, wanted_ms)
    }

    fn torque_on(&self, client: &mut MotorClient, motor_rad: f64) -> BusResult<()> {
        let servo = client.servo().clone();
        let here = MotorStatus { position_rad: motor_rad, ..MotorStatus::default() };
        let mut hold = Vec::with_capacity(1);
        self.target_frames(client.config(), &servo, servo.joint_rad(motor_rad), &here, &mut hold);
        for frame in &hold {
            client.ask(frame, "torque on", |servo, frame| {
                parse_motion(servo, frame).map(|_| Ok(()))
            })?;
        }
        // A motor with an error answers and does not drive.
        match parse_status(&ask(client, STATUS, "errors")?).fault {
            Some(fault) => Err(client.bus.faulty(client.index, &fault)),
            None => Ok(()),
        }
    }

    fn read_health(&self, client: &mut MotorClient, _status: &MotorStatus) -> BusResult<Health> {
        let data = ask(client, STATUS, "temperature and supply")?;
        Ok(Health {
            temperature_c: parse_status(&data).temperature_c,
            voltage_v: Some(f64::from(u16::from_le_bytes([data[4], data[5]])) * 0.1),
            ..Health::default()
        })
    }

    fn torque_off_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(plain(servo, SHUTDOWN));
    }

    fn target_frames(
        &self,
        _: &BusConfig,
        servo: &Servo,
        joint_rad: f64,
        status: &MotorStatus,
        out: &mut Vec<CanFrame>,
    ) {
        if let Some(motor) = &servo.motor {
            let data = limited_command(servo, motor, joint_rad, status);
            out.push(CanFrame::standard(MOTION + u32::from(servo.id), &data));
        }
    }

    fn watch_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(plain(servo, STATUS));
    }

    fn forgets_trips(&self) -> bool {
        true
    }

    fn parse_frame(
        &self,
        servos: &[Servo],
        frame: &CanFrame,
        status: &mut [MotorStatus],
    ) -> Option<usize> {
        let index = servos.iter().position(|servo| frame.id() & 0x3F == u32::from(servo.id))?;
        let servo = &servos[index];
        if let Some((position_rad, velocity_rad_s)) = parse_motion(servo, frame) {
            let last = std::mem::take(&mut status[index]);
            status[index] = MotorStatus { position_rad, velocity_rad_s, active: true, ..last };
            return Some(index);
        }
        let told = parse_status(&answer(servo, frame, STATUS)?);
        (status[index].fault, status[index].temperature_c) = (told.fault, told.temperature_c);
        None
    }

    fn id_setting(&self, _: &ServoModel) -> IdSetting {
        IdSetting::OfAll
    }

    fn id_frames(
        &self,
        _: &mut ScanLink,
        _from: u8,
        servo: &Servo,
    ) -> io::Result<Option<Vec<CanFrame>>> {
        let set = CanFrame::standard(ID_SETTING, &[SET_ID, 0, 0, 0, 0, 0, 0, servo.id]);
        Ok(Some(vec![set]))
    }

    fn scan(&self, scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
        match scanner.may_send_standard {
            true => scan::motors(scanner),
            false => Ok(Vec::new()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The worked example of the protocol: 9.99 rad, 1.021 rad/s, kp 10.012, kd 1, 10 Nm.
    #[test]
    fn motion_mode_has_its_published_bytes() {
        let servo = crate::servos(&[crate::ServoConfig {
            name: "joint".into(),
            id: 1,
            model: "RMD-V3".into(),
            direction: 1,
            lower_deg: -700.0,
            upper_deg: 700.0,
            velocity_deg_s: 100.0,
            acceleration_deg_s2: 1000.0,
            ..crate::ServoConfig::default()
        }])
        .unwrap()
        .remove(0);
        let answer = CanFrame::standard(0x501, &[1, 0xE6, 0x66, 0x82, 0xEB, 0x55, 0, 0]);
        let (position_rad, velocity_rad_s) = parse_motion(&servo, &answer).unwrap();
        assert!((position_rad - 9.99).abs() < 0.015 && (velocity_rad_s - 1.021).abs() < 0.01);
        let mut out = Vec::new();
        let config = BusConfig::of_kind(BusKind::Myactuator, 1_000_000);
        Myactuator.target_frames(&config, &servo, position_rad, &MotorStatus::default(), &mut out);
        assert_eq!((out[0].id(), &out[0].data()[..2]), (0x401, &[0xE6, 0x66][..]));
        Myactuator.torque_off_frames(&servo, &mut out);
        assert_eq!(format!("{:?}", out[1]), "141#8000000000000000");
    }
}
