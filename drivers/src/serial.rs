//! One serial bus of servos, whatever their family.
//!
//! A cycle is one Sync Write of every goal position and one read of everyone's
//! present registers, in the best way that the family has, handed to the port
//! together.
//!
//! Real-time promise: a sound cycle takes its wire time and, where everyone is
//! read with one instruction, allocates nothing. A damaged one is tried again
//! at most `retries` times, each bounded by the reply timeout.
//!
//! Refused before torque: a silent servo, another model or firmware than
//! configured, a hardware error, a supply or temperature outside the servo's own
//! limits, own position or velocity limits that cut the joint's, a joint that
//! stands outside its limits, a family without a watchdog (unless
//! `accept_no_watchdog` is set).
//!
//! A servo that is lost can be set aside: the others are cycled on without it.
//! [`Bus::rejoin`] takes it back in steps that are short enough to be done
//! between two cycles:
//!
//! ```text
//! Find (ping) -> reboot if it shut down -> Check (model, limits, condition)
//!      -> SetUp (torque off, settings) -> Engage (goal = present, watchdog, torque)
//! ```

use servodance_types::JointState;

use crate::bus::{Bus, BusStats, Health};
use crate::config::{BusConfig, BusKind};
use crate::dialect::{Dialect, OwnLimits};
use crate::dynamixel::DynamixelX;
use crate::dynamixel1::Dynamixel1;
use crate::error::BusError;
use crate::feetech::FeetechSts;
use crate::last_words;
use crate::link::Link;
use crate::servo::{Servo, check_cycle};

/// One serial bus.
pub struct SerialBus {
    link: Link,
    dialect: Box<dyn Dialect>,
    armed: bool,
    /// Everyone's present registers from the last read.
    present: Vec<u8>,
    own_limits: Vec<OwnLimits>,
    /// The servo that is being taken back, and how far that is.
    returning: Option<(usize, Step)>,
}

/// How far the return of a lost servo is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Find,
    /// Rebooted, and not heard of since.
    FindRebooted,
    Check,
    SetUp,
    Engage,
}

impl SerialBus {
    /// Opens the port. Nothing is sent before [`Bus::prepare`].
    pub fn open(port: &str, config: &BusConfig, servos: Vec<Servo>) -> Result<Self, BusError> {
        let dialect: Box<dyn Dialect> = match config.kind {
            BusKind::Dynamixel1 => Box::new(Dynamixel1),
            BusKind::Feetech => Box::new(FeetechSts),
            _ => Box::new(DynamixelX::new(servos.len())),
        };
        let size = usize::from(dialect.registers().present.size);
        Ok(Self {
            present: vec![0; size * servos.len()],
            own_limits: vec![OwnLimits::default(); servos.len()],
            link: Link::open(port, config, servos, dialect.protocol())?,
            dialect,
            armed: false,
            returning: None,
        })
    }

    /// Model, condition, supply, temperature and limits against the configuration.
    fn check(&mut self, index: usize, pinged: &[u8]) -> Result<(), BusError> {
        let (link, dialect) = (&mut self.link, &mut self.dialect);
        let identity = dialect.identify(link, index, pinged)?;
        link.check_model(index, identity.model_number)?;
        link.check_firmware(index, identity.firmware)?;
        let lacks = dialect.lacks_watchdog();
        if let Some(why) = lacks.filter(|_| !link.config.accept_no_watchdog) {
            return Err(BusError::NoWatchdog {
                servo: link.id_of(index),
                why: format!("{} {why}", link.servos[index].model.name),
            });
        }
        self.check_condition(index)?;
        let (link, dialect) = (&mut self.link, &self.dialect);
        let own = dialect.own_limits(link, index)?;
        let measured = dialect.measure(link, index)?;
        let (lowest, highest) = own.tenth_volts;
        link.check_voltage(index, measured.tenth_volts, lowest, highest)?;
        link.check_temperature(index, measured.celsius, own.celsius)?;
        link.check_goal_range(index, own.ticks)?;
        link.check_velocity(index, own.velocity)?;
        self.own_limits[index] = own;
        Ok(())
    }

    fn check_condition(&mut self, index: usize) -> Result<(), BusError> {
        match self.dialect.condition(&mut self.link, index)? {
            None => Ok(()),
            Some(flags) => Err(BusError::Hardware {
                servo: self.link.id_of(index),
                flags,
            }),
        }
    }

    /// The goal at which a servo holds, and its own watchdog.
    fn hold_here(&mut self, index: usize) -> Result<(), BusError> {
        let present = self.dialect.parse(self.bytes_of(index));
        let goal = self.link.holding_goal(index, present.ticks)?;
        let register = self.dialect.registers().goal;
        let raw = u64::from(goal as u32) & ((1 << (8 * register.size)) - 1);
        self.link.set(index, register, raw)?;
        self.dialect.arm_watchdog(&mut self.link, index)
    }

    fn torque_on(&mut self) -> Result<Vec<JointState>, BusError> {
        self.read_present()?;
        let servos = 0..self.link.servos.len();
        servos.clone().try_for_each(|index| self.hold_here(index))?;
        // From here on torque may be on, whatever goes wrong.
        self.armed = true;
        let torque = self.dialect.registers().torque;
        self.link.sync_write(torque, |_, _| 1)?;
        for index in servos {
            self.link.expect(index, torque, 1)?;
        }
        self.read_present()?;
        let mut states = vec![JointState::default(); self.link.servos.len()];
        self.copy_states(&mut states);
        Ok(states)
    }

    /// Reads everyone's state, with retries.
    fn read_present(&mut self) -> Result<(), BusError> {
        self.link.begin_read();
        let damaged = self.link.wire.stats.crc_errors;
        for attempt in 0..self.link.tries() {
            self.link.wire.stats.retries += u64::from(attempt > 0);
            let alert = self.dialect.read_all(&mut self.link, &mut self.present)?;
            // The servo has something to say against itself.
            alert.map_or(Ok(()), |index| self.check_condition(index))?;
            if self.link.complete() {
                return Ok(());
            }
        }
        let corrupt = self.link.wire.stats.crc_errors > damaged;
        Err(self.link.name_the_silent(corrupt))
    }

    fn bytes_of(&self, index: usize) -> &[u8] {
        let size = usize::from(self.dialect.registers().present.size);
        &self.present[index * size..][..size]
    }

    fn state_of(&self, index: usize) -> JointState {
        let present = self.dialect.parse(self.bytes_of(index));
        self.link.servos[index].state(present.ticks, present.velocity, present.current)
    }

    /// The states of all who are in the cycle.
    fn copy_states(&self, states: &mut [JointState]) {
        for (index, state) in states.iter_mut().enumerate() {
            if !self.link.aside[index] {
                *state = self.state_of(index);
            }
        }
    }

    /// One step of a servo's way back; the next one, or its state when it is back.
    fn step_back(
        &mut self,
        index: usize,
        step: Step,
    ) -> Result<Result<JointState, Step>, BusError> {
        match step {
            Step::Find | Step::FindRebooted => {
                self.link.once(|link| link.ping(index))?;
                let condition = self.dialect.condition(&mut self.link, index)?;
                if condition.is_some() && step == Step::Find {
                    let reboots = self.dialect.reboot(&mut self.link, index)?;
                    return Ok(Err(if reboots {
                        Step::FindRebooted
                    } else {
                        Step::SetUp
                    }));
                }
                Ok(Err(Step::Check))
            }
            Step::Check => {
                let pinged = self.link.ping(index)?;
                self.check(index, &pinged)?;
                Ok(Err(Step::SetUp))
            }
            Step::SetUp => {
                let mut already_told = Vec::new();
                self.dialect
                    .set_up(&mut self.link, index, &mut already_told)?;
                Ok(Err(Step::Engage))
            }
            Step::Engage => {
                self.check_condition(index)?;
                let registers = self.dialect.registers();
                let bytes = self.link.read_bytes(index, registers.present)?;
                self.present[index * bytes.len()..][..bytes.len()].copy_from_slice(&bytes);
                self.hold_here(index)?;
                self.link.set(index, registers.torque, 1)?;
                self.link.aside[index] = false;
                Ok(Ok(self.state_of(index)))
            }
        }
    }
}

impl Bus for SerialBus {
    fn servos(&self) -> &[Servo] {
        &self.link.servos
    }

    fn observe(&mut self) -> Result<Vec<JointState>, BusError> {
        self.link.ping_all()?;
        self.read_present()?;
        let mut states = vec![JointState::default(); self.link.servos.len()];
        self.copy_states(&mut states);
        Ok(states)
    }

    fn prepare(&mut self) -> Result<Vec<String>, BusError> {
        let mut notes: Vec<String> = self.link.wire.latency_note().into_iter().collect();
        self.link.aside.fill(false);
        self.returning = None;
        for (index, pinged) in self.link.ping_all()?.into_iter().enumerate() {
            self.check(index, &pinged)?;
        }
        if self.dialect.lacks_watchdog().is_some() {
            notes.push(
                "these servos have no watchdog: without a host they hold their last goal".into(),
            );
        }
        for index in 0..self.link.servos.len() {
            self.dialect.set_up(&mut self.link, index, &mut notes)?;
        }
        self.dialect.choose_read(&mut self.link, &mut notes)?;
        Ok(notes)
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
        check_cycle(&self.link.servos, targets_rad, states.len())?;
        let goal = self.dialect.registers().goal;
        self.link
            .hold_sync_write(goal, |index, servo| servo.goal_ticks(targets_rad[index]));
        self.read_present()?;
        // Where everyone is set aside nobody was asked.
        self.link.wire.send_held(goal.name)?;
        self.copy_states(states);
        self.link.wire.stats.cycles += 1;
        Ok(())
    }

    fn disarm(&mut self) -> Result<(), BusError> {
        self.returning = None;
        self.link.torque_off(self.dialect.registers().torque)?;
        self.armed = false;
        Ok(())
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn stats(&self) -> BusStats {
        self.link.wire.stats
    }

    fn examine(&mut self, index: usize) -> Result<Health, BusError> {
        let dialect = &self.dialect;
        let measured = self.link.once(|link| dialect.measure(link, index))?;
        let own = self.own_limits[index];
        let units = self.link.servos[index].model.current_a_per_unit;
        Ok(Health {
            temperature_c: Some(measured.celsius as f64),
            highest_temperature_c: Some(own.celsius as f64),
            voltage_v: Some(measured.tenth_volts as f64 * 0.1),
            lowest_voltage_v: Some(own.tenth_volts.0 as f64 * 0.1),
            highest_voltage_v: Some(own.tenth_volts.1 as f64 * 0.1),
            highest_current_a: own
                .current
                .zip(units)
                .map(|(most, unit)| most as f64 * unit),
        })
    }

    fn set_aside(&mut self, index: usize) -> bool {
        self.link.aside[index] = true;
        true
    }

    fn rejoin(&mut self, index: usize) -> Result<Option<JointState>, BusError> {
        let step = match self.returning {
            Some((who, step)) if who == index => step,
            _ => Step::Find,
        };
        // A servo that was rebooted is waited for; all else begins anew.
        let again = match step {
            Step::FindRebooted => Some((index, step)),
            _ => None,
        };
        self.returning = again;
        match self.step_back(index, step)? {
            Err(next) => {
                self.returning = Some((index, next));
                Ok(None)
            }
            Ok(state) => {
                self.returning = None;
                Ok(Some(state))
            }
        }
    }

    fn reopen(&mut self) -> Result<(), BusError> {
        self.link.wire.reopen()
    }
}

impl Drop for SerialBus {
    fn drop(&mut self) {
        if !self.armed {
            return;
        }
        if let Err(error) = self.disarm() {
            let rest = match self.dialect.lacks_watchdog() {
                None => "; the servos' own watchdog stops them",
                Some(_) => "",
            };
            let clock = &self.link.config.reply_clock;
            last_words::say(clock, &format!("{error}{rest}"));
        }
    }
}
