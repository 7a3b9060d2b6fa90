//! Simulated RobStride motors.

use servodance_drivers::can::CanFrame;
use servodance_drivers::can::mit::framing::{from_code, from_span_code};
use servodance_drivers::can::robstride::registers::{
    BUS_VOLTAGE, EVERY_HOST, HOST, MODE, RUNNING, TIMEOUT, TIMEOUT_UNITS_PER_MS, TORQUE_LIMIT, id,
    message,
};

use crate::can::mit::code;
use crate::can::motor_core::{MotorCore, MotorFault, TorqueCommand};
use crate::can::net::CanDevice;

/// Indices of parameters that are only read: position and speed.
const POSITION: [u16; 2] = [0x7016, 0x7019];
const SPEED: u16 = 0x701B;

#[derive(Debug)]
pub(crate) struct RobstrideMotor {
    core: MotorCore,
    mode: u32,
    timeout_units: u32,
}

impl RobstrideMotor {
    /// A motor fresh from the factory but for its id.
    pub fn new(core: MotorCore) -> Self {
        Self { core, mode: 0, timeout_units: 0 }
    }

    fn feedback(&self, host: u32) -> CanFrame {
        let core = &self.core;
        let model = &core.settings.model;
        let words = [
            code(core.angle_rad(), model.position_rad, 16),
            code(core.speed_rad_s(), model.velocity_rad_s, 16),
            code(core.torque_nm, model.torque_nm, 16),
            (core.body.motor.temperature_c * 10.0).round().clamp(0.0, 65_535.0) as u32,
        ];
        let mut data = [0; 8];
        for (pair, word) in data.chunks_exact_mut(2).zip(words) {
            pair.copy_from_slice(&(word as u16).to_be_bytes());
        }
        let mode = if core.enabled { RUNNING } else { 0 };
        let faults = core.fault_code([0, 1, 1, 1 << 2, 1 << 4, 0]);
        let data16 = mode << 14 | faults << 8 | u32::from(core.id);
        CanFrame::extended(id(message::FEEDBACK, data16, host), &data)
    }

    fn own_id(&self) -> CanFrame {
        let unique = [b's', b'i', b'm', 0, 0, 0, 0, self.core.id];
        let answered = id(message::GET_ID, u32::from(self.core.id), EVERY_HOST);
        CanFrame::extended(answered, &unique)
    }

    fn parameter(&self, index: u16) -> Option<[u8; 4]> {
        let f = |value: f64| (value as f32).to_le_bytes();
        Some(match index {
            _ if index == MODE.0 => self.mode.to_le_bytes(),
            _ if index == TORQUE_LIMIT.0 => f(self.core.torque_limit_nm),
            _ if POSITION.contains(&index) => f(self.core.angle_rad()),
            SPEED => f(self.core.speed_rad_s()),
            _ if index == BUS_VOLTAGE.0 => f(self.core.body.volts()),
            _ if index == TIMEOUT.0 => self.timeout_units.to_le_bytes(),
            _ => return None,
        })
    }

    fn set_parameter(&mut self, index: u16, value: [u8; 4]) {
        if index == MODE.0 && !self.core.enabled {
            self.mode = u32::from_le_bytes(value) & 0xFF;
        } else if index == TORQUE_LIMIT.0 {
            let asked_nm = f64::from(f32::from_le_bytes(value));
            let most_nm = self.core.settings.model.torque_nm;
            if asked_nm >= 0.0 {
                self.core.torque_limit_nm = asked_nm.min(most_nm);
            }
        } else if index == TIMEOUT.0 {
            self.timeout_units = u32::from_le_bytes(value);
            let seconds = f64::from(self.timeout_units) * 1e-3 / f64::from(TIMEOUT_UNITS_PER_MS);
            self.core.timeout_s = (seconds > 0.0).then_some(seconds);
        }
    }

    fn control(&mut self, torque: u32, data: [u8; 8]) {
        let model = self.core.settings.model;
        let word = |at: usize| u32::from(u16::from_be_bytes([data[at], data[at + 1]]));
        if self.mode != 0 {
            return;
        }
        self.core.command(TorqueCommand {
            goal_rad: from_code(word(0), model.position_rad, 16),
            speed_rad_s: from_code(word(2), model.velocity_rad_s, 16),
            kp: from_span_code(word(4), model.kp_max, 16),
            kd: from_span_code(word(6), model.kd_max, 16),
            torque_nm: from_code(torque, model.torque_nm, 16),
            ramp_rad_s: None,
        });
    }
}

impl CanDevice for RobstrideMotor {
    fn core(&self) -> &MotorCore {
        &self.core
    }

    fn core_mut(&mut self) -> &mut MotorCore {
        &mut self.core
    }

    fn receive(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        let frame_id = frame.id();
        let is_ours = frame.is_extended() && frame_id & 0xFF == u32::from(self.core.id);
        let Some(data) = frame.eight().filter(|_| is_ours) else {
            return;
        };
        self.core.silent_s = 0.0;
        let data16 = frame_id >> 8 & 0xFFFF;
        let host = data16 & 0xFF;
        let motor = u32::from(self.core.id);
        let index = u16::from_le_bytes([data[0], data[1]]);
        match frame_id >> 24 {
            message::GET_ID => out.push(self.own_id()),
            message::SET_ID => {
                self.core.id = (data16 >> 8) as u8;
                out.push(self.own_id());
            }
            message::SET_ZERO => {
                if data[0] == 1 {
                    self.core.set_zero();
                }
                out.push(self.feedback(host));
            }
            message::CONTROL => {
                self.control(data16, data);
                out.push(self.feedback(HOST));
            }
            message::ENABLE => {
                self.core.enable();
                out.push(self.feedback(host));
            }
            message::STOP => {
                self.core.disable();
                // Silence is no fault here: the motor is stopped already.
                if data[0] == 1 || self.core.fault == Some(MotorFault::CommunicationLost) {
                    self.core.fault = None;
                }
                out.push(self.feedback(host));
            }
            message::READ => {
                let value = self.parameter(index);
                let refused = u32::from(value.is_none());
                let [a, b, c, d] = value.unwrap_or_default();
                let answer = [data[0], data[1], 0, 0, a, b, c, d];
                let answered = id(message::READ, refused << 8 | motor, host);
                out.push(CanFrame::extended(answered, &answer));
            }
            message::WRITE => {
                self.set_parameter(index, [data[4], data[5], data[6], data[7]]);
                out.push(self.feedback(host));
            }
            _ => {}
        }
    }

    fn restart(&mut self) {
        self.mode = 0;
        self.timeout_units = 0;
    }
}
