//! ODrive controllers: CANSimple of firmware 0.6, 11-bit ids `node << 5 | command`.
//!
//! A cycle sends an input position and asks for the encoder estimates with a
//! remote frame, so that states come when they are wanted, whatever rates are
//! set in the controller. Errors and the axis state come with the heartbeat,
//! ten times a second.
//!
//! The gains of the robot file become the controller's: damping is the velocity
//! gain, `kp / kd` the position gain, and there is no integrator. The watchdog
//! has no message of its own: it is set and read back as two parameters whose
//! numbers belong to the firmware (`watchdog_endpoints` in the bus table).
//! CANSimple can write velocity limit and gains but not read them back.

use std::f64::consts::TAU;

use crate::bus::Health;
use crate::can::exchange::{Exchange, Status};
use crate::can::frame::CanFrame;
use crate::can::motor::MotorSettings;
use crate::can::protocol::Protocol;
use crate::error::BusError;
use crate::servo::Servo;

mod command {
    pub const VERSION: u32 = 0x00;
    pub const HEARTBEAT: u32 = 0x01;
    pub const ERROR: u32 = 0x03;
    pub const RX_SDO: u32 = 0x04;
    pub const TX_SDO: u32 = 0x05;
    pub const SET_STATE: u32 = 0x07;
    pub const ENCODER: u32 = 0x09;
    pub const MODES: u32 = 0x0B;
    pub const INPUT_POSITION: u32 = 0x0C;
    pub const LIMITS: u32 = 0x0F;
    pub const TEMPERATURES: u32 = 0x15;
    pub const CLEAR_ERRORS: u32 = 0x18;
    pub const POSITION_GAIN: u32 = 0x1A;
    pub const VELOCITY_GAINS: u32 = 0x1B;
}

const IDLE: u32 = 1;
const CLOSED_LOOP: u8 = 8;
const POSITION_CONTROL: u32 = 3;
const PASSTHROUGH: u32 = 1;
/// The firmware this speaks to.
const FIRMWARE: (u8, u8) = (0, 6);
/// How much faster than the joint's limit the controller may turn.
const VELOCITY_MARGIN: f64 = 1.5;
/// Phase current that one newton metre of the motor's range stands for.
const AMPERES_PER_NM: f64 = 2.0;

/// ODrive.
pub(crate) struct Odrive;

fn id(servo: &Servo, command: u32) -> u32 {
    u32::from(servo.id) << 5 | command
}

fn order(servo: &Servo, command: u32, data: &[u8]) -> CanFrame {
    CanFrame::standard(id(servo, command), data)
}

fn question(servo: &Servo, command: u32) -> CanFrame {
    CanFrame::remote(id(servo, command), 8)
}

/// Two little-endian words.
fn two(a: [u8; 4], b: [u8; 4]) -> [u8; 8] {
    let mut data = [0; 8];
    data[..4].copy_from_slice(&a);
    data[4..].copy_from_slice(&b);
    data
}

/// The eight bytes of a motor's message.
fn message(servo: &Servo, frame: &CanFrame, command: u32) -> Option<[u8; 8]> {
    let is_ours = !frame.is_extended() && frame.id() == id(servo, command);
    is_ours.then(|| frame.eight()).flatten()
}

fn word(data: &[u8; 8], at: usize) -> [u8; 4] {
    [data[at], data[at + 1], data[at + 2], data[at + 3]]
}

/// What a controller says after its watchdog's time.
const LOST: &str = "watchdog expired";

/// What an error word says.
pub(crate) fn error_names(errors: u32) -> Option<String> {
    const NAMES: [(u32, &str); 22] = [
        (0, "initializing"),
        (1, "system level"),
        (2, "timing error"),
        (3, "missing estimate"),
        (4, "bad configuration"),
        (5, "driver fault"),
        (6, "missing input"),
        (8, "over-voltage"),
        (9, "under-voltage"),
        (10, "over-current of the supply"),
        (11, "too much regeneration current"),
        (12, "current limit violation"),
        (13, "motor overheating"),
        (14, "inverter overheating"),
        (15, "velocity limit violation"),
        (16, "position limit violation"),
        (24, LOST),
        (25, "emergency stop requested"),
        (26, "spinout"),
        (27, "brake resistor disarmed"),
        (28, "thermistor disconnected"),
        (30, "calibration error"),
    ];
    if errors == 0 {
        return None;
    }
    let set = NAMES.iter().filter(|(bit, _)| errors >> bit & 1 == 1);
    let names: Vec<&str> = set.map(|(_, name)| *name).collect();
    Some(format!("{} (error {errors:08X})", names.join(", ")))
}

/// Error and whether the loop is closed, of a heartbeat.
fn parse_heartbeat(data: &[u8; 8]) -> (Option<String>, bool) {
    let errors = u32::from_le_bytes(word(data, 0));
    (error_names(errors), data[4] == CLOSED_LOOP)
}

/// Angle and speed of the joint's axis, of encoder estimates.
fn parse_estimates(motor: &MotorSettings, data: &[u8; 8]) -> Option<(f64, f64)> {
    let turns = |at| f64::from(f32::from_le_bytes(word(data, at))) / motor.gear_ratio * TAU;
    let (position, velocity) = (turns(0), turns(4));
    (position.is_finite() && velocity.is_finite()).then_some((position, velocity))
}

/// Waits for a heartbeat that `accept` likes, asking for it.
fn heartbeat(
    bus: &mut Exchange,
    index: usize,
    doing: &'static str,
    closed: bool,
) -> Result<Option<String>, BusError> {
    let servo = bus.servos[index].clone();
    let ask = question(&servo, command::HEARTBEAT);
    bus.ask(index, &ask, doing, |frame| {
        let (errors, is_closed) = parse_heartbeat(&message(&servo, frame, command::HEARTBEAT)?);
        match errors {
            Some(errors) if closed => Some(Err(errors)),
            errors => (is_closed == closed).then_some(Ok(errors)),
        }
    })
}

fn estimates(bus: &mut Exchange, index: usize) -> Result<(f64, f64), BusError> {
    let servo = bus.servos[index].clone();
    let ask = question(&servo, command::ENCODER);
    bus.ask(index, &ask, "encoder estimates", |frame| {
        let data = message(&servo, frame, command::ENCODER)?;
        let parsed = parse_estimates(servo.motor.as_ref()?, &data);
        Some(parsed.ok_or_else(|| "the position is not a number".into()))
    })
}

/// Writes a parameter of four bytes by its endpoint and reads it back.
fn set_endpoint(
    bus: &mut Exchange,
    index: usize,
    (endpoint, name): (u16, &'static str),
    value: [u8; 4],
) -> Result<(), BusError> {
    let servo = bus.servos[index].clone();
    let [low, high] = endpoint.to_le_bytes();
    let deadline = bus.deadline(1);
    let write = two([1, low, high, 0], value);
    bus.transmit(&order(&servo, command::RX_SDO, &write), deadline, name)?;
    let read = order(&servo, command::RX_SDO, &two([0, low, high, 0], [0; 4]));
    let actual = bus.ask(index, &read, name, |frame| {
        let data = message(&servo, frame, command::TX_SDO)?;
        let is_answer = [data[1], data[2]] == [low, high];
        is_answer.then(|| Ok(word(&data, 4)))
    })?;
    if actual == value {
        return Ok(());
    }
    let hex = |bytes: [u8; 4]| format!("{:08X}", u32::from_le_bytes(bytes));
    Err(bus.unfit(index, name, hex(actual), hex(value)))
}

impl Odrive {
    fn check_firmware(bus: &mut Exchange, index: usize) -> Result<(), BusError> {
        let servo = bus.servos[index].clone();
        let ask = question(&servo, command::VERSION);
        let (major, minor) = bus.ask(index, &ask, "version", |frame| {
            let data = message(&servo, frame, command::VERSION)?;
            Some(Ok((data[4], data[5])))
        })?;
        if (major, minor) == FIRMWARE {
            return Ok(());
        }
        let actual = format!("{major}.{minor}");
        let wanted = format!("{}.{}", FIRMWARE.0, FIRMWARE.1);
        Err(bus.unfit(index, "firmware", actual, wanted))
    }

    fn arm_watchdog(
        bus: &mut Exchange,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        if let Some([timeout, enable]) = bus.config.watchdog_endpoints {
            let seconds = (f64::from(bus.config.watchdog_ms) * 1e-3) as f32;
            let timeout = (timeout, "watchdog_timeout");
            set_endpoint(bus, index, timeout, seconds.to_le_bytes())?;
            return set_endpoint(bus, index, (enable, "enable_watchdog"), [1, 0, 0, 0]);
        }
        if !bus.config.accept_no_watchdog {
            return Err(BusError::NoWatchdog {
                servo: bus.id_of(index),
                why: "the bus table has no watchdog_endpoints (the ids of \
                      axis0.config.watchdog_timeout and axis0.config.enable_watchdog in the \
                      firmware's flat_endpoints.json)"
                    .into(),
            });
        }
        notes.push(format!(
            "{}: no watchdog: without a host it holds its last target",
            bus.id_of(index)
        ));
        Ok(())
    }
}

impl Protocol for Odrive {
    fn release(&self, bus: &mut Exchange, index: usize) -> Result<Status, BusError> {
        let mut frames = Vec::with_capacity(1);
        self.stop(&bus.servos[index], &mut frames);
        let deadline = bus.deadline(1);
        for frame in &frames {
            bus.transmit(frame, deadline, "torque off")?;
        }
        let mut fault = heartbeat(bus, index, "torque off", false)?;
        // Silence before us is no reason to refuse us.
        if fault.as_ref().is_some_and(|fault| fault.starts_with(LOST)) {
            let clear = order(&bus.servos[index], command::CLEAR_ERRORS, &[0]);
            bus.transmit(&clear, deadline, "clearing errors")?;
            fault = heartbeat(bus, index, "torque off", false)?;
        }
        let (position_rad, velocity_rad_s) = estimates(bus, index)?;
        Ok(Status {
            position_rad,
            velocity_rad_s,
            active: false,
            fault,
            temperature_c: None,
        })
    }

    fn prepare(
        &self,
        bus: &mut Exchange,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        Self::check_firmware(bus, index)?;
        let servo = bus.servos[index].clone();
        let Some(motor) = &servo.motor else {
            return Ok(());
        };
        let gear = motor.gear_ratio;
        let fastest = servo.limits.velocity_rad_s * VELOCITY_MARGIN * gear / TAU;
        let current_a = motor.torque_limit_nm / gear * AMPERES_PER_NM;
        // Of the motor's own turns: a radian of the joint is `gear / TAU` turns.
        let position_gain = motor.kp / motor.kd;
        let velocity_gain = motor.kd * TAU / (gear * gear);
        let f = |value: f64| (value as f32).to_le_bytes();
        let u = |value: u32| value.to_le_bytes();
        let deadline = bus.deadline(5);
        for (command, data) in [
            (
                command::MODES,
                two(u(POSITION_CONTROL), u(PASSTHROUGH)).to_vec(),
            ),
            (command::LIMITS, two(f(fastest), f(current_a)).to_vec()),
            (command::POSITION_GAIN, f(position_gain).to_vec()),
            (
                command::VELOCITY_GAINS,
                two(f(velocity_gain), [0; 4]).to_vec(),
            ),
        ] {
            bus.transmit(&order(&servo, command, &data), deadline, "setting up")?;
        }
        let ask = question(&servo, command::ERROR);
        bus.ask(index, &ask, "errors", |frame| {
            let data = message(&servo, frame, command::ERROR)?;
            Some(match error_names(u32::from_le_bytes(word(&data, 0))) {
                Some(errors) => Err(errors),
                None => Ok(()),
            })
        })?;
        Self::arm_watchdog(bus, index, notes)
    }

    fn enable(&self, bus: &mut Exchange, index: usize, motor_rad: f64) -> Result<(), BusError> {
        let servo = bus.servos[index].clone();
        let mut frames = Vec::with_capacity(4);
        // A watchdog that ran out while the axis was idle left an error behind.
        frames.push(order(&servo, command::CLEAR_ERRORS, &[0]));
        let joint_rad = servo.joint_rad(motor_rad);
        self.command(&servo, joint_rad, &Status::default(), &mut frames);
        let state = u32::from(CLOSED_LOOP).to_le_bytes();
        frames.push(order(&servo, command::SET_STATE, &state));
        let deadline = bus.deadline(frames.len());
        for frame in &frames {
            bus.transmit(frame, deadline, "torque on")?;
        }
        heartbeat(bus, index, "torque on", true).map(|_| ())
    }

    fn examine(
        &self,
        bus: &mut Exchange,
        index: usize,
        _status: &Status,
    ) -> Result<Health, BusError> {
        let servo = bus.servos[index].clone();
        let ask = question(&servo, command::TEMPERATURES);
        bus.once(|bus| {
            bus.ask(index, &ask, "temperatures", |frame| {
                let data = message(&servo, frame, command::TEMPERATURES)?;
                // Inverter and motor; a motor without a sensor says NaN.
                let celsius = [0, 4].map(|at| f32::from_le_bytes(word(&data, at)));
                let hottest = celsius.into_iter().filter(|c| c.is_finite());
                Some(Ok(Health {
                    temperature_c: hottest.reduce(f32::max).map(f64::from),
                    ..Health::default()
                }))
            })
        })
    }

    fn stop(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(order(servo, command::SET_STATE, &IDLE.to_le_bytes()));
    }

    fn command(&self, servo: &Servo, joint_rad: f64, _: &Status, out: &mut Vec<CanFrame>) {
        let Some(motor) = &servo.motor else {
            return;
        };
        let joint_rad = servo.limits.clamp_rad(joint_rad);
        let turns = servo.motor_rad(joint_rad) * motor.gear_ratio / TAU;
        let data = two((turns as f32).to_le_bytes(), [0; 4]);
        out.push(order(servo, command::INPUT_POSITION, &data));
        out.push(question(servo, command::ENCODER));
    }

    fn hear(&self, servos: &[Servo], frame: &CanFrame, status: &mut [Status]) -> Option<usize> {
        let node = frame.id() >> 5;
        let index = servos
            .iter()
            .position(|servo| u32::from(servo.id) == node)?;
        let servo = &servos[index];
        if let Some(data) = message(servo, frame, command::ENCODER) {
            let (position, velocity) = parse_estimates(servo.motor.as_ref()?, &data)?;
            status[index].position_rad = position;
            status[index].velocity_rad_s = velocity;
            return Some(index);
        }
        let data = message(servo, frame, command::HEARTBEAT)?;
        (status[index].fault, status[index].active) = parse_heartbeat(&data);
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_named_with_their_number() {
        assert_eq!(
            error_names(1 << 24 | 1 << 13).as_deref(),
            Some("motor overheating, watchdog expired (error 01002000)")
        );
        assert_eq!(error_names(0), None);
    }
}
