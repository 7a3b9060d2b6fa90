//! Simulated RobStride motors.

use servodance_drivers::can::CanFrame;

use crate::can::core::{Command, Core, Trouble};
use crate::can::net::Device;

mod kind {
    pub const GET_ID: u32 = 0;
    pub const CONTROL: u32 = 1;
    pub const FEEDBACK: u32 = 2;
    pub const ENABLE: u32 = 3;
    pub const STOP: u32 = 4;
    pub const READ: u32 = 17;
    pub const WRITE: u32 = 18;
}

/// The parameters that are kept.
const MODE: u16 = 0x7005;
const TORQUE_LIMIT: u16 = 0x700B;
const TIMEOUT: u16 = 0x7028;

/// One motor.
#[derive(Debug)]
pub struct RobstrideMotor {
    core: Core,
    mode: u32,
    timeout_units: u32,
}

impl RobstrideMotor {
    /// A motor fresh from the factory but for its id.
    pub fn new(core: Core) -> Self {
        Self {
            core,
            mode: 0,
            timeout_units: 0,
        }
    }

    fn faults(&self) -> u32 {
        match self.core.trouble {
            None | Some(Trouble::CommunicationLost) => 0,
            Some(Trouble::UnderVoltage | Trouble::OverVoltage) => 1,
            Some(Trouble::Overheat) => 1 << 2,
            Some(Trouble::Overload) => 1 << 4,
        }
    }

    fn feedback(&self, host: u32) -> CanFrame {
        let core = &self.core;
        let model = &core.settings.model;
        let code = |value: f64, range: f64| {
            let share = (value + range) / (2.0 * range);
            (share * 65_535.0).round().clamp(0.0, 65_535.0) as u16
        };
        let words = [
            code(core.angle_rad(), model.position_rad),
            code(core.speed_rad_s(), model.velocity_rad_s),
            code(core.torque_nm(), model.torque_nm),
            (core.temperature_c() * 10.0).round().clamp(0.0, 65_535.0) as u16,
        ];
        let mut data = [0; 8];
        for (pair, word) in data.chunks_exact_mut(2).zip(words) {
            pair.copy_from_slice(&word.to_be_bytes());
        }
        let mode = if core.enabled() { 2 } else { 0 };
        let bits = mode << 22 | self.faults() << 16 | u32::from(core.id) << 8;
        CanFrame::extended(kind::FEEDBACK << 24 | bits | host, &data)
    }

    fn parameter(&self, index: u16) -> Option<[u8; 4]> {
        let f = |value: f64| (value as f32).to_le_bytes();
        Some(match index {
            MODE => self.mode.to_le_bytes(),
            TORQUE_LIMIT => f(self.core.torque_limit_nm),
            0x7016 | 0x7019 => f(self.core.angle_rad()),
            0x701B => f(self.core.speed_rad_s()),
            0x701C => f(self.core.supply_v()),
            TIMEOUT => self.timeout_units.to_le_bytes(),
            _ => return None,
        })
    }

    fn set_parameter(&mut self, index: u16, value: [u8; 4]) {
        match index {
            // The mode changes with torque off only.
            MODE if !self.core.enabled() => self.mode = u32::from_le_bytes(value) & 0xFF,
            TORQUE_LIMIT => {
                let asked_nm = f64::from(f32::from_le_bytes(value));
                let most_nm = self.core.settings.model.torque_nm;
                if asked_nm >= 0.0 {
                    self.core.torque_limit_nm = asked_nm.min(most_nm);
                }
            }
            TIMEOUT => {
                self.timeout_units = u32::from_le_bytes(value);
                let seconds = f64::from(self.timeout_units) / 20_000.0;
                self.core.timeout_s = (seconds > 0.0).then_some(seconds);
            }
            _ => {}
        }
    }

    fn control(&mut self, torque: u32, data: [u8; 8]) {
        let model = self.core.settings.model;
        let word = |at: usize| f64::from(u16::from_be_bytes([data[at], data[at + 1]])) / 65_535.0;
        let around = |share: f64, range: f64| (2.0 * share - 1.0) * range;
        if self.mode != 0 {
            return;
        }
        self.core.command(Command {
            goal_rad: around(word(0), model.position_rad),
            speed_rad_s: around(word(2), model.velocity_rad_s),
            kp: word(4) * model.kp_max,
            kd: word(6) * model.kd_max,
            torque_nm: around(f64::from(torque) / 65_535.0, model.torque_nm),
        });
    }
}

impl Device for RobstrideMotor {
    fn core(&self) -> &Core {
        &self.core
    }

    fn core_mut(&mut self) -> &mut Core {
        &mut self.core
    }

    fn hear(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        let id = frame.id();
        let is_ours = frame.is_extended() && id & 0xFF == u32::from(self.core.id);
        let Some(data) = frame.eight().filter(|_| is_ours) else {
            return;
        };
        self.core.feed();
        let data16 = id >> 8 & 0xFFFF;
        let host = data16 & 0xFF;
        let motor = u32::from(self.core.id);
        let index = u16::from_le_bytes([data[0], data[1]]);
        match id >> 24 {
            kind::GET_ID => {
                let unique = [b's', b'i', b'm', 0, 0, 0, 0, self.core.id];
                out.push(CanFrame::extended(motor << 8 | 0xFE, &unique));
            }
            kind::CONTROL => {
                self.control(data16, data);
                out.push(self.feedback(0xFD));
            }
            kind::ENABLE => {
                self.core.enable();
                out.push(self.feedback(host));
            }
            kind::STOP => {
                self.core.disable();
                if data[0] == 1 {
                    self.core.clear();
                }
                // Silence is no fault here: the motor is stopped already.
                if self.core.trouble == Some(Trouble::CommunicationLost) {
                    self.core.clear();
                }
                out.push(self.feedback(host));
            }
            kind::READ => {
                let value = self.parameter(index);
                let refused = u32::from(value.is_none());
                let [a, b, c, d] = value.unwrap_or_default();
                let answer = [data[0], data[1], 0, 0, a, b, c, d];
                let bits = refused << 16 | motor << 8 | host;
                out.push(CanFrame::extended(kind::READ << 24 | bits, &answer));
            }
            kind::WRITE => {
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
