//! moteus controllers: the register protocol in CAN FD frames, position mode.
//!
//! Each command carries position, torque limit and watchdog, and asks for mode, position,
//! velocity, supply, temperature and fault: one frame there, one back. A controller whose
//! watchdog has passed ignores positions until it is stopped, and says so by its mode.
//!
//! The gains are the controller's own (`servo.pid_position`), in force by their whole share:
//! registers cannot set them, so `kp` and `kd` of a robot file do nothing here but on simulated
//! controllers. Its own limits of velocity and acceleration should be off.

#[doc(hidden)] // public for the simulated motors alone
pub mod framing;
mod kind;
#[doc(hidden)] // public for the simulated motors alone
pub mod registers;
mod scan;

use std::f64::consts::TAU;
use std::io;

use crate::can::family::prelude::*;

use self::framing::{Kind, Payload, Said, Saying};
use self::registers::{
    FAULT, FAULTY, GOAL_POSITION, MODE, POSITION, POSITION_MODE, STOPPED, TEMPERATURE, TIMED_OUT,
    VELOCITY, VOLTAGE, WATCHDOG, fault_name,
};

static MODELS: [ServoModel; 1] = [drive("moteus", BusKind::Moteus)];
/// An answer is wanted.
pub(super) const ANSWER: u32 = 0x8000;

pub(crate) struct Moteus;

fn ask_for_state(payload: Payload) -> Payload {
    payload.read(Kind::I8, MODE, 1).read(Kind::F32, POSITION, 2).read(Kind::I8, VOLTAGE, 3)
}

fn frame(servo: &Servo, payload: Payload) -> CanFrame {
    payload.frame(ANSWER | u32::from(servo.id))
}

fn stop(servo: &Servo) -> CanFrame {
    let stopped = Payload::default().write(Kind::I8, MODE, &[f64::from(STOPPED)]);
    frame(servo, ask_for_state(stopped))
}

/// The data of a frame that this controller sent to the host.
fn answer_of(id: u8, frame: &CanFrame) -> Option<&[u8]> {
    (frame.is_flexible() && id > 0 && frame.id() == u32::from(id) << 8).then(|| frame.data())
}

/// A state that a controller was asked for; `None` where anything of it is missing.
fn parse_state(servo: &Servo, frame: &CanFrame) -> Option<MotorStatus> {
    let mut mode = None;
    let (mut turns, mut turns_s, mut code) = (f64::NAN, f64::NAN, 0.0);
    let mut status = MotorStatus::default();
    for said in Saying::of(answer_of(servo.id, frame)?) {
        let Said::Reply { register, value } = said else { continue };
        match register {
            MODE => mode = Some(value as u8),
            POSITION => turns = value,
            VELOCITY => turns_s = value,
            TEMPERATURE => status.temperature_c = value.is_finite().then_some(value),
            FAULT => code = value,
            _ => {}
        }
    }
    let mode = mode.filter(|_| turns.is_finite() && turns_s.is_finite())?;
    status.fault = match mode {
        FAULTY => Some(format!("{} (fault {code})", fault_name(code as u8))),
        TIMED_OUT => Some("its watchdog has stopped it".into()),
        _ => None,
    };
    status.active = mode == POSITION_MODE;
    (status.position_rad, status.velocity_rad_s) = (turns * TAU, turns_s * TAU);
    Some(status)
}

impl CanFamily for Moteus {
    fn models(&self) -> &'static [ServoModel] {
        &MODELS
    }

    fn is_flexible(&self) -> bool {
        true
    }

    fn cycle_frames(&self) -> CycleFrames {
        CycleFrames::flexible(&[48, 20])
    }

    fn torque_off(&self, client: &mut MotorClient) -> BusResult<MotorStatus> {
        let stop = stop(client.servo());
        client.ask(&stop, "torque off", |servo, frame| {
            let status = parse_state(servo, frame)?;
            (!status.active).then_some(Ok(status))
        })
    }

    fn set_up(&self, _client: &mut MotorClient, _notes: &mut Notes) -> BusResult<()> {
        // Torque limit and watchdog are in every command; the watchdog is read back with torque on.
        Ok(())
    }

    fn torque_on(&self, client: &mut MotorClient, motor_rad: f64) -> BusResult<()> {
        let (servo, config) = (client.servo().clone(), client.config().clone());
        let mut hold = Vec::with_capacity(1);
        let here = MotorStatus { position_rad: motor_rad, ..MotorStatus::default() };
        self.target_frames(&config, &servo, servo.joint_rad(motor_rad), &here, &mut hold);
        for order in &hold {
            client.ask(order, "torque on", |servo, frame| {
                let status = parse_state(servo, frame)?;
                match status.fault {
                    Some(fault) => Some(Err(fault)),
                    None => status.active.then_some(Ok(())),
                }
            })?;
        }
        let read = frame(&servo, Payload::default().read(Kind::F32, WATCHDOG, 1));
        let actual_s = client.ask(&read, "watchdog (027)", |servo, frame| {
            let replies = Saying::of(answer_of(servo.id, frame)?);
            let mut told = replies.filter_map(|said| match said {
                Said::Reply { register: WATCHDOG, value } => Some(value),
                _ => None,
            });
            told.next().map(Ok)
        })?;
        client.verify_f32("watchdog (027)", actual_s, f64::from(config.watchdog_ms) * 1e-3)
    }

    fn torque_off_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>) {
        out.push(stop(servo));
    }

    fn target_frames(
        &self,
        config: &BusConfig,
        servo: &Servo,
        joint_rad: f64,
        _: &MotorStatus,
        out: &mut Vec<CanFrame>,
    ) {
        let Some(motor) = &servo.motor else {
            return;
        };
        let turns = servo.motor_rad(servo.limits.clamp_rad(joint_rad)) / TAU;
        let goal = [turns, 0.0, 0.0, 1.0, 1.0, motor.torque_limit_nm];
        let command = Payload::default()
            .write(Kind::I8, MODE, &[f64::from(POSITION_MODE)])
            .write(Kind::F32, GOAL_POSITION, &goal)
            .write(Kind::F32, WATCHDOG, &[f64::from(config.watchdog_ms) * 1e-3]);
        out.push(frame(servo, ask_for_state(command)));
    }

    fn parse_frame(
        &self,
        servos: &[Servo],
        frame: &CanFrame,
        status: &mut [MotorStatus],
    ) -> Option<usize> {
        let index = servos.iter().position(|servo| frame.id() == u32::from(servo.id) << 8)?;
        status[index] = parse_state(&servos[index], frame)?;
        Some(index)
    }

    fn scan(&self, scanner: &mut ScanLink) -> io::Result<Vec<CanFound>> {
        match scanner.link.carries_flexible() {
            true => scan::controllers(scanner),
            false => Ok(Vec::new()),
        }
    }
}
