//! ODrive controllers: CANSimple of firmware 0.6.
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

mod errors;
#[doc(hidden)] // public for the simulated motors alone
pub mod registers;
mod scan;

use std::f64::consts::TAU;
use std::io;

use crate::can::family::prelude::*;

use self::errors::{LOST, error_names};
use self::registers::{
    ADDRESS, CLEAR_ERRORS, CLOSED_LOOP, ENCODER, ERROR, HEARTBEAT, IDLE, INPUT_POSITION, LIMITS,
    MODES, PASSTHROUGH, POSITION_CONTROL, POSITION_GAIN, REBOOT, RX_SDO, SAVE, SET_STATE,
    TEMPERATURES, TX_SDO, VELOCITY_GAINS, VERSION, id, two_words,
};

const FIRMWARE: (u8, u8) = (0, 6);
const VELOCITY_MARGIN: f64 = 1.5;
/// Phase current that one newton metre of the motor's range stands for.
const AMPERES_PER_NM: f64 = 2.0;

static MODELS: [ServoModel; 1] = [drive("ODrive", BusKind::Odrive)];

pub(crate) struct Odrive;

fn order(servo: &Servo, message: u32, data: &[u8]) -> CanFrame {
    CanFrame::standard(id(servo.id, message), data)
}

fn request(servo: &Servo, message: u32) -> CanFrame {
    CanFrame::remote(id(servo.id, message), 8)
}

/// The eight bytes of a motor's message.
fn message(servo: &Servo, frame: &CanFrame, message: u32) -> Option<[u8; 8]> {
    let is_ours = !frame.is_extended() && frame.id() == id(servo.id, message);
    is_ours.then(|| frame.eight()).flatten()
}

fn parse_heartbeat(data: &[u8; 8]) -> (Option<String>, bool) {
    let errors = u32::from_le_bytes(word(data, 0));
    (error_names(errors), data[4] == CLOSED_LOOP)
}

fn parse_estimates(motor: &MotorSettings, data: &[u8; 8]) -> Option<(f64, f64)> {
    let turns = |at| f64::from(f32::from_le_bytes(word(data, at))) / motor.gear_ratio * TAU;
    let (position, velocity) = (turns(0), turns(4));
    (position.is_finite() && velocity.is_finite()).then_some((position, velocity))
}

/// Waits for a heartbeat that `accept` likes, asking for it.
fn heartbeat(
    client: &mut MotorClient,
    doing: &'static str,
    closed: bool,
) -> BusResult<Option<String>> {
    let ask = request(client.servo(), HEARTBEAT);
    client.ask(&ask, doing, |servo, frame| {
        let (errors, is_closed) = parse_heartbeat(&message(servo, frame, HEARTBEAT)?);
        match errors {
            Some(errors) if closed => Some(Err(errors)),
            errors => (is_closed == closed).then_some(Ok(errors)),
        }
    })
}

fn estimates(client: &mut MotorClient) -> BusResult<(f64, f64)> {
    let ask = request(client.servo(), ENCODER);
    client.ask(&ask, "encoder estimates", |servo, frame| {
        let data = message(servo, frame, ENCODER)?;
        let parsed = parse_estimates(servo.motor.as_ref()?, &data);
        Some(parsed.ok_or_else(|| "the position is not a number".into()))
    })
}

/// Writes a parameter of four bytes by its endpoint and reads it back.
fn set_endpoint(
    client: &mut MotorClient,
    (endpoint, name): (u16, &'static str),
    value: [u8; 4],
) -> BusResult<()> {
    let [low, high] = endpoint.to_le_bytes();
    let write = two_words([1, low, high, 0], value);
    client.send(&[order(client.servo(), RX_SDO, &write)], name)?;
    let read = order(client.servo(), RX_SDO, &two_words([0, low, high, 0], [0; 4]));
    let actual = client.ask(&read, name, |servo, frame| {
        let data = message(servo, frame, TX_SDO)?;
        let is_answer = [data[1], data[2]] == [low, high];
        is_answer.then(|| Ok(word(&data, 4)))
    })?;
    let hex = |bytes: [u8; 4]| format!("{:08X}", u32::from_le_bytes(bytes));
    client.verify(name, hex(actual), hex(value))
}

impl Odrive {
    fn check_firmware(client: &mut MotorClient) -> BusResult<()> {
        let ask = request(client.servo(), VERSION);
        let (major, minor) = client.ask(&ask, "version", |servo, frame| {
            let data = message(servo, frame, VERSION)?;
            Some(Ok((data[4], data[5])))
        })?;
        let [actual, wanted] =
            [(major, minor), FIRMWARE].map(|(major, minor)| format!("{major}.{minor}"));
        client.verify("firmware", actual, wanted)
    }

    fn arm_watchdog(client: &mut MotorClient, notes: &mut Notes) -> BusResult<()> {
        if let Some([timeout, enable]) = client.config().watchdog_endpoints {
            let seconds = (f64::from(client.config().watchdog_ms) * 1e-3) as f32;
            let timeout = (timeout, "watchdog_timeout");
            set_endpoint(client, timeout, seconds.to_le_bytes())?;
            return set_endpoint(client, (enable, "enable_watchdog"), [1, 0, 0, 0]);
        }
        let why = "the bus table has no watchdog_endpoints (the ids of \
                   axis0.config.watchdog_timeout and axis0.config.enable_watchdog in the \
                   firmware's flat_endpoints.json)";
        notes.push(client.without_watchdog(why.into())?);
        Ok(())
    }
}

impl CanFamily for Odrive {
    fn models(&self) -> &'static [ServoModel] {
        &MODELS
    }

    fn cycle_frames(&self) -> CycleFrames {
        CycleFrames::new(false, &[], &[8, 0, 8])
    }

    fn torque_off(&self, client: &mut MotorClient) -> BusResult<MotorStatus> {
        let idle = u32::from(IDLE).to_le_bytes();
        client.send(&[order(client.servo(), SET_STATE, &idle)], "torque off")?;
        let mut fault = heartbeat(client, "torque off", false)?;
        // A watchdog that expired before this program began is cleared.
        if fault.as_ref().is_some_and(|fault| fault.starts_with(LOST)) {
            let clear = order(client.servo(), CLEAR_ERRORS, &[0]);
            client.send(&[clear], "clearing errors")?;
            fault = heartbeat(client, "torque off", false)?;
        }
        let (position_rad, velocity_rad_s) = estimates(client)?;
        Ok(MotorStatus { position_rad, velocity_rad_s, active: false, fault, temperature_c: None })
    }

    fn set_up(&self, client: &mut MotorClient, notes: &mut Notes) -> BusResult<()> {
        Self::check_firmware(client)?;
        let servo = client.servo().clone();
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
        let modes = two_words(u(POSITION_CONTROL), u(PASSTHROUGH));
        let settings = [
            order(&servo, MODES, &modes),
            order(&servo, LIMITS, &two_words(f(fastest), f(current_a))),
            order(&servo, POSITION_GAIN, &f(position_gain)),
            order(&servo, VELOCITY_GAINS, &two_words(f(velocity_gain), [0; 4])),
        ];
        client.send(&settings, "setting up")?;
        let ask = request(&servo, ERROR);
        client.ask(&ask, "errors", |servo, frame| {
            let data = message(servo, frame, ERROR)?;
            Some(match error_names(u32::from_le_bytes(word(&data, 0))) {
                Some(errors) => Err(errors),
                None => Ok(()),
            })
        })?;
        Self::arm_watchdog(client, notes)
    }

    fn torque_on(&self, client: &mut MotorClient, motor_rad: f64) -> BusResult<()> {
        let servo = client.servo().clone();
        let mut frames = Vec::with_capacity(4);
        // A watchdog that ran out while the axis was idle left an error behind.
        frames.push(order(&servo, CLEAR_ERRORS, &[0]));
        let joint_rad = servo.joint_rad(motor_rad);
        self.target_frames(
            client.config(),
            &servo,
            joint_rad,
            &MotorStatus::default(),
            &mut frames,
        );
        let state = u32::from(CLOSED_LOOP).to_le_bytes();
        frames.push(order(&servo, SET_STATE, &state));
        client.send(&frames, "torque on")?;
        heartbeat(client, "torque on", true).map(|_| ())
    }

    fn read_health(&self, client: &mut MotorClient, _status: &MotorStatus) -> BusResult<Health> {
        let ask = request(client.servo(), TEMPERATURES);
        client.ask(&ask, "temperatures", |servo, frame| {
            let data = message(servo, frame, TEMPERATURES)?;
            // Inverter and motor; a motor without a sensor says NaN.
            let celsius = [0, 4].map(|at| f32::from_le_bytes(word(&data, at)));
            let hottest = celsius.into_iter().filter(|c| c.is_finite());
            Some(Ok(Health {
                temperature_c: hottest.reduce(f32::max).map(f64::from),
                ..Health::default()
            }))
        })
    }

    fn torque_off_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(order(servo, SET_STATE, &u32::from(IDLE).to_le_bytes()));
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
        let joint_rad = servo.limits.clamp_rad(joint_rad);
        let turns = servo.motor_rad(joint_rad) * motor.gear_ratio / TAU;
        let data = two_words((turns as f32).to_le_bytes(), [0; 4]);
        out.push(order(servo, INPUT_POSITION, &data));
        out.push(request(servo, ENCODER));
    }

    fn parse_frame(
        &self,
        servos: &[Servo],
        frame: &CanFrame,
        status: &mut [MotorStatus],
    ) -> Option<usize> {
        let node = frame.id() >> 5;
        let index = servos.iter().position(|servo| u32::from(servo.id) == node)?;
        let servo = &servos[index];
        if let Some(data) = message(servo, frame, ENCODER) {
            let (position, velocity) = parse_estimates(servo.motor.as_ref()?, &data)?;
            status[index].position_rad = position;
            status[index].velocity_rad_s = velocity;
            return Some(index);
        }
        let data = message(servo, frame, HEARTBEAT)?;
        (status[index].fault, status[index].active) = parse_heartbeat(&data);
        None
    }

    fn id_setting(&self, _: &ServoModel) -> IdSetting {
        IdSetting::OfOne
    }

    fn id_frames(
        &self,
        scanner: &mut ScanLink,
        from: u8,
        servo: &Servo,
    ) -> io::Result<Option<Vec<CanFrame>>> {
        let at = id(from, ADDRESS);
        let told = scanner.ask_one(&CanFrame::remote(at, 8), |frame| {
            let is_answer = !frame.is_extended() && frame.id() == at;
            is_answer.then(|| frame.eight()).flatten()
        })?;
        // Without its serial number every controller with this id would take the new one.
        let Some([_, a, b, c, d, e, f, _]) = told else { return Ok(None) };
        let save = CanFrame::standard(id(servo.id, REBOOT), &[SAVE]);
        Ok(Some(vec![CanFrame::standard(at, &[servo.id, a, b, c, d, e, f, 0]), save]))
    }

    fn scan(&self, scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
        scan::controllers(scanner)
    }
}
