//! A bus of CAN motors: one driver for every family ([`crate::can::family`]).
//!
//! A cycle sends every motor its target, sleeps while the wire is busy, and
//! collects every motor's report; motors whose report is missing get their target
//! again, at most `retries` times.
//!
//! Real-time promise: a cycle without errors takes its wire time and allocates
//! nothing. A cycle with errors ends within its bound: wire time and reply timeout,
//! times the tries.
//!
//! Refused before torque: a silent motor, ranges other than configured, a motor
//! that reports a fault, a joint outside its limits, a motor without a watchdog
//! (unless `accept_no_watchdog` is set).

use std::time::Instant;

use servodance_types::{ImuState, JointState};

use crate::bus::config::BusConfig;
use crate::bus::error_counters::ErrorCounters;
use crate::bus::torque_alarm;
use crate::bus::{Bus, BusStats, Health, Notes};
use crate::can::client::MotorClient;
use crate::can::exchange::{CanExchange, MotorStatus};
use crate::can::families;
use crate::can::family::CanFamily;
use crate::can::transport::{CanFrame, CanLink, open_link};
use crate::error::{BusError, BusResult};
use crate::imu::CanImu;
use crate::servo::{Servo, check_cycle, check_kind};

/// Cycles a second where the robot's rate is not known.
const ASSUMED_HZ: f64 = 100.0;
/// After a silence of this share of the motors' time-out they may have stopped.
const TRUSTED: f64 = 0.8;

/// An open CAN bus whose motors are of one family.
pub struct CanBus {
    exchange: CanExchange,
    family: &'static dyn CanFamily,
    status: Vec<MotorStatus>,
    answered: Vec<bool>,
    frames: Vec<CanFrame>,
    aside: Vec<bool>,
    returning: Option<(usize, bool)>,
    imu: Option<CanImu>,
    armed: bool,
    /// The motor whose turn it is to be asked for what reports do not tell.
    watched: usize,
    /// When the last cycle began, seconds by the bus's clock.
    spoke_s: f64,
}

impl CanBus {
    /// Opens the port. Nothing is sent before [`Bus::arm`].
    pub fn open(port: &str, config: &BusConfig, servos: Vec<Servo>) -> BusResult<Self> {
        let config = config.clone().checked().map_err(|error| BusError::not_opened(port, error))?;
        let link = open_link(port, config.baud)?;
        Self::over(link, port, config, servos)
    }

    /// A bus over a link that is open already; `port` is its name in messages.
    pub fn over(
        link: Box<dyn CanLink>,
        port: &str,
        config: BusConfig,
        servos: Vec<Servo>,
    ) -> BusResult<Self> {
        check_kind(&servos, config.kind).map_err(|reason| BusError::not_opened(port, reason))?;
        let Some(family) = families::of_kind(config.kind) else {
            return Err(BusError::not_opened(port, "the bus is not on CAN"));
        };
        if family.is_flexible() && !link.carries_flexible() {
            let reason = "these motors speak CAN FD: fdcanusb:PATH carries it, and can:IFACE where the \
                 interface is up with it (`sudo ip link set can0 up type can bitrate 1000000 \
                 dbitrate 5000000 fd on`)";
            return Err(BusError::not_opened(port, reason));
        }
        let count = servos.len();
        let hz = config.control_hz.unwrap_or(ASSUMED_HZ);
        Ok(Self {
            imu: config.imu.as_ref().map(|imu| CanImu::new(imu, hz)),
            status: vec![MotorStatus::default(); count],
            answered: vec![false; count],
            aside: vec![false; count],
            returning: None,
            frames: Vec::with_capacity(2 * count + 2),
            exchange: CanExchange::new(link, port, config, servos, family.cycle_frames()),
            family,
            armed: false,
            watched: 0,
            spoke_s: 0.0,
        })
    }

    /// How often the transmit queue was full (ENOBUFS) and a frame had to wait.
    pub fn queue_full(&self) -> u64 {
        self.exchange.queue_full
    }

    fn client(&mut self, index: usize) -> MotorClient<'_> {
        MotorClient { bus: &mut self.exchange, index }
    }

    fn torque_off(&mut self, index: usize) -> BusResult<MotorStatus> {
        self.family.torque_off(&mut self.client(index))
    }

    /// Runs exchanges without retries.
    fn once<T>(&mut self, exchanges: impl FnOnce(&mut Self) -> T) -> T {
        let tries = std::mem::replace(&mut self.exchange.tries, 1);
        let result = exchanges(self);
        self.exchange.tries = tries;
        result
    }

    fn check_and_set_up(&mut self) -> BusResult<Notes> {
        let mut notes = Vec::new();
        self.aside.fill(false);
        self.returning = None;
        self.release_all()?;
        for index in 0..self.status.len() {
            self.check_fault(index)?;
            let family = self.family;
            family.set_up(&mut self.client(index), &mut notes)?;
        }
        Ok(notes)
    }

    fn torque_on(&mut self) -> BusResult<Vec<JointState>> {
        let mut holds_rad = Vec::with_capacity(self.status.len());
        for index in 0..self.status.len() {
            self.status[index] = self.torque_off(index)?;
            self.check_fault(index)?;
            holds_rad.push(self.hold_rad(index)?);
        }
        // From here on torque may be on, whatever goes wrong.
        self.armed = true;
        for (index, &joint_rad) in holds_rad.iter().enumerate() {
            let motor_rad = self.exchange.servos[index].motor_rad(joint_rad);
            let family = self.family;
            family.torque_on(&mut self.client(index), motor_rad)?;
            self.status[index].active = true;
        }
        let mut states = vec![JointState::default(); self.status.len()];
        self.exchange_all(&holds_rad)?;
        self.copy_states(&mut states);
        self.spoke_s = self.exchange.config.reply_clock.now_s();
        Ok(states)
    }

    /// Refuses a cycle after a silence in which the motors have stopped themselves, where they
    /// would go on with the next command as if nothing had been.
    fn watch_silence(&mut self) -> BusResult<()> {
        let config = &self.exchange.config;
        let now_s = config.reply_clock.now_s();
        let silent_s = now_s - std::mem::replace(&mut self.spoke_s, now_s);
        let trusted_s = TRUSTED * f64::from(config.watchdog_ms) * 1e-3;
        if !self.family.forgets_trips() || silent_s < trusted_s {
            return Ok(());
        }
        let servos = self.exchange.ids_of(0..self.status.len());
        Err(BusError::Tripped { servos, silent_s: Some(silent_s) })
    }

    fn release_all(&mut self) -> BusResult<()> {
        let mut silent = Vec::new();
        for index in 0..self.status.len() {
            match self.torque_off(index) {
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

    fn check_fault(&self, index: usize) -> BusResult<()> {
        match &self.status[index].fault {
            Some(fault) => Err(self.exchange.faulty(index, fault)),
            None => Ok(()),
        }
    }

    fn hold_rad(&self, index: usize) -> BusResult<f64> {
        let servo = &self.exchange.servos[index];
        servo.holding_rad(servo.joint_rad(self.status[index].position_rad))
    }

    fn exchange_all(&mut self, targets_rad: &[f64]) -> BusResult<()> {
        const DOING: &str = "target and state";
        // Frames that came unasked since the last cycle.
        let now = Instant::now();
        while let Some(frame) = self.exchange.receive(now, DOING)? {
            self.take_frame(&frame);
        }
        self.answered.copy_from_slice(&self.aside);
        for attempt in 0..self.exchange.tries {
            self.exchange.stats.retries += u64::from(attempt > 0);
            self.frames.clear();
            for (index, servo) in self.exchange.servos.iter().enumerate() {
                if !self.answered[index] {
                    if attempt > 0 {
                        self.exchange.errors.asked_again(index);
                    }
                    let (target, status) = (targets_rad[index], &self.status[index]);
                    let frames = &mut self.frames;
                    let config = &self.exchange.config;
                    self.family.target_frames(config, servo, target, status, frames);
                }
            }
            self.family.cycle_end_frames(&mut self.frames);
            if attempt == 0 {
                self.watched = (self.watched + 1) % self.status.len().max(1);
                if let Some(servo) = self.exchange.servos.get(self.watched) {
                    self.family.watch_frames(servo, &mut self.frames);
                }
            }
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
                    let silent = (0..self.answered.len()).filter(|&index| !self.answered[index]);
                    silent.for_each(|index| self.exchange.errors.timed_out(index));
                    break;
                };
                if let Some(index) = self.take_frame(&frame) {
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

    /// Updates the status from a frame; the motor that reported its position with it.
    /// Some adapters return our own frames: those are ignored.
    fn take_frame(&mut self, frame: &CanFrame) -> Option<usize> {
        if self.imu.as_mut().is_some_and(|imu| imu.hear(frame)) {
            return None;
        }
        let is_echo = self.frames.contains(frame);
        let servos = &self.exchange.servos;
        (!is_echo).then(|| self.family.parse_frame(servos, frame, &mut self.status))?
    }

    fn check_all(&self) -> BusResult<()> {
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

    /// Torque on for one motor that has none, where it stands.
    fn hold_one(&mut self, index: usize) -> BusResult<JointState> {
        let family = self.family;
        let joint_rad = self.hold_rad(index)?;
        let motor_rad = self.exchange.servos[index].motor_rad(joint_rad);
        self.once(|bus| family.torque_on(&mut bus.client(index), motor_rad))?;
        self.status[index].active = true;
        Ok(self.joint_state(index))
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

    /// Sends torque off to every motor without waiting for answers.
    fn stop_all(&mut self) -> BusResult<()> {
        let mut frames = Vec::new();
        for servo in &self.exchange.servos {
            self.family.torque_off_frames(servo, &mut frames);
        }
        let deadline = self.exchange.deadline(frames.len());
        frames.iter().try_for_each(|frame| self.exchange.transmit(frame, deadline, "torque off"))
    }
}

impl Bus for CanBus {
    fn servos(&self) -> &[Servo] {
        &self.exchange.servos
    }

    fn observe(&mut self) -> BusResult<Vec<JointState>> {
        self.release_all()?;
        let mut states = vec![JointState::default(); self.status.len()];
        self.copy_states(&mut states);
        Ok(states)
    }

    fn prepare(&mut self) -> BusResult<Notes> {
        self.check_and_set_up()
    }

    fn engage(&mut self) -> BusResult<Vec<JointState>> {
        self.torque_on().inspect_err(|_| {
            if self.armed {
                // The first error is the one to report; `is_armed` stays true
                // if torque could not be verified off, and drop tries again.
                let _ = self.disarm();
            }
        })
    }

    fn cycle(&mut self, targets_rad: &[f64], states: &mut [JointState]) -> BusResult<()> {
        if !self.armed {
            return Err(BusError::NotArmed);
        }
        check_cycle(&self.exchange.servos, targets_rad, states.len())?;
        self.watch_silence()?;
        self.exchange_all(targets_rad)?;
        self.copy_states(states);
        if let Some(imu) = &mut self.imu {
            imu.cycle();
        }
        self.exchange.stats.cycles += 1;
        Ok(())
    }

    fn disarm(&mut self) -> BusResult<()> {
        // All at once first: no motor waits for a silent neighbour.
        let stopped = self.stop_all();
        let mut reason = stopped.err().map(|error| error.to_string());
        let mut doubtful = Vec::new();
        for index in 0..self.status.len() {
            // After the first silent motor the others get one try each.
            let released = match doubtful.is_empty() {
                true => self.torque_off(index),
                false => self.once(|bus| bus.torque_off(index)),
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

    fn imu(&self) -> Option<ImuState> {
        self.imu.as_ref().and_then(CanImu::state)
    }

    fn stats(&self) -> BusStats {
        self.exchange.stats
    }

    fn examine(&mut self, index: usize) -> BusResult<Health> {
        let (family, status) = (self.family, self.status[index].clone());
        self.once(|bus| family.read_health(&mut bus.client(index), &status))
    }

    fn set_aside(&mut self, index: usize) -> bool {
        self.aside[index] = true;
        true
    }

    fn rejoin(&mut self, index: usize) -> BusResult<Option<JointState>> {
        let is_set_up = self.returning == Some((index, true));
        self.returning = None;
        self.status[index] = self.once(|bus| bus.torque_off(index))?;
        self.check_fault(index)?;
        let family = self.family;
        if !is_set_up {
            self.once(|bus| family.set_up(&mut bus.client(index), &mut Vec::new()))?;
            self.returning = Some((index, true));
            return Ok(None);
        }
        let state = self.hold_one(index)?;
        self.aside[index] = false;
        Ok(Some(state))
    }

    fn resume(&mut self, index: usize) -> BusResult<JointState> {
        if !self.family.forgets_trips() {
            return Err(BusError::NoReturn { servo: self.exchange.id_of(index) });
        }
        self.status[index] = self.once(|bus| bus.torque_off(index))?;
        self.check_fault(index)?;
        let state = self.hold_one(index)?;
        self.spoke_s = self.exchange.config.reply_clock.now_s();
        Ok(state)
    }

    fn error_counters(&self) -> ErrorCounters {
        self.exchange.errors.clone()
    }

    fn reopen(&mut self) -> BusResult<()> {
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
