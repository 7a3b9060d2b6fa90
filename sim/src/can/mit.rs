//! Simulated motors in MIT mode: CubeMars, and Damiao with its registers.
//!
//! The firmware truncates nothing and rounds nothing on receipt: a code is the
//! point of the range that it stands for.

use servodance_drivers::can::CanFrame;

use crate::can::core::{Command, Core, Trouble};
use crate::can::net::Device;

/// Damiao's registers that are kept: number and whether it is an f32.
const REGISTERS: usize = 37;
const REGISTER_ID: u32 = 0x7FF;

mod at {
    pub const UNDER_VOLTAGE: usize = 0;
    pub const OVER_TEMPERATURE: usize = 2;
    pub const REPLY_ID: usize = 7;
    pub const ID: usize = 8;
    pub const TIMEOUT: usize = 9;
    pub const MODE: usize = 10;
    pub const SOFTWARE: usize = 14;
    pub const PMAX: usize = 21;
    pub const VMAX: usize = 22;
    pub const TMAX: usize = 23;
    pub const OVER_VOLTAGE: usize = 29;
}

/// One motor.
#[derive(Debug)]
pub struct MitMotor {
    core: Core,
    /// `None` for CubeMars.
    registers: Option<[[u8; 4]; REGISTERS]>,
}

impl MitMotor {
    /// A motor fresh from the factory but for its ids.
    pub fn new(core: Core) -> Self {
        let mut motor = Self {
            registers: core
                .settings
                .model
                .has_registers
                .then_some([[0; 4]; REGISTERS]),
            core,
        };
        motor.restart();
        motor
    }

    fn reply_id(&self) -> u32 {
        u32::from(self.core.settings.reply_id)
    }

    /// The reply to every command and mode command.
    fn feedback(&self) -> CanFrame {
        let core = &self.core;
        let model = &core.settings.model;
        let p = code(core.angle_rad(), model.position_rad, 16);
        let v = code(core.speed_rad_s(), model.velocity_rad_s, 12);
        let t = code(core.torque_nm(), model.torque_nm, 12);
        let celsius = core.temperature_c().round().clamp(0.0, 255.0) as u8;
        let (first, sixth, seventh) = match self.registers {
            Some(_) => (core.id & 0xF | self.damiao_state() << 4, celsius, celsius),
            None => (core.id, celsius, self.cubemars_error()),
        };
        let id = match (self.registers, self.reply_id()) {
            (None, 0) => u32::from(core.id),
            (_, reply_id) => reply_id,
        };
        let data = [
            first,
            (p >> 8) as u8,
            p as u8,
            (v >> 4) as u8,
            ((v & 0xF) << 4 | t >> 8) as u8,
            t as u8,
            sixth,
            seventh,
        ];
        CanFrame::standard(id, &data)
    }

    fn damiao_state(&self) -> u8 {
        match self.core.trouble {
            None => u8::from(self.core.enabled()),
            Some(Trouble::OverVoltage) => 8,
            Some(Trouble::UnderVoltage) => 9,
            Some(Trouble::Overheat) => 0xC,
            Some(Trouble::CommunicationLost) => 0xD,
            Some(Trouble::Overload) => 0xE,
        }
    }

    fn cubemars_error(&self) -> u8 {
        match self.core.trouble {
            None | Some(Trouble::CommunicationLost) => 0,
            Some(Trouble::Overheat) => 1,
            Some(Trouble::OverVoltage) => 3,
            Some(Trouble::UnderVoltage) => 4,
            Some(Trouble::Overload) => 7,
        }
    }

    fn mode_command(&mut self, last: u8) {
        match last {
            0xFB => self.core.clear(),
            0xFC => self.core.enable(),
            0xFD => self.core.disable(),
            // FE: set zero. The joint would move in its limits: not simulated.
            _ => {}
        }
    }

    fn command(&mut self, data: [u8; 8]) {
        let model = self.core.settings.model;
        let [b0, b1, b2, b3, b4, b5, b6, b7] = data.map(u32::from);
        let value = |code: u32, range: f64, bits: u32| {
            f64::from(code) / f64::from((1u32 << bits) - 1) * 2.0 * range - range
        };
        let gain = |code: u32, most: f64| f64::from(code) / 4095.0 * most;
        self.core.command(Command {
            goal_rad: value(b0 << 8 | b1, model.position_rad, 16),
            speed_rad_s: value(b2 << 4 | b3 >> 4, model.velocity_rad_s, 12),
            kp: gain((b3 & 0xF) << 8 | b4, model.kp_max),
            kd: gain(b5 << 4 | b6 >> 4, model.kd_max),
            torque_nm: value((b6 & 0xF) << 8 | b7, model.torque_nm, 12),
        });
    }

    /// 7FF: id, command, register, value; CC is a question for the feedback.
    fn access(&mut self, data: [u8; 8], out: &mut Vec<CanFrame>) {
        let [low, high, command, which, value @ ..] = data;
        let reply_id = self.reply_id();
        if low != self.core.id || high != 0 {
            return;
        }
        let Some(registers) = &mut self.registers else {
            return;
        };
        if command == 0xCC {
            return out.push(self.feedback());
        }
        let Some(register) = registers.get_mut(usize::from(which)) else {
            return;
        };
        match command {
            0x33 => {}
            0x55 => *register = value,
            _ => return,
        }
        let [a, b, c, d] = *register;
        out.push(CanFrame::standard(
            reply_id,
            &[low, high, command, which, a, b, c, d],
        ));
        self.apply();
    }

    /// What registers mean for the motor.
    fn apply(&mut self) {
        if let Some(registers) = &self.registers {
            let units = u32::from_le_bytes(registers[at::TIMEOUT]);
            self.core.timeout_s = (units > 0).then_some(f64::from(units) * 50e-6);
            self.core.settings.reply_id = u32::from_le_bytes(registers[at::REPLY_ID]) as u16;
        }
    }
}

/// `value` as the nearest code of `bits` over +- `range`.
fn code(value: f64, range: f64, bits: u32) -> u32 {
    let top = f64::from((1u32 << bits) - 1);
    ((value + range) / (2.0 * range) * top)
        .round()
        .clamp(0.0, top) as u32
}

impl Device for MitMotor {
    fn core(&self) -> &Core {
        &self.core
    }

    fn core_mut(&mut self) -> &mut Core {
        &mut self.core
    }

    fn hear(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        let Some(data) = frame.eight().filter(|_| !frame.is_extended()) else {
            return;
        };
        if frame.id() == REGISTER_ID {
            return self.access(data, out);
        }
        if frame.id() != u32::from(self.core.id) {
            return;
        }
        self.core.feed();
        match data {
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last] if last >= 0xFB => {
                self.mode_command(last);
            }
            _ => self.command(data),
        }
        out.push(self.feedback());
    }

    fn restart(&mut self) {
        let Some(registers) = &mut self.registers else {
            return;
        };
        let model = self.core.settings.model;
        let mut put = |at: usize, value: f64| registers[at] = (value as f32).to_le_bytes();
        put(at::PMAX, model.position_rad);
        put(at::VMAX, model.velocity_rad_s);
        put(at::TMAX, model.torque_nm);
        put(at::UNDER_VOLTAGE, 15.0);
        put(at::OVER_VOLTAGE, 32.0);
        put(at::OVER_TEMPERATURE, 100.0);
        let mut put = |at: usize, value: u32| registers[at] = value.to_le_bytes();
        put(at::REPLY_ID, u32::from(self.core.settings.reply_id));
        put(at::ID, u32::from(self.core.id));
        put(at::MODE, 1);
        put(at::SOFTWARE, 0x5014);
        put(at::TIMEOUT, 0);
        self.apply();
    }
}
