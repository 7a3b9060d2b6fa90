//! Simulated ODrive controllers: CANSimple of firmware 0.6.
//!
//! The loops are those that the controller has: position gain to velocity,
//! velocity gain to torque; the integrator gain is kept and means nothing.

use std::f64::consts::TAU;

use servodance_drivers::can::CanFrame;
use servodance_drivers::can::odrive::registers::{
    ADDRESS, BUS_VOLTAGE, CLEAR_ERRORS, CLOSED_LOOP, CURRENTS, ENCODER, ERROR, ESTOP, HEARTBEAT,
    IDLE, INPUT_POSITION, INPUT_TORQUE, INPUT_VELOCITY, LIMITS, MODES, PASSTHROUGH,
    POSITION_CONTROL, POSITION_GAIN, POWERS, REBOOT, RX_SDO, SET_STATE, TEMPERATURES,
    TORQUE_CONTROL, TORQUES, TX_SDO, VELOCITY_CONTROL, VELOCITY_GAINS, VERSION, id, two_words,
};

use crate::can::motor_core::{MotorCore, TorqueCommand};
use crate::can::net::CanDevice;

const HEARTBEAT_S: f64 = 0.1;
/// Error of an axis that was told to stop at once.
const ESTOP_REQUESTED: u32 = 1 << 25;
/// Phase current for a newton metre of the motor, amperes.
const AMPERES_PER_NM: f64 = 2.0;
/// Endpoints of the simulated firmware's watchdog, as 0.6.10 numbers them: time-out, enable.
pub const WATCHDOG_ENDPOINTS: [u16; 2] = [153, 154];

#[derive(Debug)]
pub(crate) struct OdriveAxis {
    core: MotorCore,
    input_turns: f32,
    /// Turns a second, and newton metres.
    input_velocity: f32,
    input_torque: f32,
    stopped: bool,
    position_gain: f32,
    velocity_gain: f32,
    velocity_limit: f32,
    modes: [u32; 2],
    watchdog_s: f32,
    watchdog_enabled: bool,
    disarm_reason: u32,
    next_heartbeat_s: f64,
    /// The node id that it was made with.
    born_as: u8,
}

impl OdriveAxis {
    /// An axis fresh from the factory but for its node id.
    pub fn new(core: MotorCore) -> Self {
        let mut axis = Self {
            born_as: core.id,
            core,
            input_turns: 0.0,
            input_velocity: 0.0,
            input_torque: 0.0,
            stopped: false,
            position_gain: 0.0,
            velocity_gain: 0.0,
            velocity_limit: 0.0,
            modes: [0; 2],
            watchdog_s: 0.0,
            watchdog_enabled: false,
            disarm_reason: 0,
            next_heartbeat_s: HEARTBEAT_S,
        };
        axis.restart();
        axis
    }

    fn errors(&self) -> u32 {
        let codes = [0, 1 << 9, 1 << 8, 1 << 13, 1 << 12, 1 << 24];
        self.core.fault_code(codes) | if self.stopped { ESTOP_REQUESTED } else { 0 }
    }

    /// Six bytes that no other axis of this bus has.
    fn serial_number(&self) -> [u8; 6] {
        [b's', b'i', b'm', 0, 0, self.born_as]
    }

    /// Turns of the motor for a radian of the joint's axis.
    fn turns_per_rad(&self) -> f64 {
        self.core.settings.gear_ratio / TAU
    }

    /// Torque before the gear, as the controller has it.
    fn motor_nm(&self) -> f64 {
        self.core.torque_nm / self.core.settings.gear_ratio
    }

    fn message(&self, message: u32, data: &[u8]) -> CanFrame {
        CanFrame::standard(id(self.core.id, message), data)
    }

    fn heartbeat(&self) -> CanFrame {
        let state = [IDLE, CLOSED_LOOP][usize::from(self.core.enabled)];
        let [a, b, c, d] = self.errors().to_le_bytes();
        self.message(HEARTBEAT, &[a, b, c, d, state, 0, 0, 0])
    }

    fn answer(&self, message: u32) -> Option<CanFrame> {
        let f = |value: f64| (value as f32).to_le_bytes();
        let core = &self.core;
        let data = match message {
            // Protocol 2, hardware 5.2, firmware 0.6.10.
            VERSION => [2, 5, 2, 0, 0, 6, 10, 0],
            HEARTBEAT => return Some(self.heartbeat()),
            ERROR => two_words(self.errors().to_le_bytes(), self.disarm_reason.to_le_bytes()),
            ENCODER => two_words(
                f(core.angle_rad() * self.turns_per_rad()),
                f(core.speed_rad_s() * self.turns_per_rad()),
            ),
            ADDRESS => {
                let [a, b, c, d, e, g] = self.serial_number();
                [core.id, a, b, c, d, e, g, 0]
            }
            TORQUES => two_words(f(self.motor_nm()), f(self.motor_nm())),
            CURRENTS => {
                let amperes = f(self.motor_nm() * AMPERES_PER_NM);
                two_words(amperes, amperes)
            }
            POWERS => {
                let watts = f(core.torque_nm * core.speed_rad_s());
                two_words(watts, watts)
            }
            TEMPERATURES => {
                two_words(f(core.body.motor.temperature_c), f(core.body.motor.temperature_c))
            }
            BUS_VOLTAGE => two_words(f(core.body.volts()), f(0.0)),
            _ => return None,
        };
        Some(self.message(message, &data))
    }

    /// Position and velocity gain as gains of the joint's axis. Without a position to go to,
    /// the goal is where the axis is.
    fn follow(&mut self) {
        let gear = self.core.settings.gear_ratio;
        let kd = f64::from(self.velocity_gain) * gear * gear / TAU;
        let here = TorqueCommand { goal_rad: self.core.angle_rad(), ..TorqueCommand::default() };
        let speed_rad_s = f64::from(self.input_velocity) / self.turns_per_rad();
        let torque_nm = f64::from(self.input_torque) * gear;
        let command = match self.modes {
            [POSITION_CONTROL, PASSTHROUGH] => TorqueCommand {
                goal_rad: f64::from(self.input_turns) / self.turns_per_rad(),
                kp: kd * f64::from(self.position_gain),
                kd,
                ..here
            },
            [VELOCITY_CONTROL, PASSTHROUGH] => TorqueCommand { speed_rad_s, kd, torque_nm, ..here },
            [TORQUE_CONTROL, PASSTHROUGH] => TorqueCommand { torque_nm, ..here },
            _ => return,
        };
        let numbers = [command.goal_rad, command.speed_rad_s, command.torque_nm];
        if numbers.iter().all(|number| number.is_finite()) {
            self.core.command(command);
        }
    }

    fn request_state(&mut self, state: u32) {
        match u8::try_from(state) {
            Ok(IDLE) => self.core.disable(),
            Ok(CLOSED_LOOP) if !self.stopped => {
                self.core.enable();
                self.follow();
            }
            _ => {}
        }
    }

    fn apply_watchdog(&mut self) {
        let seconds = f64::from(self.watchdog_s);
        let armed = self.watchdog_enabled && seconds > 0.0;
        self.core.timeout_s = armed.then_some(seconds);
    }

    fn access(&mut self, data: [u8; 8], out: &mut Vec<CanFrame>) {
        let [opcode, low, high, _, value @ ..] = data;
        let endpoint = u16::from_le_bytes([low, high]);
        let [timeout, enable] = WATCHDOG_ENDPOINTS;
        if opcode == 1 {
            if endpoint == timeout {
                self.watchdog_s = f32::from_le_bytes(value);
            } else if endpoint == enable {
                self.watchdog_enabled = value[0] != 0;
            }
            self.apply_watchdog();
        } else {
            let value = match endpoint {
                _ if endpoint == timeout => self.watchdog_s.to_le_bytes(),
                _ if endpoint == enable => [u8::from(self.watchdog_enabled), 0, 0, 0],
                _ => return,
            };
            out.push(self.message(TX_SDO, &two_words([0, low, high, 0], value)));
        }
    }
}

fn float(data: &[u8], at: usize) -> Option<f32> {
    let bytes = data.get(at..at + 4)?;
    Some(f32::from_le_bytes(bytes.try_into().ok()?))
}

impl CanDevice for OdriveAxis {
    fn core(&self) -> &MotorCore {
        &self.core
    }

    fn core_mut(&mut self) -> &mut MotorCore {
        &mut self.core
    }

    fn receive(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        let is_ours = !frame.is_extended() && frame.id() >> 5 == u32::from(self.core.id);
        if !is_ours {
            return;
        }
        let command = frame.id() & 0x1F;
        if frame.is_remote() {
            out.extend(self.answer(command));
            return;
        }
        let data = frame.data();
        let word = |at: usize| float(data, at).map(f32::to_bits);
        let was_faulty = self.core.fault;
        match command {
            ESTOP => {
                self.core.disable();
                self.stopped = true;
                self.disarm_reason = ESTOP_REQUESTED;
            }
            // A new node id, if it is meant for this axis alone or for its serial number.
            ADDRESS => {
                let number = data.get(1..7).filter(|number| number.iter().any(|byte| *byte > 0));
                if number.is_none_or(|number| number == self.serial_number()) {
                    self.core.id = data.first().map_or(self.core.id, |id| id & 0x3F);
                }
            }
            INPUT_VELOCITY | INPUT_TORQUE => {
                self.core.silent_s = 0.0;
                let numbers = (float(data, 0), float(data, 4));
                match (command, numbers) {
                    (INPUT_VELOCITY, (Some(velocity), torque)) => {
                        self.input_velocity = velocity;
                        self.input_torque = torque.unwrap_or(0.0);
                    }
                    (_, (Some(torque), _)) => self.input_torque = torque,
                    _ => {}
                }
                self.follow();
            }
            RX_SDO => {
                if let Some(data) = frame.eight() {
                    self.access(data, out);
                }
            }
            SET_STATE => {
                if let Some(state) = word(0) {
                    self.core.silent_s = 0.0;
                    self.request_state(state);
                }
            }
            MODES => {
                if let (Some(control), Some(input)) = (word(0), word(4)) {
                    self.modes = [control, input];
                }
            }
            INPUT_POSITION => {
                if let Some(turns) = float(data, 0) {
                    self.core.silent_s = 0.0;
                    self.input_turns = turns;
                    self.follow();
                }
            }
            LIMITS => self.velocity_limit = float(data, 0).unwrap_or(self.velocity_limit),
            REBOOT => {
                self.core.reboot();
                self.restart();
            }
            CLEAR_ERRORS => {
                self.core.fault = None;
                self.stopped = false;
            }
            POSITION_GAIN => self.position_gain = float(data, 0).unwrap_or(self.position_gain),
            VELOCITY_GAINS => self.velocity_gain = float(data, 0).unwrap_or(self.velocity_gain),
            _ => {}
        }
        if was_faulty.is_some() {
            self.disarm_reason = self.errors();
        }
    }

    fn due(&mut self, out: &mut Vec<CanFrame>) {
        if self.core.body.time_s >= self.next_heartbeat_s {
            self.next_heartbeat_s = self.core.body.time_s + HEARTBEAT_S;
            out.push(self.heartbeat());
        }
    }

    fn restart(&mut self) {
        self.input_turns = (self.core.angle_rad() * self.turns_per_rad()) as f32;
        self.input_velocity = 0.0;
        self.input_torque = 0.0;
        self.stopped = false;
        self.position_gain = 20.0;
        self.velocity_gain = 0.167;
        self.velocity_limit = 10.0;
        self.modes = [POSITION_CONTROL, PASSTHROUGH];
        self.watchdog_s = 0.0;
        self.watchdog_enabled = false;
        self.disarm_reason = 0;
    }
}
