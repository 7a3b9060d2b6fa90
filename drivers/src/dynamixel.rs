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

use dynamixel2::instructions::packet_id::BROADCAST;
use servodance_types::JointState;

use crate::bus::{Bus, BusStats};
use crate::config::BusConfig;
use crate::error::BusError;
use crate::link::Link;
use crate::packet::Protocol;
use crate::register::{Register, hardware_error_names};
use crate::servo::{Servo, check_cycle};
use crate::wire::Received;

/// Fast Sync Read; the `dynamixel2` crate does not know it.
const FAST_SYNC_READ: u8 = 0x8A;
/// Bytes of [`Register::PRESENT`].
const PRESENT_BYTES: usize = 10;

/// One serial bus of Dynamixel servos.
pub struct DynamixelBus {
    link: Link,
    fast: bool,
    armed: bool,
    /// Ten bytes a servo from the last read.
    present: Vec<u8>,
}

impl DynamixelBus {
    /// Opens the port. Nothing is sent before [`Bus::arm`].
    pub fn open(port: &str, config: &BusConfig, servos: Vec<Servo>) -> Result<Self, BusError> {
        Ok(Self {
            present: vec![0; PRESENT_BYTES * servos.len()],
            link: Link::open(port, config, servos, Protocol::Dynamixel2)?,
            fast: false,
            armed: false,
        })
    }

    /// Whether cycles use Fast Sync Read. Known once armed.
    pub fn is_fast(&self) -> bool {
        self.fast
    }

    /// Refuses a servo that should not get torque now.
    fn check_fit(&mut self, index: usize) -> Result<(), BusError> {
        self.check_hardware(index)?;
        let link = &mut self.link;
        let voltage = link.read(index, Register::PRESENT_VOLTAGE)?;
        let lowest = link.read(index, Register::MIN_VOLTAGE)?;
        let highest = link.read(index, Register::MAX_VOLTAGE)?;
        link.check_voltage(index, voltage, lowest, highest)?;
        let temperature = link.read(index, Register::PRESENT_TEMPERATURE)?;
        let hottest = link.read(index, Register::TEMPERATURE_LIMIT)?;
        link.check_temperature(index, temperature, hottest)?;
        let lowest = link.read(index, Register::MIN_POSITION)? as u32 as i32;
        let highest = link.read(index, Register::MAX_POSITION)? as u32 as i32;
        link.check_goal_range(index, (lowest, highest))
    }

    fn check_hardware(&mut self, index: usize) -> Result<(), BusError> {
        let flags = self.link.read(index, Register::HARDWARE_ERROR)? as u8;
        if flags == 0 {
            return Ok(());
        }
        Err(BusError::Hardware {
            servo: self.link.id_of(index),
            flags: format!(
                "{}; only a reboot or a power cycle clears it",
                hardware_error_names(flags)
            ),
        })
    }

    /// Torque off, then the settings this driver relies on.
    fn set_up(&mut self, index: usize, notes: &mut Vec<String>) -> Result<(), BusError> {
        let link = &mut self.link;
        link.settle(index, Register::TORQUE, 0, notes)?;
        link.settle(index, Register::STATUS_RETURN_LEVEL, 2, notes)?;
        link.settle(index, Register::RETURN_DELAY, 0, notes)?;
        link.settle(index, Register::DRIVE_MODE, 0, notes)?;
        link.settle(index, Register::OPERATING_MODE, 3, notes)?;
        // A tripped watchdog refuses goals until it is cleared.
        link.write(index, Register::BUS_WATCHDOG, 0)?;
        link.settle(index, Register::PROFILE_ACCELERATION, 0, notes)?;
        link.settle(index, Register::PROFILE_VELOCITY, 0, notes)
    }

    /// Everything between a silent bus and torque.
    fn check_all(&mut self) -> Result<Vec<String>, BusError> {
        let mut notes: Vec<String> = self.link.wire.latency_note().into_iter().collect();
        let mut firmware = Vec::with_capacity(self.link.servos.len());
        for (index, answer) in self.link.ping_all()?.into_iter().enumerate() {
            let &[low, high, version] = &answer[..] else {
                continue; // `transfer` returns what was asked for
            };
            self.link
                .check_model(index, u16::from_le_bytes([low, high]))?;
            firmware.push(version);
        }
        for index in 0..self.link.servos.len() {
            self.check_fit(index)?;
            self.set_up(index, &mut notes)?;
        }
        self.choose_read(&firmware, &mut notes)?;
        Ok(notes)
    }

    fn torque_on(&mut self) -> Result<Vec<JointState>, BusError> {
        self.read_present()?;
        let present = self.present.chunks_exact(PRESENT_BYTES).enumerate();
        let goals: Vec<i32> = present
            .map(|(index, bytes)| self.link.holding_goal(index, parse_present(bytes).0))
            .collect::<Result<_, _>>()?;
        let watchdog = u64::from(self.link.config.watchdog_ms / 20);
        for (index, &goal) in goals.iter().enumerate() {
            let goal = u64::from(goal as u32);
            self.link.set(index, Register::GOAL_POSITION, goal)?;
            self.link.set(index, Register::BUS_WATCHDOG, watchdog)?;
        }
        // From here on torque may be on, whatever goes wrong.
        self.armed = true;
        self.link.sync_write(Register::TORQUE, |_, _| 1)?;
        for index in 0..self.link.servos.len() {
            self.link.expect(index, Register::TORQUE, 1)?;
        }
        self.read_present()?;
        let mut states = vec![JointState::default(); self.link.servos.len()];
        self.copy_states(&mut states);
        Ok(states)
    }

    /// Fast Sync Read where the firmware has it and a probe succeeds.
    fn choose_read(&mut self, firmware: &[u8], notes: &mut Vec<String>) -> Result<(), BusError> {
        self.fast = false;
        let servos = &self.link.servos;
        let old = servos
            .iter()
            .zip(firmware)
            .position(|(servo, &version)| version < servo.model.fast_read_firmware);
        if let Some(index) = old {
            let servo = self.link.id_of(index);
            notes.push(format!(
                "plain Sync Read: {servo} runs firmware {}, Fast Sync Read needs {}",
                firmware[index], servos[index].model.fast_read_firmware
            ));
            return Ok(());
        }
        for _ in 0..self.link.tries() {
            self.fast_read()?;
            if self.link.complete() {
                self.fast = true;
                return Ok(());
            }
        }
        notes.push("plain Sync Read: the bus did not answer the Fast Sync Read probe".into());
        Ok(())
    }

    /// One Fast Sync Read of everyone; stops at the first damage.
    fn fast_read(&mut self) -> Result<(), BusError> {
        let register = Register::PRESENT;
        self.link.answered.fill(false);
        let count = self.link.read_request(register, |_| true);
        let length = 1 + count * (PRESENT_BYTES + 4);
        self.link
            .send_request(FAST_SYNC_READ, length, register.name)?;
        let deadline = self.link.deadline(14 + count, 7 + length, 1);
        loop {
            match self.link.wire.receive(deadline, register.name)? {
                Received::Packet => {}
                Received::Corrupt | Received::Nothing => return Ok(()),
            }
            let packet = self.link.wire.packet();
            if packet.id != BROADCAST {
                continue;
            }
            let mut alert = None;
            for (index, (error, id, data)) in packet.blocks(PRESENT_BYTES).enumerate() {
                let expected = self.link.servos.get(index);
                if expected.is_none_or(|servo| servo.id != id) || error & 0x7F != 0 {
                    return Ok(());
                }
                self.present[index * PRESENT_BYTES..][..PRESENT_BYTES].copy_from_slice(data);
                self.link.answered[index] = true;
                alert = alert.or((error & 0x80 != 0).then_some(index));
            }
            return self.judge_alert(alert);
        }
    }

    /// An alert bit means that the hardware error register has something to say.
    fn judge_alert(&mut self, alert: Option<usize>) -> Result<(), BusError> {
        alert.map_or(Ok(()), |index| self.check_hardware(index))
    }

    /// Reads everyone's state, with retries.
    fn read_present(&mut self) -> Result<(), BusError> {
        self.link.answered.fill(false);
        let damaged = self.link.wire.stats.crc_errors;
        for attempt in 0..self.link.tries() {
            self.link.wire.stats.retries += u64::from(attempt > 0);
            if self.fast {
                self.fast_read()?;
            } else {
                let alert = self.link.plain_read(Register::PRESENT, &mut self.present)?;
                self.judge_alert(alert)?;
            }
            if self.link.complete() {
                return Ok(());
            }
        }
        let corrupt = self.link.wire.stats.crc_errors > damaged;
        Err(self.link.name_the_silent(corrupt))
    }

    fn copy_states(&self, states: &mut [JointState]) {
        let present = self.present.chunks_exact(PRESENT_BYTES);
        for ((state, servo), present) in states.iter_mut().zip(&self.link.servos).zip(present) {
            let (ticks, velocity, current) = parse_present(present);
            *state = servo.state(ticks, velocity, current);
        }
    }
}

/// Position (ticks), velocity and current (raw, signed) from the ten bytes at 126.
fn parse_present(bytes: &[u8]) -> (i32, i32, i16) {
    let &[c0, c1, v0, v1, v2, v3, p0, p1, p2, p3] = bytes else {
        return (0, 0, 0);
    };
    (
        i32::from_le_bytes([p0, p1, p2, p3]),
        i32::from_le_bytes([v0, v1, v2, v3]),
        i16::from_le_bytes([c0, c1]),
    )
}

impl Bus for DynamixelBus {
    fn servos(&self) -> &[Servo] {
        &self.link.servos
    }

    fn prepare(&mut self) -> Result<Vec<String>, BusError> {
        self.check_all()
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
        self.link
            .sync_write(Register::GOAL_POSITION, |index, servo| {
                servo.goal_ticks(targets_rad[index])
            })?;
        self.read_present()?;
        self.copy_states(states);
        self.link.wire.stats.cycles += 1;
        Ok(())
    }

    fn disarm(&mut self) -> Result<(), BusError> {
        self.link.torque_off(Register::TORQUE)?;
        self.armed = false;
        Ok(())
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn stats(&self) -> BusStats {
        self.link.wire.stats
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
