//! Simulated motors in MIT mode: CubeMars, Damiao with its registers, and RobStride switched
//! to it. A Damiao motor heeds the commands of the mode that its register says: MIT,
//! position-velocity or velocity.
//!
//! The firmware truncates nothing and rounds nothing on receipt: a code is the
//! point of the range that it stands for.

use servodance_drivers::can::CanFrame;
use servodance_drivers::can::mit::framing::{
    from_code, from_span_code, pack_reply, unpack_command,
};
use servodance_drivers::can::mit::registers::{
    CLEAR, DISABLE, ENABLE, FIRMWARE, FIRST_MODE_COMMAND, MIT_MODE, MODE, MOTOR_ID, MitRegister,
    OVER_TEMPERATURE, OVER_VOLTAGE, PMAX, POSITION_VELOCITY, POSITION_VELOCITY_MODE, READ, REFRESH,
    REGISTER_COUNT, REGISTER_ID, REPLY_ID, SAVE, SET_ZERO, TIMEOUT, TIMEOUT_UNITS_PER_MS, TMAX,
    UNDER_VOLTAGE, VELOCITY, VELOCITY_MODE, VMAX, WRITE,
};

use crate::can::motor_core::{MotorCore, TorqueCommand};
use crate::can::net::CanDevice;

/// RobStride: the byte before it is the motor's id from now on.
const SET_ID: u8 = 0xFA;

#[derive(Debug)]
pub(crate) struct MitMotor {
    core: MotorCore,
    /// `None` for a CubeMars or RobStride motor.
    registers: Option<[[u8; 4]; REGISTER_COUNT]>,
}

impl MitMotor {
    /// A motor fresh from the factory but for its ids.
    pub fn new(core: MotorCore) -> Self {
        let mut motor = Self {
            registers: core.settings.model.has_registers.then_some([[0; 4]; REGISTER_COUNT]),
            core,
        };
        motor.restart();
        motor
    }

    fn reply_id(&self) -> u32 {
        u32::from(self.core.settings.reply_id)
    }

    fn feedback(&self) -> CanFrame {
        let core = &self.core;
        let model = &core.settings.model;
        let p = code(core.angle_rad(), model.position_rad, 16);
        let v = code(core.speed_rad_s(), model.velocity_rad_s, 12);
        let t = code(core.torque_nm, model.torque_nm, 12);
        let celsius = core.body.motor.temperature_c.round().clamp(0.0, 255.0) as u8;
        let damiao_state = core.fault_code([u8::from(core.enabled), 9, 8, 0xC, 0xE, 0xD]);
        let tenths = (core.body.motor.temperature_c * 10.0).round().clamp(0.0, 65_535.0) as u16;
        let [tenths_high, tenths_low] = tenths.to_be_bytes();
        let (first, sixth, seventh) = match self.registers {
            Some(_) => (core.id & 0xF | damiao_state << 4, celsius, celsius),
            None if model.tells_tenths => (core.id, tenths_high, tenths_low),
            None => (core.id, celsius, core.fault_code([0, 4, 3, 1, 7, 0])),
        };
        let id = match (self.registers, self.reply_id()) {
            (None, 0) if !model.tells_tenths => u32::from(core.id),
            (_, reply_id) => reply_id,
        };
        let [b1, b2, b3, b4, b5] = pack_reply([p, v, t]);
        let data = [first, b1, b2, b3, b4, b5, sixth, seventh];
        CanFrame::standard(id, &data)
    }

    fn mode_command(&mut self, last: u8) {
        match last {
            CLEAR => self.core.fault = None,
            ENABLE => self.core.enable(),
            DISABLE => self.core.disable(),
            SET_ZERO => self.core.set_zero(),
            _ => {}
        }
    }

    /// A RobStride motor's fault word.
    fn fault_report(&self) -> CanFrame {
        let faults: u32 = self.core.fault_code([0, 1 << 2, 1 << 3, 1, 1 << 14, 0]);
        let [a, b, c, d] = faults.to_le_bytes();
        CanFrame::standard(self.reply_id(), &[self.core.id, a, b, c, d, 0, 0, 0])
    }

    /// What only RobStride motors know: another id, and the question for faults. `None` where
    /// it is something else.
    fn robstride_command(&mut self, argument: u8, last: u8) -> Option<CanFrame> {
        if !self.core.settings.model.tells_tenths || argument == 0xFF {
            return None;
        }
        let unique = [b's', b'i', b'm', 0, 0, 0, 0, self.core.id];
        Some(match last {
            CLEAR => self.fault_report(),
            SET_ID => {
                self.core.id = argument;
                CanFrame::standard(u32::from(argument), &unique)
            }
            // The mode: that of this protocol is simulated, others are confirmed alone.
            ENABLE => self.feedback(),
            _ => return None,
        })
    }

    /// What is added to the motor's id in commands of its mode.
    fn mode_offset(&self) -> u32 {
        let mode = self.registers.map(|kept| u32::from_le_bytes(kept[usize::from(MODE.0)]));
        match mode {
            Some(POSITION_VELOCITY_MODE) => POSITION_VELOCITY,
            Some(VELOCITY_MODE) => VELOCITY,
            _ => 0,
        }
    }

    /// A command of a mode in which the motor's own loops move it. What is no number is not
    /// heeded.
    fn own_loops(&mut self, offset: u32, data: &[u8]) {
        let float = |at: usize| {
            let bytes: Option<[u8; 4]> = data.get(at..at + 4).and_then(|b| b.try_into().ok());
            bytes.map(|bytes| f64::from(f32::from_le_bytes(bytes))).filter(|v| v.is_finite())
        };
        let (kp, kd) = (self.core.settings.kp, self.core.settings.kd);
        let fastest = self.core.settings.model.velocity_rad_s;
        let here = TorqueCommand { goal_rad: self.core.angle_rad(), ..TorqueCommand::default() };
        let command = match (offset, float(0), float(4)) {
            (POSITION_VELOCITY, Some(goal_rad), Some(speed)) => TorqueCommand {
                goal_rad,
                kp,
                kd,
                ramp_rad_s: Some(speed.abs().min(fastest)),
                ..here
            },
            (VELOCITY, Some(speed), _) => {
                TorqueCommand { speed_rad_s: speed.clamp(-fastest, fastest), kd, ..here }
            }
            _ => return,
        };
        self.core.command(command);
    }

    fn command(&mut self, data: [u8; 8]) {
        let model = self.core.settings.model;
        let [p, v, kp, kd, torque] = unpack_command(data);
        self.core.command(TorqueCommand {
            goal_rad: from_code(p, model.position_rad, 16),
            speed_rad_s: from_code(v, model.velocity_rad_s, 12),
            kp: from_span_code(kp, model.kp_max, 12),
            kd: from_span_code(kd, model.kd_max, 12),
            torque_nm: from_code(torque, model.torque_nm, 12),
            ramp_rad_s: None,
        });
    }

    fn access(&mut self, data: [u8; 8], out: &mut Vec<CanFrame>) {
        let [low, high, command, which, value @ ..] = data;
        let reply_id = self.reply_id();
        if low != self.core.id || high != 0 {
            return;
        }
        let Some(registers) = &mut self.registers else {
            return;
        };
        if command == REFRESH {
            return out.push(self.feedback());
        }
        let Some(register) = registers.get_mut(usize::from(which)) else {
            return;
        };
        match command {
            READ => {}
            WRITE => *register = value,
            SAVE => {}
            _ => return,
        }
        let [a, b, c, d] = *register;
        out.push(CanFrame::standard(reply_id, &[low, high, command, which, a, b, c, d]));
        self.apply();
    }

    fn apply(&mut self) {
        if let Some(registers) = &self.registers {
            let units = u32::from_le_bytes(registers[usize::from(TIMEOUT.0)]);
            self.core.timeout_s =
                (units > 0).then_some(f64::from(units) * 1e-3 / f64::from(TIMEOUT_UNITS_PER_MS));
            self.core.settings.reply_id =
                u32::from_le_bytes(registers[usize::from(REPLY_ID.0)]) as u16;
            self.core.id = registers[usize::from(MOTOR_ID.0)][0];
        }
    }
}

/// `value` as the nearest code of `bits` over +- `range`. The firmware rounds halves up,
/// other than the driver.
pub(super) fn code(value: f64, range: f64, bits: u32) -> u32 {
    let top = f64::from((1u32 << bits) - 1);
    ((value + range) / (2.0 * range) * top).round().clamp(0.0, top) as u32
}

impl CanDevice for MitMotor {
    fn core(&self) -> &MotorCore {
        &self.core
    }

    fn core_mut(&mut self) -> &mut MotorCore {
        &mut self.core
    }

    fn receive(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if frame.is_extended() {
            return;
        }
        let offset = self.mode_offset();
        if offset != 0 && frame.id() == offset + u32::from(self.core.id) {
            self.core.silent_s = 0.0;
            self.own_loops(offset, frame.data());
            return out.push(self.feedback());
        }
        let Some(data) = frame.eight() else { return };
        if frame.id() == REGISTER_ID {
            return self.access(data, out);
        }
        if frame.id() != u32::from(self.core.id) {
            return;
        }
        self.core.silent_s = 0.0;
        if let [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, argument, last] = data
            && let Some(answer) = self.robstride_command(argument, last)
        {
            return out.push(answer);
        }
        match data {
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last] if last >= FIRST_MODE_COMMAND => {
                self.mode_command(last);
            }
            _ if offset == 0 => self.command(data),
            _ => {}
        }
        out.push(self.feedback());
    }

    fn renamed(&mut self) {
        if let Some(registers) = &mut self.registers {
            registers[usize::from(MOTOR_ID.0)] = u32::from(self.core.id).to_le_bytes();
        }
    }

    fn restart(&mut self) {
        let Some(registers) = &mut self.registers else {
            return;
        };
        let model = self.core.settings.model;
        let floats: [(MitRegister, f64); 6] = [
            (PMAX, model.position_rad),
            (VMAX, model.velocity_rad_s),
            (TMAX, model.torque_nm),
            (UNDER_VOLTAGE, 15.0),
            (OVER_VOLTAGE, 32.0),
            (OVER_TEMPERATURE, 100.0),
        ];
        for ((number, _), value) in floats {
            registers[usize::from(number)] = (value as f32).to_le_bytes();
        }
        let numbers: [(MitRegister, u32); 5] = [
            (REPLY_ID, u32::from(self.core.settings.reply_id)),
            (MOTOR_ID, u32::from(self.core.id)),
            (MODE, MIT_MODE),
            (FIRMWARE, 0x5014),
            (TIMEOUT, 0),
        ];
        for ((number, _), value) in numbers {
            registers[usize::from(number)] = value.to_le_bytes();
        }
        self.apply();
    }
}
