//! A bus of CAN motors: one driver, whatever the protocol.
//!
//! A cycle sends every motor its target, rests while the wire is busy, and
//! collects every motor's report; who is missing is asked again, at most
//! `retries` times.
//!
//! Real-time promise: a sound cycle takes its wire time and allocates nothing.
//! A damaged one ends within its bound: wire time and reply timeout, times the
//! tries.
//!
//! Refused before torque: a silent motor, ranges other than configured, a motor
//! that reports a fault, a joint outside its limits, a motor without a watchdog
//! (unless `accept_no_watchdog` is set).

use std::time::Instant;

use servodance_types::JointState;

use crate::bus::torque_alarm;
use crate::bus::{Bus, BusStats, Health};
use crate::can::cia402::Cia402;
use crate::can::exchange::{Exchange, Status};
use crate::can::frame::CanFrame;
use crate::can::link::CanLink;
use crate::can::mit::Mit;
use crate::can::odrive::Odrive;
use crate::can::open_link;
use crate::can::protocol::Protocol;
use crate::can::robstride::Robstride;
use crate::error::BusError;
use crate::servo::{Servo, check_cycle, check_kind};
use crate::{BusConfig, BusKind};

/// One CAN bus of motors.
pub struct CanBus {
    exchange: Exchange,
    protocol: Box<dyn Protocol>,
    status: Vec<Status>,
    answered: Vec<bool>,
    frames: Vec<CanFrame>,
    /// Who is left out of cycles.
    aside: Vec<bool>,
    /// Who is on the way back, and whether it is set up already.
    returning: Option<(usize, bool)>,
    armed: bool,
}

impl CanBus {
    /// Opens the port. Nothing is sent before [`Bus::arm`].
    pub fn open(port: &str, config: &BusConfig, servos: Vec<Servo>) -> Result<Self, BusError> {
        let refused = |reason: String| BusError::Open {
            port: port.into(),
            reason,
            choices: String::new(),
        };
        let checked = config.clone().checked();
        let config = checked.map_err(|error| refused(error.to_string()))?;
        let link = open_link(port, config.baud)?;
        Self::over(link, port, config, servos)
    }

    /// A bus over a link that is open already; `port` is its name in messages.
    pub fn over(
        link: Box<dyn CanLink>,
        port: &str,
        config: BusConfig,
        servos: Vec<Servo>,
    ) -> Result<Self, BusError> {
        let refused = |reason: String| BusError::Open {
            port: port.into(),
            reason,
            choices: String::new(),
        };
        check_kind(&servos, config.kind).map_err(refused)?;
        let protocol: Box<dyn Protocol> = match config.kind {
            BusKind::Mit => Box::new(Mit),
            BusKind::Robstride => Box::new(Robstride),
            BusKind::Odrive => Box::new(Odrive),
            BusKind::Cia402 => Box::new(Cia402),
            _ => return Err(refused("the bus is not on CAN".into())),
        };
        Ok(Self {
            status: vec![Status::default(); servos.len()],
            answered: vec![false; servos.len()],
            aside: vec![false; servos.len()],
            returning: None,
            frames: Vec::with_capacity(2 * servos.len() + 2),
            exchange: Exchange::new(link, port, config, servos),
            protocol,
            armed: false,
        })
    }

    /// How often the transmit queue was full (ENOBUFS) and a frame had to wait.
    pub fn queue_full(&self) -> u64 {
        self.exchange.queue_full
    }

    /// Everything that must hold before any torque.
    fn check_and_set_up(&mut self) -> Result<Vec<String>, BusError> {
        let mut notes = Vec::new();
        self.aside.fill(false);
        self.returning = None;
        self.release_all()?;
        for index in 0..self.status.len() {
            self.check_fault(index)?;
            self.protocol
                .prepare(&mut self.exchange, index, &mut notes)?;
        }
        Ok(notes)
    }

    fn torque_on(&mut self) -> Result<Vec<JointState>, BusError> {
        let mut holds_rad = Vec::with_capacity(self.status.len());
        for index in 0..self.status.len() {
            self.status[index] = self.protocol.release(&mut self.exchange, index)?;
            self.check_fault(index)?;
            holds_rad.push(self.hold_rad(index)?);
        }
        // From here on torque may be on, whatever goes wrong.
        self.armed = true;
        for (index, &joint_rad) in holds_rad.iter().enumerate() {
            let motor_rad = self.exchange.servos[index].motor_rad(joint_rad);
            self.protocol.enable(&mut self.exchange, index, motor_rad)?;
            self.status[index].active = true;
        }
        let mut states = vec![JointState::default(); self.status.len()];
        self.exchange_all(&holds_rad)?;
        self.copy_states(&mut states);
        Ok(states)
    }

    /// Torque off everywhere; all who are silent are named at once.
    fn release_all(&mut self) -> Result<(), BusError> {
        let mut silent = Vec::new();
        for index in 0..self.status.len() {
            match self.protocol.release(&mut self.exchange, index) {
                Ok(status) => self.status[index] = status,
                Err(BusError::Silent { servos, .. }) => silent.extend(servos),
                Err(error) => return Err(error),
            }
        }
        if silent.is_empty() {
            return Ok(());
        }
        Err(self.exchange.silent(silent, "torque off"))
    }

    fn check_fault(&self, index: usize) -> Result<(), BusError> {
        match &self.status[index].fault {
            Some(fault) => Err(self.exchange.faulty(index, fault)),
            None => Ok(()),
        }
    }

    /// The joint position that keeps a joint where it stands.
    fn hold_rad(&self, index: usize) -> Result<f64, BusError> {
        let servo = &self.exchange.servos[index];
        servo.holding_rad(servo.joint_rad(self.status[index].position_rad))
    }

    /// One target out and one report in for every motor, with retries.
    fn exchange_all(&mut self, targets_rad: &[f64]) -> Result<(), BusError> {
        const DOING: &str = "target and state";
        // What came by itself since the last cycle.
        let now = Instant::now();
        while let Some(frame) = self.exchange.receive(now, DOING)? {
            self.hear(&frame);
        }
        self.answered.copy_from_slice(&self.aside);
        for attempt in 0..self.exchange.tries() {
            self.exchange.stats.retries += u64::from(attempt > 0);
            self.frames.clear();
            for (index, servo) in self.exchange.servos.iter().enumerate() {
                if !self.answered[index] {
                    let (target, status) = (targets_rad[index], &self.status[index]);
                    let frames = &mut self.frames;
                    self.protocol.command(servo, target, status, frames);
                }
            }
            self.protocol.conclude(&mut self.frames);
            let began = Instant::now();
            let asked = self.answered.iter().filter(|answered| !**answered).count();
            let deadline = self.exchange.deadline(2 * self.frames.len());
            for index in 0..self.frames.len() {
                let frame = self.frames[index];
                self.exchange.transmit(&frame, deadline, DOING)?;
            }
            self.exchange.rest(asked, DOING)?;
            while self.answered.contains(&false) {
                let Some(frame) = self.exchange.receive(deadline, DOING)? else {
                    self.exchange.stats.timeouts += 1;
                    break;
                };
                if let Some(index) = self.hear(&frame) {
                    self.answered[index] = true;
                }
            }
            self.check_all()?;
            if !self.answered.contains(&false) {
                self.exchange.answered_after(asked, began.elapsed());
                return Ok(());
            }
        }
        let missing = (0..self.answered.len()).filter(|&index| !self.answered[index]);
        let missing = self.exchange.ids_of(missing);
        Err(self.exchange.silent(missing, DOING))
    }

    /// Takes in what was said; who reported its position with it. Some adapters
    /// return what they sent: that says nothing.
    fn hear(&mut self, frame: &CanFrame) -> Option<usize> {
        let is_echo = self.frames.contains(frame);
        let servos = &self.exchange.servos;
        (!is_echo).then(|| self.protocol.hear(servos, frame, &mut self.status))?
    }

    /// No motor may complain, or have left its control loop.
    fn check_all(&self) -> Result<(), BusError> {
        for (index, status) in self.status.iter().enumerate() {
            if self.aside[index] {
                continue;
            }
            self.check_fault(index)?;
            if !status.active && self.armed {
                let why = "torque is off in the motor: it rebooted, or something else stopped it";
                return Err(self.exchange.faulty(index, why));
            }
        }
        Ok(())
    }

    fn copy_states(&self, states: &mut [JointState]) {
        for (index, state) in states.iter_mut().enumerate() {
            if !self.aside[index] {
                *state = self.joint_state(index);
            }
        }
    }

    fn joint_state(&self, index: usize) -> JointState {
        let (servo, status) = (&self.exchange.servos[index], &self.status[index]);
        JointState {
            position_rad: servo.joint_rad(status.position_rad),
            velocity_rad_s: servo.direction * status.velocity_rad_s,
            current_a: 0.0,
        }
    }

    /// Torque off to everyone without waiting, as often as things are tried.
    fn stop_all(&mut self) -> Result<(), BusError> {
        let mut frames = Vec::new();
        for servo in &self.exchange.servos {
            self.protocol.stop(servo, &mut frames);
        }
        let deadline = self.exchange.deadline(frames.len());
        frames
            .iter()
            .try_for_each(|frame| self.exchange.transmit(frame, deadline, "torque off"))
    }
}

impl Bus for CanBus {
    fn servos(&self) -> &[Servo] {
        &self.exchange.servos
    }

    fn observe(&mut self) -> Result<Vec<JointState>, BusError> {
        self.release_all()?;
        let mut states = vec![JointState::default(); self.status.len()];
        self.copy_states(&mut states);
        Ok(states)
    }

    fn prepare(&mut self) -> Result<Vec<String>, BusError> {
        self.check_and_set_up()
    }

    fn engage(&mut self) -> Result<Vec<JointState>, BusError> {
        self.torque_on().inspect_err(|_| {
            if self.armed {
                // The first error is the one to report; `is_armed` stays true
                // if torque could not be verified off, and drop tries again.
                let _ = self.disarm();
            }
        })
    }

    fn cycle(&mut self, targets_rad: &[f64], states: &mut [JointState]) -> Result<(), BusError> {
        if !self.armed {
            return Err(BusError::NotArmed);
        }
        check_cycle(&self.exchange.servos, targets_rad, states.len())?;
        self.exchange_all(targets_rad)?;
        self.copy_states(states);
        self.exchange.stats.cycles += 1;
        Ok(())
    }

    fn disarm(&mut self) -> Result<(), BusError> {
        // Everyone at once first: nobody waits for a silent neighbour.
        let stopped = self.stop_all();
        let mut reason = stopped.err().map(|error| error.to_string());
        let mut doubtful = Vec::new();
        for index in 0..self.status.len() {
            // After the first silent motor the others get one try each.
            let released = if doubtful.is_empty() {
                self.protocol.release(&mut self.exchange, index)
            } else {
                self.exchange
                    .once(|exchange| self.protocol.release(exchange, index))
            };
            match released {
                Ok(status) => self.status[index] = status,
                Err(error) => {
                    reason = Some(error.to_string());
                    doubtful.push(index);
                }
            }
        }
        if doubtful.is_empty() {
            self.armed = false;
            return Ok(());
        }
        Err(BusError::TorqueUnverified {
            servos: self.exchange.ids_of(doubtful),
            reason: reason.unwrap_or_default(),
        })
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn stats(&self) -> BusStats {
        self.exchange.stats
    }

    fn examine(&mut self, index: usize) -> Result<Health, BusError> {
        let status = &self.status[index];
        self.protocol.examine(&mut self.exchange, index, status)
    }

    fn set_aside(&mut self, index: usize) -> bool {
        self.aside[index] = true;
        true
    }

    fn rejoin(&mut self, index: usize) -> Result<Option<JointState>, BusError> {
        let is_set_up = self.returning == Some((index, true));
        self.returning = None;
        let protocol = &self.protocol;
        let found = self.exchange.once(|bus| protocol.release(bus, index));
        self.status[index] = found?;
        self.check_fault(index)?;
        if !is_set_up {
            let set_up = |bus: &mut Exchange| protocol.prepare(bus, index, &mut Vec::new());
            self.exchange.once(set_up)?;
            self.returning = Some((index, true));
            return Ok(None);
        }
        let joint_rad = self.hold_rad(index)?;
        let motor_rad = self.exchange.servos[index].motor_rad(joint_rad);
        let on = |bus: &mut Exchange| self.protocol.enable(bus, index, motor_rad);
        self.exchange.once(on)?;
        self.status[index].active = true;
        self.aside[index] = false;
        Ok(Some(self.joint_state(index)))
    }

    fn reopen(&mut self) -> Result<(), BusError> {
        self.exchange.reopen()
    }
}

impl Drop for CanBus {
    fn drop(&mut self) {
        if !self.armed {
            return;
        }
        if let Err(error) = self.disarm() {
            let text = format!("{error}; the motors' own watchdog stops them, where they have one");
            torque_alarm::raise(&self.exchange.config.reply_clock, &text);
        }
    }
}
