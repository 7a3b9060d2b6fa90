//! Simulated moteus controllers: registers in CAN FD frames, position mode with its watchdog.
//!
//! Modes 0, 10, 12 and 15 drive or stop; others are kept and do nothing. A controller that times
//! out lets go (`servo.timeout_mode` 0; as delivered it would damp). The share 1 of its gains is
//! the stock gain of the simulated motor.

use std::f64::consts::TAU;

use servodance_drivers::can::CanFrame;
use servodance_drivers::can::moteus::framing::{Kind, Payload, Said, Saying};
use servodance_drivers::can::moteus::registers::{
    BRAKE, FAULT, FAULTY, FIRMWARE, GOAL_POSITION, GOAL_TORQUE, GOAL_VELOCITY, KD_SCALE, KP_SCALE,
    LAST_GOAL, MAP_VERSION, MODE, MODEL, MOST_TORQUE, MOTOR_TEMPERATURE, MULTIPLEX_ID, POSITION,
    POSITION_MODE, POWER, Q_CURRENT, SERIAL, SET_EXACT, SET_NEAREST, STOPPED, TEMPERATURE,
    TIMED_OUT, TORQUE, VELOCITY, VOLTAGE, WATCHDOG, ZERO_VELOCITY,
};

use crate::can::motor_core::{MotorCore, MotorFault, TorqueCommand};
use crate::can::net::CanDevice;

/// `servo.default_timeout_s`
const OWN_WATCHDOG_S: f64 = 0.1;
const ANSWER: u32 = 0x8000;
const GOALS: usize = (LAST_GOAL - GOAL_POSITION) as usize + 1;

#[derive(Debug)]
pub(crate) struct MoteusController {
    core: MotorCore,
    mode: u8,
    /// The registers from GOAL_POSITION on; NaN is as delivered.
    goals: [f64; GOALS],
    /// Where a velocity without a position has carried the goal, radians, and when, seconds.
    carried: Option<(f64, f64)>,
}

impl MoteusController {
    /// A controller fresh from the factory but for its id.
    pub fn new(core: MotorCore) -> Self {
        Self { core, mode: STOPPED, goals: [f64::NAN; GOALS], carried: None }
    }

    fn shown_mode(&self) -> u8 {
        match self.core.fault {
            Some(MotorFault::CommunicationLost) => TIMED_OUT,
            Some(_) => FAULTY,
            None if self.core.enabled || self.mode != POSITION_MODE => self.mode,
            None => STOPPED,
        }
    }

    fn goal(&self, register: u16, without: f64) -> f64 {
        let value = self.goals[usize::from(register - GOAL_POSITION)];
        if value.is_nan() { without } else { value }
    }

    /// The value of a register; `None` if there is none.
    fn read(&self, register: u16) -> Option<f64> {
        let core = &self.core;
        let celsius = core.body.motor.temperature_c;
        Some(match register {
            MODE => f64::from(self.shown_mode()),
            POSITION | 0x006 => core.angle_rad() / TAU,
            VELOCITY => core.speed_rad_s() / TAU,
            TORQUE | Q_CURRENT => core.torque_nm,
            0x005 => 0.0,
            POWER => core.torque_nm * core.speed_rad_s(),
            VOLTAGE => core.body.volts(),
            TEMPERATURE => celsius,
            MOTOR_TEMPERATURE | 0x00B | 0x00C => 0.0,
            FAULT => core.fault_code([0.0, 40.0, 34.0, 38.0, 33.0, 0.0]),
            GOAL_POSITION..=LAST_GOAL => self.goals[usize::from(register - GOAL_POSITION)],
            MODEL => 0.0,
            FIRMWARE => f64::from(0x00_0105_u32),
            MAP_VERSION => 5.0,
            MULTIPLEX_ID => f64::from(core.id),
            SERIAL..=0x122 => f64::from(register - SERIAL) + f64::from(core.id) * 16.0,
            _ => return None,
        })
    }

    fn write(&mut self, register: u16, value: f64) {
        match register {
            MODE => {
                self.mode = value as u8;
                self.goals = [f64::NAN; GOALS];
            }
            GOAL_POSITION..=LAST_GOAL => {
                self.goals[usize::from(register - GOAL_POSITION)] = value;
            }
            MULTIPLEX_ID if (1.0..=127.0).contains(&value) => self.core.id = value as u8,
            SET_NEAREST | SET_EXACT if value == 0.0 => self.core.set_zero(),
            _ => {}
        }
    }

    /// Does what the mode and its registers say.
    fn apply(&mut self) {
        self.core.silent_s = 0.0;
        if self.mode == STOPPED {
            self.core.fault = None;
            self.carried = None;
            return self.core.disable();
        }
        if self.core.fault.is_some() {
            return;
        }
        let (kp, kd) = (self.core.settings.kp, self.core.settings.kd);
        let here = TorqueCommand { goal_rad: self.core.angle_rad(), ..TorqueCommand::default() };
        let turns = self.goal(GOAL_POSITION, f64::NAN);
        let speed_rad_s = self.goal(GOAL_VELOCITY, 0.0) * TAU;
        let now_s = self.core.body.time_s;
        let (last_rad, last_s) = self.carried.unwrap_or((here.goal_rad, now_s));
        let goal_rad = match turns.is_nan() {
            true => last_rad + speed_rad_s * (now_s - last_s),
            false => turns * TAU,
        };
        self.carried = Some((goal_rad, now_s));
        let command = match self.mode {
            POSITION_MODE => TorqueCommand {
                goal_rad,
                speed_rad_s,
                kp: kp * self.goal(KP_SCALE, 1.0),
                kd: kd * self.goal(KD_SCALE, 1.0),
                torque_nm: self.goal(GOAL_TORQUE, 0.0),
                ramp_rad_s: None,
            },
            ZERO_VELOCITY | BRAKE => TorqueCommand { kd, ..here },
            _ => return,
        };
        let most_nm = self.core.settings.model.torque_nm;
        self.core.torque_limit_nm = self.goal(MOST_TORQUE, most_nm).clamp(0.0, most_nm);
        let watchdog_s = self.goal(WATCHDOG, OWN_WATCHDOG_S);
        self.core.timeout_s = (watchdog_s > 0.0).then_some(watchdog_s);
        self.core.enable();
        self.core.command(command);
    }

    fn reply(&self, payload: Payload, kind: Kind, register: u16, count: u16) -> Payload {
        let registers = register..register.saturating_add(count);
        let values: Option<Vec<f64>> = registers.map(|register| self.read(register)).collect();
        match values {
            Some(values) => payload.reply(kind, register, &values),
            None => payload.read_error(register),
        }
    }
}

impl CanDevice for MoteusController {
    fn core(&self) -> &MotorCore {
        &self.core
    }

    fn core_mut(&mut self) -> &mut MotorCore {
        &mut self.core
    }

    fn receive(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        let is_ours = frame.is_flexible() && frame.id() & 0x7F == u32::from(self.core.id);
        if !is_ours {
            return;
        }
        let mut commanded = false;
        let said: Vec<Said> = Saying::of(frame.data()).collect();
        for said in &said {
            if let Said::Write { register, value } = *said {
                commanded |= register <= LAST_GOAL;
                self.write(register, value);
            }
        }
        if commanded {
            self.apply();
        }
        let mut answer = Payload::default();
        for said in &said {
            if let Said::Read { register, kind, count } = *said {
                answer = self.reply(answer, kind, register, count);
            }
        }
        if frame.id() & ANSWER != 0 {
            let host = frame.id() >> 8 & 0x7F;
            out.push(answer.frame(u32::from(self.core.id) << 8 | host));
        }
    }

    fn restart(&mut self) {
        self.mode = STOPPED;
        self.goals = [f64::NAN; GOALS];
    }
}
