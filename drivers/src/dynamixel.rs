//! X series servos over Dynamixel Protocol 2.0.
//!
//! A cycle is one Sync Write of every goal position and one read of every
//! servo's current, velocity and position: a Fast Sync Read where all servos
//! answer it (probed once, when arming), else a plain Sync Read.
//!
//! Real-time promise: a sound cycle takes its wire time and allocates nothing.
//! A damaged one is tried again at most `retries` times, each bounded by the
//! reply timeout.
//!
//! Refused before torque: a silent servo, another model than configured, a
//! hardware error, a supply or temperature outside the servo's own limits, a
//! joint that stands outside its limits.

use std::time::{Duration, Instant};

use dynamixel2::instructions::instruction_id as instruction;
use dynamixel2::instructions::packet_id::BROADCAST;
use servodance_types::JointState;

use crate::bus::{ArmReport, Bus, BusStats};
use crate::config::BusConfig;
use crate::error::{BusError, ConfigError, Refusal, ServoId};
use crate::model::Model;
use crate::register::{Register, hardware_error_names};
use crate::servo::Servo;
use crate::wire::{Received, Wire};

/// Fast Sync Read; the `dynamixel2` crate does not know it.
const FAST_SYNC_READ: u8 = 0x8A;
/// Return delay that a servo has before it is set to zero: 254 units of 2 us.
const LONGEST_RETURN_DELAY: Duration = Duration::from_micros(508);
/// Length field of a status packet without parameters: instruction, error, CRC.
const STATUS_LENGTH: usize = 4;
/// Whole status packet around its parameters.
const STATUS_BYTES: usize = 11;
/// A joint may stand this far outside its limits when arming; its first goal
/// is then the limit itself. Backlash and sag leave a joint there.
const REST_TOLERANCE_RAD: f64 = 0.05;

/// One serial bus of Dynamixel servos.
pub struct DynamixelBus {
    wire: Wire,
    servos: Vec<Servo>,
    config: BusConfig,
    /// How often an exchange is tried; less while it is known that servos are silent.
    tries: u32,
    fast: bool,
    armed: bool,
    /// Parameters of the packet being built.
    params: Vec<u8>,
    /// Ten bytes a servo from the last read, and which servos gave theirs.
    present: Vec<[u8; 10]>,
    answered: Vec<bool>,
}

impl DynamixelBus {
    /// Opens the port. Nothing is sent before [`Bus::arm`].
    pub fn open(port: &str, config: &BusConfig, servos: Vec<Servo>) -> Result<Self, BusError> {
        let config = config
            .clone()
            .checked()
            .map_err(|error: ConfigError| BusError::Open {
                port: port.into(),
                reason: error.to_string(),
                choices: String::new(),
            })?;
        Ok(Self {
            wire: Wire::open(port, config.baud)?,
            present: vec![[0; 10]; servos.len()],
            answered: vec![false; servos.len()],
            params: Vec::with_capacity(8 + 5 * servos.len()),
            servos,
            tries: config.retries + 1,
            config,
            fast: false,
            armed: false,
        })
    }

    /// Whether cycles use Fast Sync Read. Known once armed.
    pub fn is_fast(&self) -> bool {
        self.fast
    }

    fn id_of(&self, index: usize) -> ServoId {
        let servo = &self.servos[index];
        ServoId {
            joint: servo.name.clone(),
            id: servo.id,
        }
    }

    fn ids_of(&self, indices: &[usize]) -> Vec<ServoId> {
        indices.iter().map(|&index| self.id_of(index)).collect()
    }

    /// When a reply of `bytes` from `servos` servos must be there.
    fn deadline(&self, sent: usize, bytes: usize, servos: usize) -> Instant {
        Instant::now()
            + self.wire.time(sent + bytes)
            + LONGEST_RETURN_DELAY * servos as u32
            + Duration::from_secs_f64(self.config.reply_timeout_ms * 1e-3)
    }

    /// One instruction to one servo and its status packet, with `self.tries`.
    fn transfer(
        &mut self,
        index: usize,
        instruction: u8,
        params: &[u8],
        reply: usize,
        doing: &'static str,
    ) -> Result<Vec<u8>, BusError> {
        let id = self.servos[index].id;
        let mut corrupt = false;
        for attempt in 0..self.tries {
            self.wire.stats.retries += u64::from(attempt > 0);
            // Stuffing can lengthen the parameters by a third.
            let longest = STATUS_LENGTH + reply + reply / 3;
            self.wire.send(id, instruction, params, longest, doing)?;
            let deadline = self.deadline(12 + params.len(), STATUS_BYTES + reply, 1);
            loop {
                match self.wire.receive(deadline, doing)? {
                    Received::Packet => {
                        let packet = self.wire.packet();
                        if packet.id != id {
                            continue;
                        }
                        // The servo heard a damaged instruction: say it again.
                        if packet.error() == Refusal::CRC.0 {
                            self.wire.stats.crc_errors += 1;
                            corrupt = true;
                            break;
                        }
                        if packet.error() != 0 {
                            return Err(BusError::Refused {
                                servo: self.id_of(index),
                                doing,
                                refusal: Refusal(packet.error()),
                            });
                        }
                        if packet.params().len() == reply {
                            return Ok(packet.params().to_vec());
                        }
                    }
                    Received::Corrupt => {
                        corrupt = true;
                        break;
                    }
                    Received::Nothing => break,
                }
            }
        }
        Err(self.unanswered(vec![self.id_of(index)], corrupt, doing))
    }

    fn unanswered(&self, servos: Vec<ServoId>, corrupt: bool, doing: &'static str) -> BusError {
        let tries = self.tries;
        if corrupt {
            BusError::Corrupt {
                servos,
                doing,
                tries,
            }
        } else {
            BusError::Silent {
                servos,
                doing,
                tries,
            }
        }
    }

    fn read(&mut self, index: usize, register: Register) -> Result<u64, BusError> {
        let [a0, a1] = register.address.to_le_bytes();
        let [s0, s1] = register.size.to_le_bytes();
        let params = [a0, a1, s0, s1];
        let size = usize::from(register.size);
        let bytes = self.transfer(index, instruction::READ, &params, size, register.name)?;
        Ok(register.value(&bytes))
    }

    fn write(&mut self, index: usize, register: Register, value: u64) -> Result<(), BusError> {
        let mut params = register.address.to_le_bytes().to_vec();
        params.extend(&value.to_le_bytes()[..usize::from(register.size)]);
        self.transfer(index, instruction::WRITE, &params, 0, register.name)?;
        Ok(())
    }

    /// Writes a register and reads it back.
    fn set(&mut self, index: usize, register: Register, value: u64) -> Result<(), BusError> {
        self.write(index, register, value)?;
        let actual = self.read(index, register)?;
        if actual != value {
            return Err(BusError::ReadBack {
                servo: self.id_of(index),
                register: register.name,
                wanted: value as i64,
                actual: actual as i64,
            });
        }
        Ok(())
    }

    /// Writes a register only if it holds another value; says so in the notes.
    fn settle(
        &mut self,
        index: usize,
        register: Register,
        value: u64,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        let old = self.read(index, register)?;
        if old != value {
            self.set(index, register, value)?;
            let servo = self.id_of(index);
            notes.push(format!(
                "{servo}: {} changed from {old} to {value}",
                register.name
            ));
        }
        Ok(())
    }

    /// Sends one value of `register` to every servo in one packet; no reply.
    fn sync_write(
        &mut self,
        register: Register,
        value: impl Fn(usize, &Servo) -> i32,
    ) -> Result<(), BusError> {
        self.params.clear();
        self.params.extend(register.address.to_le_bytes());
        self.params.extend(register.size.to_le_bytes());
        for (index, servo) in self.servos.iter().enumerate() {
            self.params.push(servo.id);
            let bytes = value(index, servo).to_le_bytes();
            self.params.extend(&bytes[..usize::from(register.size)]);
        }
        let write = instruction::SYNC_WRITE;
        self.wire
            .send(BROADCAST, write, &self.params, STATUS_LENGTH, register.name)
    }

    /// Pings everyone; silent servos are all named at once.
    fn ping_all(&mut self) -> Result<Vec<u8>, BusError> {
        let mut silent = Vec::new();
        let mut firmware = Vec::with_capacity(self.servos.len());
        for index in 0..self.servos.len() {
            match self.transfer(index, instruction::PING, &[], 3, "ping") {
                Ok(reply) => {
                    let number = u16::from_le_bytes([reply[0], reply[1]]);
                    self.check_model(index, number)?;
                    firmware.push(reply[2]);
                }
                Err(BusError::Silent { servos, .. }) => silent.extend(servos),
                Err(error) => return Err(error),
            }
        }
        if silent.is_empty() {
            Ok(firmware)
        } else {
            Err(self.unanswered(silent, false, "ping"))
        }
    }

    fn check_model(&self, index: usize, number: u16) -> Result<(), BusError> {
        let wanted = self.servos[index].model;
        if number == wanted.number {
            return Ok(());
        }
        let actual = match Model::from_number(number) {
            Some(model) => format!("{number} ({})", model.name),
            None => number.to_string(),
        };
        Err(BusError::WrongModel {
            servo: self.id_of(index),
            actual,
            wanted: wanted.name,
            number: wanted.number,
        })
    }

    /// Refuses a servo that should not get torque now.
    fn check_fit(&mut self, index: usize) -> Result<(), BusError> {
        self.check_hardware(index)?;
        let voltage = self.read(index, Register::PRESENT_VOLTAGE)?;
        let lowest = self.read(index, Register::MIN_VOLTAGE)?;
        let highest = self.read(index, Register::MAX_VOLTAGE)?;
        let volts = |units: u64| format!("{:.1} V", units as f64 * 0.1);
        if !(lowest..=highest).contains(&voltage) {
            return Err(BusError::Unfit {
                servo: self.id_of(index),
                what: "input voltage",
                actual: volts(voltage),
                wanted: format!("{} to {}", volts(lowest), volts(highest)),
            });
        }
        let temperature = self.read(index, Register::PRESENT_TEMPERATURE)?;
        let hottest = self.read(index, Register::TEMPERATURE_LIMIT)?;
        if temperature >= hottest {
            return Err(BusError::Unfit {
                servo: self.id_of(index),
                what: "temperature",
                actual: format!("{temperature} C"),
                wanted: format!("below {hottest} C"),
            });
        }
        self.check_goal_range(index)
    }

    /// The servo's own position limits must hold the joint's range.
    fn check_goal_range(&mut self, index: usize) -> Result<(), BusError> {
        let own_lowest = self.read(index, Register::MIN_POSITION)? as u32 as i32;
        let own_highest = self.read(index, Register::MAX_POSITION)? as u32 as i32;
        let (lowest, highest) = self.servos[index].goal_range_ticks();
        if lowest >= own_lowest && highest <= own_highest {
            return Ok(());
        }
        Err(BusError::Unfit {
            servo: self.id_of(index),
            what: "position limits in the servo, ticks,",
            actual: format!("{own_lowest} to {own_highest}"),
            wanted: format!("at least {lowest} to {highest}"),
        })
    }

    fn check_hardware(&mut self, index: usize) -> Result<(), BusError> {
        let flags = self.read(index, Register::HARDWARE_ERROR)? as u8;
        if flags == 0 {
            return Ok(());
        }
        Err(BusError::Hardware {
            servo: self.id_of(index),
            flags: hardware_error_names(flags),
        })
    }

    /// Torque off, then the settings this driver relies on.
    fn prepare(&mut self, index: usize, notes: &mut Vec<String>) -> Result<(), BusError> {
        self.settle(index, Register::TORQUE, 0, notes)?;
        self.settle(index, Register::STATUS_RETURN_LEVEL, 2, notes)?;
        self.settle(index, Register::RETURN_DELAY, 0, notes)?;
        self.settle(index, Register::DRIVE_MODE, 0, notes)?;
        self.settle(index, Register::OPERATING_MODE, 3, notes)?;
        // A tripped watchdog refuses goals until it is cleared.
        self.write(index, Register::BUS_WATCHDOG, 0)?;
        self.settle(index, Register::PROFILE_ACCELERATION, 0, notes)?;
        self.settle(index, Register::PROFILE_VELOCITY, 0, notes)
    }

    /// The goal that keeps a joint where it stands.
    fn holding_goal(&self, index: usize) -> Result<i32, BusError> {
        let servo = &self.servos[index];
        let (ticks, ..) = parse_present(&self.present[index]);
        let position = servo.position_rad(ticks);
        let limits = servo.limits;
        let outside = (limits.lower_rad - position).max(position - limits.upper_rad);
        if outside > REST_TOLERANCE_RAD {
            return Err(BusError::Unfit {
                servo: self.id_of(index),
                what: "position",
                actual: format!("{:.1} degrees", position.to_degrees()),
                wanted: format!(
                    "{:.1} to {:.1} degrees: move the joint there by hand",
                    limits.lower_rad.to_degrees(),
                    limits.upper_rad.to_degrees()
                ),
            });
        }
        Ok(servo.goal_ticks(position))
    }

    /// Everything between a silent bus and torque.
    fn bring_up(&mut self) -> Result<ArmReport, BusError> {
        let mut notes: Vec<String> = self.wire.latency_note().into_iter().collect();
        let firmware = self.ping_all()?;
        for index in 0..self.servos.len() {
            self.check_fit(index)?;
            self.prepare(index, &mut notes)?;
        }
        self.choose_read(&firmware, &mut notes)?;
        self.read_present()?;
        let goals: Vec<i32> = (0..self.servos.len())
            .map(|index| self.holding_goal(index))
            .collect::<Result<_, _>>()?;
        let watchdog = u64::from(self.config.watchdog_ms / 20);
        for (index, &goal) in goals.iter().enumerate() {
            self.set(index, Register::GOAL_POSITION, goal as u32 as u64)?;
            self.set(index, Register::BUS_WATCHDOG, watchdog)?;
        }
        // From here on torque may be on, whatever goes wrong.
        self.armed = true;
        self.sync_write(Register::TORQUE, |_, _| 1)?;
        for index in 0..self.servos.len() {
            self.expect(index, Register::TORQUE, 1)?;
        }
        self.read_present()?;
        let mut states = vec![JointState::default(); self.servos.len()];
        self.copy_states(&mut states);
        Ok(ArmReport { states, notes })
    }

    fn expect(&mut self, index: usize, register: Register, value: u64) -> Result<(), BusError> {
        let actual = self.read(index, register)?;
        if actual == value {
            return Ok(());
        }
        Err(BusError::ReadBack {
            servo: self.id_of(index),
            register: register.name,
            wanted: value as i64,
            actual: actual as i64,
        })
    }

    /// Fast Sync Read where the firmware has it and a probe succeeds.
    fn choose_read(&mut self, firmware: &[u8], notes: &mut Vec<String>) -> Result<(), BusError> {
        self.fast = false;
        let old = self
            .servos
            .iter()
            .zip(firmware)
            .position(|(servo, &version)| version < servo.model.fast_read_firmware);
        if let Some(index) = old {
            let servo = self.id_of(index);
            notes.push(format!(
                "plain Sync Read: {servo} runs firmware {}, Fast Sync Read needs {}",
                firmware[index], self.servos[index].model.fast_read_firmware
            ));
            return Ok(());
        }
        for _ in 0..self.tries {
            if self.fast_read()? {
                self.fast = true;
                return Ok(());
            }
        }
        notes.push("plain Sync Read: the bus did not answer the Fast Sync Read probe".into());
        Ok(())
    }

    /// Address, size and the ids that `wanted` keeps.
    fn read_request(&mut self, wanted: impl Fn(usize) -> bool) -> usize {
        self.params.clear();
        self.params.extend(Register::PRESENT.address.to_le_bytes());
        self.params.extend(Register::PRESENT.size.to_le_bytes());
        for (index, servo) in self.servos.iter().enumerate() {
            if wanted(index) {
                self.params.push(servo.id);
            }
        }
        self.params.len() - 4
    }

    /// One Fast Sync Read of everyone; false if the reply was not whole.
    fn fast_read(&mut self) -> Result<bool, BusError> {
        const DOING: &str = "present state";
        self.answered.fill(false);
        let size = usize::from(Register::PRESENT.size);
        let count = self.read_request(|_| true);
        let length = 1 + count * (size + 4);
        self.wire
            .send(BROADCAST, FAST_SYNC_READ, &self.params, length, DOING)?;
        let deadline = self.deadline(14 + count, 7 + length, 1);
        loop {
            match self.wire.receive(deadline, DOING)? {
                Received::Packet => {}
                Received::Corrupt | Received::Nothing => return Ok(false),
            }
            let packet = self.wire.packet();
            if packet.id != BROADCAST {
                continue;
            }
            let mut alert = None;
            let mut blocks = 0;
            for (index, (error, id, data)) in packet.blocks(size).enumerate() {
                let expected = self.servos.get(index).is_some_and(|servo| servo.id == id);
                if !expected || error & 0x7F != 0 {
                    return Ok(false);
                }
                self.present[index].copy_from_slice(data);
                self.answered[index] = true;
                alert = alert.or((error & 0x80 != 0).then_some(index));
                blocks += 1;
            }
            return self.judge_alert(alert).map(|()| blocks == count);
        }
    }

    /// One plain Sync Read of those who have not answered yet.
    fn plain_read(&mut self) -> Result<bool, BusError> {
        const DOING: &str = "present state";
        let size = usize::from(Register::PRESENT.size);
        let answered = std::mem::take(&mut self.answered);
        let count = self.read_request(|index| !answered[index]);
        self.answered = answered;
        let longest = STATUS_LENGTH + size + size / 3;
        self.wire.send(
            BROADCAST,
            instruction::SYNC_READ,
            &self.params,
            longest,
            DOING,
        )?;
        let deadline = self.deadline(14 + count, count * (STATUS_BYTES + size), count);
        let mut alert = None;
        let mut open = count;
        let mut damaged = 0;
        while open > 0 {
            match self.wire.receive(deadline, DOING)? {
                Received::Packet => {}
                // Whoever was damaged does not speak again: do not wait for it.
                Received::Corrupt if damaged + 1 >= open => break,
                Received::Corrupt => {
                    damaged += 1;
                    continue;
                }
                Received::Nothing => break,
            }
            let packet = self.wire.packet();
            let index = self.servos.iter().position(|servo| servo.id == packet.id);
            let Some(index) = index.filter(|&index| !self.answered[index]) else {
                continue;
            };
            if packet.error() != 0 {
                return Err(BusError::Refused {
                    servo: self.id_of(index),
                    doing: DOING,
                    refusal: Refusal(packet.error()),
                });
            }
            if packet.params().len() == size {
                self.present[index].copy_from_slice(packet.params());
                self.answered[index] = true;
                alert = alert.or(packet.alert().then_some(index));
                open -= 1;
            }
        }
        self.judge_alert(alert).map(|()| open == 0)
    }

    /// An alert bit means that the hardware error register has something to say.
    fn judge_alert(&mut self, alert: Option<usize>) -> Result<(), BusError> {
        alert.map_or(Ok(()), |index| self.check_hardware(index))
    }

    /// Reads everyone's state, with retries.
    fn read_present(&mut self) -> Result<(), BusError> {
        self.answered.fill(false);
        let damaged = self.wire.stats.crc_errors;
        for attempt in 0..self.tries {
            self.wire.stats.retries += u64::from(attempt > 0);
            let complete = if self.fast {
                self.fast_read()?
            } else {
                self.plain_read()?
            };
            if complete {
                return Ok(());
            }
        }
        let corrupt = self.wire.stats.crc_errors > damaged;
        Err(self.name_the_silent(corrupt))
    }

    /// One missing servo silences those behind it: ask each by itself, once,
    /// who it is. Where nobody answers at all, the first few speak for all.
    fn name_the_silent(&mut self, corrupt: bool) -> BusError {
        const ENOUGH: usize = 3;
        let missing: Vec<usize> = (0..self.servos.len())
            .filter(|&index| !self.answered[index])
            .collect();
        let mut silent = Vec::new();
        let mut heard = missing.len() < self.servos.len();
        for &index in &missing {
            if !heard && silent.len() == ENOUGH {
                silent = missing.clone();
                break;
            }
            match self.once(|bus| bus.transfer(index, instruction::PING, &[], 3, "ping")) {
                Err(BusError::Silent { .. }) => silent.push(index),
                Ok(_) | Err(BusError::Refused { .. } | BusError::Corrupt { .. }) => heard = true,
                Err(error) => return error,
            }
        }
        let corrupt = corrupt && silent.is_empty();
        let named = if silent.is_empty() { missing } else { silent };
        self.unanswered(self.ids_of(&named), corrupt, "present state")
    }

    /// Does something without retries.
    fn once<T>(&mut self, exchange: impl FnOnce(&mut Self) -> T) -> T {
        let tries = std::mem::replace(&mut self.tries, 1);
        let result = exchange(self);
        self.tries = tries;
        result
    }

    fn copy_states(&self, states: &mut [JointState]) {
        for ((state, servo), present) in states.iter_mut().zip(&self.servos).zip(&self.present) {
            let (ticks, velocity, current) = parse_present(present);
            *state = servo.state(ticks, velocity, current);
        }
    }

    fn check_lengths(&self, targets: usize, states: usize) -> Result<(), BusError> {
        for (actual, what) in [(targets, "targets"), (states, "states")] {
            if actual != self.servos.len() {
                return Err(BusError::Length {
                    servos: self.servos.len(),
                    actual,
                    what,
                });
            }
        }
        Ok(())
    }

    /// Torque off to everyone, and the servos of which that is not certain.
    fn torque_off(&mut self) -> Result<(), BusError> {
        // Broadcast first: it needs no reply and reaches everyone at once.
        let mut reason = String::new();
        for _ in 0..self.tries {
            if let Err(error) = self.sync_write(Register::TORQUE, |_, _| 0) {
                reason = error.to_string();
            }
        }
        let mut doubtful = Vec::new();
        for index in 0..self.servos.len() {
            // After the first silent servo the others get one try each.
            let confirmed = if doubtful.is_empty() {
                self.set(index, Register::TORQUE, 0)
            } else {
                self.once(|bus| bus.set(index, Register::TORQUE, 0))
            };
            if let Err(error) = confirmed {
                reason = error.to_string();
                doubtful.push(index);
            }
        }
        if doubtful.is_empty() {
            return Ok(());
        }
        Err(BusError::TorqueUnverified {
            servos: self.ids_of(&doubtful),
            reason,
        })
    }
}

/// Position (ticks), velocity and current (raw, signed) from the ten bytes at 126.
fn parse_present(bytes: &[u8; 10]) -> (i32, i32, i16) {
    let [c0, c1, v0, v1, v2, v3, p0, p1, p2, p3] = *bytes;
    (
        i32::from_le_bytes([p0, p1, p2, p3]),
        i32::from_le_bytes([v0, v1, v2, v3]),
        i16::from_le_bytes([c0, c1]),
    )
}

impl Bus for DynamixelBus {
    fn servos(&self) -> &[Servo] {
        &self.servos
    }

    fn arm(&mut self) -> Result<ArmReport, BusError> {
        self.bring_up().inspect_err(|_| {
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
        self.check_lengths(targets_rad.len(), states.len())?;
        if let Some(index) = targets_rad.iter().position(|target| !target.is_finite()) {
            return Err(BusError::NotFinite {
                servo: self.id_of(index),
                target: targets_rad[index],
            });
        }
        self.sync_write(Register::GOAL_POSITION, |index, servo| {
            servo.goal_ticks(targets_rad[index])
        })?;
        self.read_present()?;
        self.copy_states(states);
        self.wire.stats.cycles += 1;
        Ok(())
    }

    fn disarm(&mut self) -> Result<(), BusError> {
        self.torque_off()?;
        self.armed = false;
        Ok(())
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn stats(&self) -> BusStats {
        self.wire.stats
    }
}

impl Drop for DynamixelBus {
    fn drop(&mut self) {
        if !self.armed {
            return;
        }
        if let Err(error) = self.disarm() {
            eprintln!("{error}; the servos' own watchdog stops them");
        }
    }
}
