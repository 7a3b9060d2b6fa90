//! RobStride motors: their own protocol, 29-bit ids.
//!
//! Operation control (mode 0) is used: position, gains and torque in each command.
//! The torque limit and the time-out (parameter 7028) are written and read back.

mod models;
#[doc(hidden)] // public for the simulated motors alone
pub mod registers;
mod scan;

use std::io;

use crate::can::family::prelude::*;
use crate::can::mit::framing::{from_code, position_code, span_code, to_code};

use self::registers::{
    BUS_VOLTAGE, HOST, MODE, MotorParameter, RUNNING, TIMEOUT, TIMEOUT_UNITS_PER_MS, TORQUE_LIMIT,
    id, message,
};

const VOLTAGE_V: std::ops::RangeInclusive<f64> = 15.0..=60.0;

pub(crate) struct Robstride;

fn frame(message: u32, data16: u32, servo: &Servo, data: &[u8; 8]) -> CanFrame {
    CanFrame::extended(id(message, data16, servo.id.into()), data)
}

/// The names of the six fault bits of a feedback.
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
    let set: Vec<&str> =
        named.filter(|(bit, _)| faults >> bit & 1 == 1).map(|(_, name)| *name).collect();
    (!set.is_empty()).then(|| set.join(", "))
}

/// Type, bits 16 to 23 of the id, and data of a frame of this motor.
fn from_motor(servo: &Servo, frame: &CanFrame) -> Option<(u32, u32, [u8; 8])> {
    let id = frame.id();
    let is_ours = frame.is_extended() && id & 0xFF == HOST && id >> 8 & 0xFF == u32::from(servo.id);
    is_ours.then_some(())?;
    Some((id >> 24, id >> 16 & 0xFF, frame.eight()?))
}

fn parse_feedback(servo: &Servo, frame: &CanFrame) -> Option<MotorStatus> {
    let (kind, bits, data) = from_motor(servo, frame)?;
    let model = servo.motor.as_ref()?.model;
    let word = |at: usize| u32::from(u16::from_be_bytes([data[at], data[at + 1]]));
    (kind == message::FEEDBACK).then(|| MotorStatus {
        position_rad: from_code(word(0), model.position_rad, 16),
        velocity_rad_s: from_code(word(2), model.velocity_rad_s, 16),
        active: bits >> 6 == RUNNING,
        fault: fault_names(bits & 0x3F),
        temperature_c: Some(f64::from(word(6)) * 0.1),
    })
}

fn read(client: &mut MotorClient, at: MotorParameter) -> BusResult<[u8; 4]> {
    let [low, high] = at.0.to_le_bytes();
    let request = frame(message::READ, HOST, client.servo(), &[low, high, 0, 0, 0, 0, 0, 0]);
    client.ask(&request, at.1, |servo, frame| {
        let (kind, refused, data) = from_motor(servo, frame)?;
        let [l, h, _, _, value @ ..] = data;
        if kind != message::READ || [l, h] != [low, high] {
            return None;
        }
        Some(match refused {
            0 => Ok(value),
            code => Err(format!("it does not know this parameter (error {code})")),
        })
    })
}

fn write(client: &mut MotorClient, at: MotorParameter, value: [u8; 4]) -> BusResult<()> {
    let [low, high] = at.0.to_le_bytes();
    let [a, b, c, d] = value;
    let write = frame(message::WRITE, HOST, client.servo(), &[low, high, 0, 0, a, b, c, d]);
    client.ask(&write, at.1, |servo, frame| parse_feedback(servo, frame).map(|_| Ok(())))
}

fn set(client: &mut MotorClient, at: MotorParameter, value: u32) -> BusResult<()> {
    write(client, at, value.to_le_bytes())?;
    let actual = u32::from_le_bytes(read(client, at)?);
    client.verify(at.1, actual, value)
}

fn stop_frame(servo: &Servo) -> CanFrame {
    frame(message::STOP, HOST, servo, &[0; 8])
}

impl CanFamily for Robstride {
    fn models(&self) -> &'static [ServoModel] {
        models::MODELS
    }

    fn cycle_frames(&self) -> CycleFrames {
        CycleFrames::new(true, &[], &[8, 8])
    }

    fn torque_off(&self, client: &mut MotorClient) -> BusResult<MotorStatus> {
        let stop = stop_frame(client.servo());
        client.ask(&stop, "torque off", |servo, frame| {
            let status = parse_feedback(servo, frame)?;
            (!status.active).then_some(Ok(status))
        })
    }

    fn set_up(&self, client: &mut MotorClient, _notes: &mut Notes) -> BusResult<()> {
        let volts = f64::from(f32::from_le_bytes(read(client, BUS_VOLTAGE)?));
        if !VOLTAGE_V.contains(&volts) {
            let wanted = format!("{} to {} V", VOLTAGE_V.start(), VOLTAGE_V.end());
            let actual = format!("{volts:.1} V");
            return Err(client.unfit(BUS_VOLTAGE.1, actual, wanted));
        }
        set(client, MODE, 0)?;
        let motor = client.servo().motor.as_ref();
        let limit_nm = motor.map_or(0.0, |motor| motor.torque_limit_nm);
        let value = (limit_nm as f32).to_le_bytes();
        write(client, TORQUE_LIMIT, value)?;
        let actual = f32::from_le_bytes(read(client, TORQUE_LIMIT)?);
        let name = TORQUE_LIMIT.1;
        client.verify_f32(name, f64::from(actual), limit_nm)?;
        let timeout = client.config().watchdog_ms * TIMEOUT_UNITS_PER_MS;
        set(client, TIMEOUT, timeout)
    }

    fn torque_on(&self, client: &mut MotorClient, motor_rad: f64) -> BusResult<()> {
        let servo = client.servo().clone();
        let on = frame(message::ENABLE, HOST, &servo, &[0; 8]);
        let mut orders = vec![on];
        let joint_rad = servo.joint_rad(motor_rad);
        self.target_frames(
            client.config(),
            &servo,
            joint_rad,
            &MotorStatus::default(),
            &mut orders,
        );
        for order in &orders {
            client.ask(order, "torque on", |servo, frame| {
                let status = parse_feedback(servo, frame)?;
                match status.fault {
                    Some(fault) => Some(Err(fault)),
                    None => status.active.then_some(Ok(())),
                }
            })?;
        }
        Ok(())
    }

    fn torque_off_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(stop_frame(servo));
    }

    fn target_frames(
        &self,
        _: &BusConfig,
        servo: &Servo,
        joint_rad: f64,
        _: &MotorStatus,
        out: &mut Vec<CanFrame>,
    ) {
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
        out.push(frame(message::CONTROL, torque, servo, &data));
    }

    fn parse_frame(
        &self,
        servos: &[Servo],
        frame: &CanFrame,
        status: &mut [MotorStatus],
    ) -> Option<usize> {
        let motor = frame.id() >> 8 & 0xFF;
        let index = servos.iter().position(|servo| u32::from(servo.id) == motor)?;
        let servo = &servos[index];
        if let Some(report) = parse_feedback(servo, frame) {
            status[index] = report;
            return Some(index);
        }
        let (kind, _, data) = from_motor(servo, frame)?;
        let [a, b, c, d, ..] = data;
        let faults = u32::from_le_bytes([a, b, c, d]);
        if kind == message::FAULT && faults != 0 {
            status[index].fault = Some(format!("fault report {faults:08X}"));
        }
        None
    }

    fn id_setting(&self, _: &ServoModel) -> IdSetting {
        IdSetting::OfOne
    }

    fn id_frames(
        &self,
        _: &mut ScanLink,
        from: u8,
        servo: &Servo,
    ) -> io::Result<Option<Vec<CanFrame>>> {
        let to = u32::from(servo.id);
        let set = id(message::SET_ID, to << 8 | HOST, u32::from(from));
        let save = id(message::SAVE, HOST, to);
        Ok(Some(vec![
            CanFrame::extended(set, &[0; 8]),
            CanFrame::extended(save, &[1, 2, 3, 4, 5, 6, 7, 8]),
        ]))
    }

    fn scan(&self, scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
        scan::motors(scanner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_named() {
        assert_eq!(fault_names(0b10_0100).as_deref(), Some("overheating, not calibrated"));
        assert_eq!(fault_names(0), None);
    }
}
