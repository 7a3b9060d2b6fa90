//! One serial bus of servos, whatever their family.
//!
//! A cycle is one read of everyone's present registers, in the best way that the family
//! has, and then one Sync Write of goal positions. Where several servos did not answer
//! soundly, those get none: one of them may have the id of another.
//!
//! Real-time promise: a sound cycle takes its wire time and, where everyone is
//! read with one instruction, allocates nothing. A damaged one is tried again
//! at most `retries` times, each bounded by the reply timeout; what is still missing
//! then is reckoned for a while (`losses.rs`).
//!
//! Refused before torque: a silent servo, another model or firmware than
//! configured, a hardware error, a supply or temperature outside the servo's own
//! limits, own position or velocity limits that cut the joint's, a joint that
//! stands outside its limits, a family without a watchdog (unless
//! `accept_no_watchdog` is set).
//!
//! A servo that is lost can be set aside: the others are cycled on without it, and
//! `rejoin.rs` takes it back between two cycles.

use servodance_types::{ImuState, JointState};

use crate::bus::config::BusConfig;
use crate::bus::error_counters::ErrorCounters;
use crate::bus::{Bus, BusStats, Health, Notes, torque_alarm};
use crate::error::{BusError, BusResult};
use crate::imu::ImuReader;
use crate::serial::client::ServoClient;
use crate::serial::deviation::ServoDeviation;
use crate::serial::families::family_of;
use crate::serial::family::ServoFamily;
use crate::serial::goal_timing::GoalTiming;
use crate::serial::missing::Missing;
use crate::serial::registers::OwnLimits;
use crate::serial::silence::BusSilence;
use crate::servo::{Servo, check_cycle, check_models};

/// Cycles a second where nobody says how many.
const ASSUMED_HZ: f64 = 100.0;

/// A serial bus of servos of one family.
pub struct SerialBus {
    pub(super) client: ServoClient,
    pub(super) family: &'static dyn ServoFamily,
    armed: bool,
    pub(super) present: Vec<u8>,
    own_limits: Vec<Option<OwnLimits>>,
    pub(super) returning: Option<(usize, RejoinStep)>,
    imu: Option<ImuReader>,
    pub(super) silence: BusSilence,
    pub(super) missing: Vec<Missing>,
    pub(super) goals: GoalTiming,
}

/// How far the return of a lost servo is: see `rejoin.rs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RejoinStep {
    Find,
    FindRebooted,
    Check,
    SetUp,
    Engage,
}

impl SerialBus {
    /// Opens the port of a bus whose family this crate knows. Nothing
    /// is sent before [`Bus::prepare`].
    pub fn open(port: &str, config: &BusConfig, servos: Vec<Servo>) -> BusResult<Self> {
        match family_of(config.kind) {
            Some(family) => Self::open_family(family, port, config, servos),
            None => Err(BusError::not_opened(
                port,
                "a bus of this kind is on CAN, or is opened with SerialBus::open_family",
            )),
        }
    }

    /// Opens the port of a bus of any family: one that this crate does not know,
    /// for instance, with [`crate::BusKind::Custom`].
    pub fn open_family(
        family: &'static dyn ServoFamily,
        port: &str,
        config: &BusConfig,
        servos: Vec<Servo>,
    ) -> BusResult<Self> {
        let config = config.clone().checked();
        let config = config.map_err(|error| BusError::not_opened(port, error))?;
        let is_known = |servo: &Servo| family.models().iter().any(|model| model == servo.model);
        check_models(&servos, is_known).map_err(|reason| BusError::not_opened(port, reason))?;
        let size = usize::from(family.registers().present.size);
        let hz = config.control_hz.unwrap_or(ASSUMED_HZ);
        let imu = config.imu.as_ref();
        let imu = imu.map(|imu| ImuReader::new(imu, hz, config.reply_timeout_ms));
        Ok(Self {
            present: vec![0; size * servos.len()],
            own_limits: vec![None; servos.len()],
            missing: vec![Missing::default(); servos.len()],
            goals: GoalTiming::new(servos.len()),
            client: ServoClient::open(port, config, servos, family)?,
            family,
            armed: false,
            returning: None,
            imu,
            silence: BusSilence::default(),
        })
    }

    pub(super) fn check(&mut self, index: usize, pinged: &[u8]) -> BusResult<()> {
        self.own_limits[index] = self.client.check(self.family, index, pinged)?;
        Ok(())
    }

    fn set_up_all(&mut self) -> BusResult<Notes> {
        let mut notes = Vec::new();
        for index in 0..self.client.servos.len() {
            self.family.set_up(&mut self.client, index, &mut notes)?;
        }
        Ok(notes)
    }

    pub(super) fn hold_here(&mut self, index: usize) -> BusResult<()> {
        let present = self.family.parse(self.bytes_of(index));
        let goal = self.client.holding_goal(index, present.ticks)?;
        let register = self.family.registers().goal;
        let raw = u64::from(goal as u32) & ((1 << (8 * register.size)) - 1);
        self.client.set(index, register, raw)?;
        self.family.arm_watchdog(&mut self.client, index)
    }

    fn torque_on(&mut self) -> BusResult<Vec<JointState>> {
        self.read_present()?;
        let servos = 0..self.client.servos.len();
        servos.clone().try_for_each(|index| self.hold_here(index))?;
        // From here on torque may be on, whatever goes wrong.
        self.armed = true;
        let torque = self.family.registers().torque;
        self.client.sync_write(torque, |_, _| Some(1))?;
        for index in servos {
            self.client.expect(index, torque, 1)?;
        }
        self.read_present()?;
        let mut states = vec![JointState::default(); self.client.servos.len()];
        self.copy_states(&mut states);
        self.silence.end(self.client.config.reply_clock.now_s());
        Ok(states)
    }

    fn read_present(&mut self) -> BusResult<()> {
        let damaged = self.client.port.stats.crc_errors;
        if self.read_patiently()? {
            return Ok(());
        }
        let corrupt = self.client.port.stats.crc_errors > damaged;
        Err(self.client.name_the_silent(corrupt))
    }

    /// Asks until everyone has answered, `retries` times more; whether everyone has.
    pub(super) fn read_patiently(&mut self) -> BusResult<bool> {
        self.client.begin_read();
        for attempt in 0..self.client.tries() {
            self.client.asks_again_soon = self.goals.is_timed(&self.client.config);
            if attempt > 0 {
                if self.client.waits_for_cycle && self.goals.is_late(&self.client.config) {
                    break;
                }
                self.client.ask_again();
            }
            let unheard = self.client.unheard_questions;
            if unheard > 0 {
                self.client.port.hold_filler(unheard > 1);
            }
            let alert = self.family.read_all(&mut self.client, &mut self.present)?;
            // The servo has something to say against itself.
            alert.map_or(Ok(()), |index| self.client.check_condition(self.family, index))?;
            self.client.count_unheard();
            if self.client.complete() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Goals for those who may have one: see `goal_timing.rs`. The question to a motion sensor
    /// goes with them: one call to the system, and no pause on the wire.
    fn send_goals(&mut self, targets_rad: &[f64], damaged: bool) -> BusResult<()> {
        let Self { client, goals, missing, imu, .. } = self;
        let goal = self.family.registers().goal;
        let bytes = client.servos.len() * (1 + usize::from(goal.size));
        let copies = goals.copies(&client.config, client.port.time(bytes));
        let missing = missing.iter().zip(&client.aside);
        let missing = missing.map(|(missing, aside)| (!aside).then_some(missing.cycles));
        goals.begin_sending(&client.config, missing, damaged);
        client.hold_sync_write(goal, copies, |index, servo| {
            goals.was_sent(index).then(|| servo.goal_ticks(targets_rad[index]))
        });
        let asked = imu.as_mut().map_or(Ok(()), |imu| imu.ask(client));
        let sent = asked.and_then(|()| client.port.send_held(goal.name));
        goals.end_sending();
        sent
    }

    fn bytes_of(&self, index: usize) -> &[u8] {
        let size = usize::from(self.family.registers().present.size);
        &self.present[index * size..][..size]
    }

    pub(super) fn state_of(&self, index: usize) -> JointState {
        let present = self.family.parse(self.bytes_of(index));
        self.client.servos[index].state(present.ticks, present.velocity, present.current)
    }

    fn copy_states(&self, states: &mut [JointState]) {
        for (index, state) in states.iter_mut().enumerate() {
            if !self.client.aside[index] {
                *state = self.state_of(index);
            }
        }
    }
}

impl Bus for SerialBus {
    fn servos(&self) -> &[Servo] {
        &self.client.servos
    }

    fn observe(&mut self) -> BusResult<Vec<JointState>> {
        self.client.ping_all()?;
        self.read_present()?;
        let mut states = vec![JointState::default(); self.client.servos.len()];
        self.copy_states(&mut states);
        Ok(states)
    }

    fn prepare(&mut self) -> BusResult<Notes> {
        let mut notes: Vec<String> = self.client.port.latency_note().into_iter().collect();
        self.client.aside.fill(false);
        self.returning = None;
        for (index, pinged) in self.client.ping_all()?.into_iter().enumerate() {
            self.check(index, &pinged)?;
        }
        if self.family.lacks_watchdog().is_some() {
            notes.push(
                "these servos have no watchdog: without a host they hold their last goal".into(),
            );
        }
        notes.extend(self.set_up_all()?);
        self.family.choose_read(&mut self.client, &mut notes)?;
        if let Some(imu) = &mut self.imu {
            imu.ask(&mut self.client)?;
            imu.hear(&mut self.client)?;
            notes.extend(imu.note());
        }
        Ok(notes)
    }

    fn set_up(&mut self) -> BusResult<Notes> {
        self.client.ping_all()?;
        self.set_up_all()
    }

    fn deviations(&mut self) -> BusResult<Vec<ServoDeviation>> {
        self.client.ping_all()?;
        let mut found = Vec::new();
        for index in 0..self.client.servos.len() {
            let own = self.family.deviations(&mut self.client, index)?.into_iter();
            found.extend(own.map(|deviation| ServoDeviation { index, deviation }));
        }
        Ok(found)
    }

    fn refused(&mut self) -> BusResult<Vec<BusError>> {
        let mut found = Vec::new();
        for (index, pinged) in self.client.ping_all()?.into_iter().enumerate() {
            match self.check(index, &pinged) {
                // The robot file's to say, not the servo's.
                Ok(()) | Err(BusError::NoWatchdog { .. }) => {}
                Err(error) if error.is_of_the_servo() => found.push(error),
                Err(error) => return Err(error),
            }
        }
        Ok(found)
    }

    fn homing_offset(&mut self, index: usize) -> BusResult<Option<i32>> {
        self.family.homing_offset(&mut self.client, index)
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
        self.goals.begin_cycle();
        check_cycle(&self.client.servos, targets_rad, states.len())?;
        let passed_s = self.watch_silence()?;
        let stats = self.client.port.stats;
        self.read_cycle()?;
        let now = self.client.port.stats;
        self.goals.note_wire(now.errors() > stats.errors());
        self.send_goals(targets_rad, now.crc_errors > stats.crc_errors)?;
        self.copy_cycle(passed_s, states);
        if let Some(imu) = &mut self.imu {
            imu.hear(&mut self.client)?;
        }
        self.client.port.stats.cycles += 1;
        Ok(())
    }

    fn has_time(&self) -> bool {
        !self.goals.is_late(&self.client.config)
    }

    fn sent_goal(&self, index: usize) -> bool {
        self.goals.was_sent(index)
    }

    fn disarm(&mut self) -> BusResult<()> {
        self.returning = None;
        self.client.torque_off(self.family.registers().torque)?;
        self.armed = false;
        Ok(())
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn imu(&self) -> Option<ImuState> {
        self.imu.as_ref().and_then(ImuReader::state)
    }

    fn stats(&self) -> BusStats {
        self.client.port.stats
    }

    fn examine(&mut self, index: usize) -> BusResult<Health> {
        let family = self.family;
        // Between two cycles: no longer than the answers of cycles are waited for.
        self.client.waits_for_cycle = true;
        let measured = self.client.once(|client| client.measure(family, index));
        let tripped = self.refuse_tripped(Some(index));
        self.client.waits_for_cycle = false;
        tripped?;
        let measured = measured?;
        let (Some(measured), Some(own)) = (measured, self.own_limits[index]) else {
            return Ok(Health::default());
        };
        let units = self.client.servos[index].model.current_a_per_unit;
        Ok(Health {
            temperature_c: Some(measured.celsius as f64),
            highest_temperature_c: Some(own.celsius as f64),
            voltage_v: Some(measured.tenth_volts as f64 * 0.1),
            lowest_voltage_v: Some(own.tenth_volts.0 as f64 * 0.1),
            highest_voltage_v: Some(own.tenth_volts.1 as f64 * 0.1),
            highest_current_a: own.current.zip(units).map(|(most, unit)| most as f64 * unit),
        })
    }

    fn set_aside(&mut self, index: usize) -> bool {
        self.client.aside[index] = true;
        true
    }

    fn rejoin(&mut self, index: usize) -> BusResult<Option<JointState>> {
        self.advance_rejoin(index)
    }

    fn resume(&mut self, index: usize) -> BusResult<JointState> {
        self.resume_stopped(index)
    }

    fn error_counters(&self) -> ErrorCounters {
        self.client.errors.clone()
    }

    fn reopen(&mut self) -> BusResult<()> {
        self.client.port.reopen()
    }
}

impl Drop for SerialBus {
    fn drop(&mut self) {
        if !self.armed {
            return;
        }
        if let Err(error) = self.disarm() {
            let rest = match self.family.lacks_watchdog() {
                None => "; the servos' own watchdog stops them",
                Some(_) => "",
            };
            let clock = &self.client.config.reply_clock;
            torque_alarm::raise(clock, &format!("{error}{rest}"));
        }
    }
}
