//! Simulated MyActuator RMD motors (motion protocol V4.2).
//!
//! Motion mode, speed and position commands drive; position commands go straight to their
//! angle: neither their speed limit nor the planned acceleration is simulated, and current
//! commands are confirmed alone. A motor that its time-out has stopped goes on with the next
//! command, as the protocol has it.

use servodance_drivers::can::CanFrame;
use servodance_drivers::can::mit::framing::{
    from_code, from_span_code, pack_reply, unpack_command,
};
use servodance_drivers::can::myactuator::registers::{
    ANGLE, ANSWER, BRAKE_OPEN, BRAKE_SHUT, COMMAND, EVERYONE, ID_SETTING, LAST_ID, MODE, MODEL,
    MOTION, MOTION_ANSWER, POSITION, RESET, RUN_TIME, SET_ID, SHUTDOWN, SPEED, STATE, STATUS, STOP,
    TIMEOUT, VERSION, ZERO_HERE,
};

use crate::can::mit::code;
use crate::can::motor_core::{MotorCore, MotorFault, TorqueCommand};
use crate::can::net::CanDevice;

const FIRMWARE: u32 = 20_240_501;
/// Phase current for a newton metre, amperes: as the simulated motor has it.
const AMPERES_PER_NM: f64 = 1.0;

#[derive(Debug)]
pub(crate) struct RmdMotor {
    core: MotorCore,
    timeout_ms: u32,
    /// 1 current, 2 speed, 3 position.
    mode: u8,
    brake_open: bool,
    zero_after_reset: bool,
}

impl RmdMotor {
    /// A motor fresh from the factory but for its id.
    pub fn new(core: MotorCore) -> Self {
        Self { core, timeout_ms: 0, mode: 3, brake_open: true, zero_after_reset: false }
    }

    fn errors(&self) -> u16 {
        self.core.fault_code([0, 0x0004, 0x0008, 0x1000, 0x0002, 0])
    }

    fn degrees(&self) -> f64 {
        self.core.angle_rad().to_degrees()
    }

    /// The answer of the commands that drive, and of STATE.
    fn state(&self, which: u8) -> [u8; 8] {
        let short = |value: f64| (value.round() as i16).to_le_bytes();
        let [i0, i1] = short(self.core.torque_nm * AMPERES_PER_NM * 100.0);
        let [v0, v1] = short(self.core.speed_rad_s().to_degrees());
        let [p0, p1] = short(self.degrees());
        [which, self.celsius(), i0, i1, v0, v1, p0, p1]
    }

    fn celsius(&self) -> u8 {
        (self.core.body.motor.temperature_c.round() as i8) as u8
    }

    fn motion_answer(&self) -> CanFrame {
        let (core, model) = (&self.core, &self.core.settings.model);
        let [b1, b2, b3, b4, b5] = pack_reply([
            code(core.angle_rad(), model.position_rad, 16),
            code(core.speed_rad_s(), model.velocity_rad_s, 12),
            code(core.torque_nm, model.torque_nm, 12),
        ]);
        let data = [core.id, b1, b2, b3, b4, b5, 0, 0];
        CanFrame::standard(MOTION_ANSWER + u32::from(core.id), &data)
    }

    fn drive(&mut self, command: TorqueCommand) {
        self.core.enable();
        self.core.command(command);
    }

    fn motion(&mut self, data: [u8; 8]) {
        let model = self.core.settings.model;
        let [p, v, kp, kd, torque] = unpack_command(data);
        self.mode = 1;
        self.drive(TorqueCommand {
            goal_rad: from_code(p, model.position_rad, 16),
            speed_rad_s: from_code(v, model.velocity_rad_s, 12),
            kp: from_span_code(kp, model.kp_max, 12),
            kd: from_span_code(kd, model.kd_max, 12),
            torque_nm: from_code(torque, model.torque_nm, 12),
            ramp_rad_s: None,
        });
    }

    /// A speed or an angle, through loops of its own.
    fn own_loops(&mut self, which: u8, hundredths: i32) {
        let rad = (f64::from(hundredths) * 0.01).to_radians();
        let here = TorqueCommand { goal_rad: self.core.angle_rad(), ..TorqueCommand::default() };
        let (kp, kd) = (self.core.settings.kp, self.core.settings.kd);
        self.mode = if which == POSITION { 3 } else { 2 };
        self.drive(match which {
            POSITION => TorqueCommand { goal_rad: rad, kp, kd, ..here },
            _ => TorqueCommand { speed_rad_s: rad, kd, ..here },
        });
    }

    /// Carries a command out; the data of its answer.
    fn carry_out(&mut self, data: [u8; 8]) -> Option<[u8; 8]> {
        let [which, _, _, _, value @ ..] = data;
        let with = |value: [u8; 4]| {
            let [a, b, c, d] = value;
            [which, 0, 0, 0, a, b, c, d]
        };
        Some(match which {
            SHUTDOWN => {
                self.core.disable();
                data
            }
            STOP => {
                self.own_loops(STOP, 0);
                data
            }
            SPEED | POSITION => {
                self.own_loops(which, i32::from_le_bytes(value));
                self.state(which)
            }
            STATE => self.state(which),
            ANGLE => with(((self.degrees() * 100.0).round() as i32).to_le_bytes()),
            STATUS => {
                let [u0, u1] = ((self.core.body.volts() * 10.0).round() as u16).to_le_bytes();
                let [e0, e1] = self.errors().to_le_bytes();
                [which, self.celsius(), 0, u8::from(self.brake_open), u0, u1, e0, e1]
            }
            MODE => [which, 0, 0, 0, 0, 0, 0, self.mode],
            BRAKE_OPEN | BRAKE_SHUT => {
                self.brake_open = which == BRAKE_OPEN;
                if !self.brake_open {
                    self.core.disable();
                }
                data
            }
            RUN_TIME => with(((self.core.body.time_s * 1e3) as u32).to_le_bytes()),
            VERSION => with(FIRMWARE.to_le_bytes()),
            TIMEOUT => {
                self.timeout_ms = u32::from_le_bytes(value);
                self.apply_timeout();
                data
            }
            MODEL => *b"\xB5X8S2V10",
            ZERO_HERE => {
                self.zero_after_reset = true;
                with([0; 4])
            }
            RESET => {
                self.core.reboot();
                self.restart();
                return None;
            }
            _ => return None,
        })
    }

    fn apply_timeout(&mut self) {
        let timeout_s = f64::from(self.timeout_ms) * 1e-3;
        self.core.timeout_s = (timeout_s > 0.0).then_some(timeout_s);
    }

    /// Reads or writes the id, by a frame that every motor hears.
    fn id_setting(&mut self, data: [u8; 8], out: &mut Vec<CanFrame>) {
        if data[0] != SET_ID {
            return;
        }
        let mut answer = data;
        if data[2] == 1 {
            let [low, high] = (ANSWER as u16 + u16::from(self.core.id)).to_le_bytes();
            (answer[6], answer[7]) = (low, high);
        } else if (1..=LAST_ID).contains(&data[7]) {
            self.core.id = data[7];
        }
        out.push(CanFrame::standard(ID_SETTING, &answer));
    }
}

impl CanDevice for RmdMotor {
    fn core(&self) -> &MotorCore {
        &self.core
    }

    fn core_mut(&mut self) -> &mut MotorCore {
        &mut self.core
    }

    fn receive(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        let Some(data) = frame.eight().filter(|_| !frame.is_extended()) else { return };
        let id = u32::from(self.core.id);
        let which = frame.id();
        if which == ID_SETTING {
            return self.id_setting(data, out);
        }
        if ![COMMAND + id, MOTION + id, EVERYONE].contains(&which) {
            return;
        }
        self.core.silent_s = 0.0;
        if self.core.fault == Some(MotorFault::CommunicationLost) {
            self.core.fault = None;
        }
        if which == MOTION + id {
            self.motion(data);
            out.push(self.motion_answer());
        } else if let Some(answer) = self.carry_out(data) {
            out.push(CanFrame::standard(ANSWER + id, &answer));
        }
    }

    /// The time-out is kept without power.
    fn restart(&mut self) {
        self.mode = 3;
        self.apply_timeout();
        if std::mem::take(&mut self.zero_after_reset) {
            self.core.set_zero();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_drivers::{BusKind, ServoConfig, servos};

    use crate::servo::spec::SimServoSpec;

    fn motor() -> RmdMotor {
        let config = ServoConfig {
            name: "joint".into(),
            id: 1,
            model: "RMD-V3".into(),
            direction: 1,
            lower_deg: -90.0,
            upper_deg: 90.0,
            velocity_deg_s: 200.0,
            acceleration_deg_s2: 2000.0,
            ..ServoConfig::default()
        };
        let spec = SimServoSpec::from(&servos(&[config]).unwrap()[0]);
        assert_eq!(spec.kind, BusKind::Myactuator);
        RmdMotor::new(MotorCore::new(&spec, 48.0, None, 0.01).unwrap())
    }

    /// What the motor answers to these bytes, as the protocol writes both.
    fn answer(motor: &mut RmdMotor, id: u32, data: [u8; 8]) -> Vec<String> {
        let mut out = Vec::new();
        motor.receive(&CanFrame::standard(id, &data), &mut out);
        out.iter().map(|frame| format!("{frame:?}")).collect()
    }

    #[test]
    fn commands_are_answered_as_the_protocol_writes_them() {
        let mut motor = motor();
        for (id, data, wanted) in [
            (0x141, [0x80, 0, 0, 0, 0, 0, 0, 0], "241#8000000000000000"),
            (0x280, [0x80, 0, 0, 0, 0, 0, 0, 0], "241#8000000000000000"),
            (0x141, [0x92, 0, 0, 0, 0, 0, 0, 0], "241#9200000000000000"),
            (0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0], "241#9A190001E0010000"),
            (0x141, [0xB3, 0, 0, 0, 0xE8, 3, 0, 0], "241#B3000000E8030000"),
            (0x141, [0xB5, 0, 0, 0, 0, 0, 0, 0], "241#B558385332563130"),
            (0x300, [0x79, 0, 1, 0, 0, 0, 0, 0], "300#7900010000004102"),
            (0x300, [0x79, 0, 0, 0, 0, 0, 0, 2], "300#7900000000000002"),
        ] {
            assert_eq!(answer(&mut motor, id, data), [wanted], "{id:X}");
        }
        assert_eq!(motor.core.timeout_s, Some(1.0));
        // It has another id now.
        assert!(answer(&mut motor, 0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0]).is_empty());
        let zero = [0x7F, 0xFF, 0x7F, 0xF0, 0, 0, 7, 0xFF];
        assert_eq!(answer(&mut motor, 0x402, zero), ["502#0280008008000000"]);
        assert!(motor.core.enabled);
    }

    #[test]
    fn a_speed_is_driven_and_where_it_ends_may_become_zero() {
        let mut motor = motor();
        let speed = [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]; // 100 degrees a second
        let _ = answer(&mut motor, 0x141, speed);
        (1..=1000).for_each(|step| motor.core.step(f64::from(step) * 5e-4, 5e-4));
        let degrees = motor.degrees();
        assert!((40.0..55.0).contains(&degrees), "{degrees}");
        let _ = answer(&mut motor, 0x141, [0x64, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(motor.degrees(), degrees);
        assert!(answer(&mut motor, 0x141, [0x76, 0, 0, 0, 0, 0, 0, 0]).is_empty());
        assert_eq!(motor.degrees(), 0.0);
        assert!((motor.core.body.motor.angle_rad - degrees.to_radians()).abs() < 1e-9);
    }
}
