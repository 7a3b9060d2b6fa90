//! Simulated CiA 402 drives: object dictionary, PDOs on SYNC, state machine.
//!
//! Cyclic synchronous position only; other modes are refused. PDOs can be
//! mapped, but only as objects in the order of the mapping parameters.

mod objects;

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use servodance_drivers::can::CanFrame;
use servodance_drivers::can::cia402::registers::{
    self, ABORT, CYCLIC_POSITION, DOWNLOADED, EMERGENCY, HEARTBEAT, NMT_PRE_OPERATIONAL, NMT_START,
    OPERATIONAL, PDO_OFF, RPDO, RPDO_PARAMETERS, SDO_ANSWER, SDO_REQUEST, SYNC, TPDO,
    TPDO_PARAMETERS, UPLOAD, mapped,
};

use crate::can::motor_core::{MotorCore, MotorFault, TorqueCommand};
use crate::can::net::CanDevice;

use self::objects::{
    self as at, ABORT_LENGTH, ABORT_NO_OBJECT, ABORT_NO_SUBINDEX, ABORT_READ_ONLY, ABORT_STATE,
    WRITABLE,
};

/// NMT states and commands that the driver does not use.
const PRE_OPERATIONAL: u8 = 127;
const STOPPED: u8 = 4;
const NMT_STOP: u8 = 2;
const NMT_RESET: u8 = 129;
const NMT_RESET_COMMUNICATION: u8 = 130;
const HEARTBEAT_S: f64 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DriveState {
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
    Fault,
}

/// One CiA 402 drive.
#[derive(Debug)]
pub(crate) struct Cia402Drive {
    core: MotorCore,
    nmt: u8,
    state: DriveState,
    /// Values by index << 8 | subindex.
    objects: BTreeMap<u32, u32>,
    /// The target of the last RPDO, to take effect at the next SYNC.
    control_waiting: Option<u32>,
    watched: bool,
    last_emergency: Option<MotorFault>,
    next_heartbeat_s: f64,
}

impl Cia402Drive {
    /// A drive fresh from the factory but for its node id.
    pub fn new(core: MotorCore) -> Self {
        let mut drive = Self {
            core,
            nmt: PRE_OPERATIONAL,
            state: DriveState::SwitchOnDisabled,
            objects: BTreeMap::new(),
            control_waiting: None,
            watched: false,
            last_emergency: None,
            next_heartbeat_s: HEARTBEAT_S,
        };
        drive.restart();
        drive
    }

    fn id(&self) -> u32 {
        u32::from(self.core.id)
    }

    fn stored(&self, object: u32) -> u32 {
        self.objects.get(&object).copied().unwrap_or(0)
    }

    fn counts_per_rad(&self) -> f64 {
        self.core.settings.gear_ratio * self.core.settings.counts_per_turn / TAU
    }

    fn error_code(&self) -> u16 {
        let codes = [0, 0x3220, 0x3210, 0x4310, 0x7121, 0x8130];
        self.core.fault_code(codes)
    }

    fn settle(&mut self) {
        if self.core.fault.is_some() {
            self.state = DriveState::Fault;
        }
    }

    fn status_word(&self) -> u32 {
        // Voltage enabled, remote.
        0x0210
            | match self.state {
                DriveState::SwitchOnDisabled => 0x40,
                DriveState::ReadyToSwitchOn => 0x21,
                DriveState::SwitchedOn => 0x23,
                DriveState::OperationEnabled => 0x27,
                DriveState::Fault => 0x08,
            }
    }

    /// An object's value and bytes.
    fn read(&self, object: u32) -> Option<(u32, u8)> {
        let position = (self.core.angle_rad() * self.counts_per_rad()).round() as i32;
        let torque = self.core.torque_nm / self.core.settings.model.torque_nm;
        Some(match object {
            at::DEVICE_TYPE => (0x0002_0192, 4),
            0x100100 => (u32::from(self.core.fault.is_some()), 1),
            0x101800 => (4, 1),
            0x101801..=0x101804 => (0, 4),
            0x101600 => (1, 1),
            at::ERROR_CODE => (u32::from(self.error_code()), 2),
            at::STATUS => (self.status_word(), 2),
            at::MODE_SHOWN => (self.stored(at::MODE), 1),
            at::POSITION => (position as u32, 4),
            at::VELOCITY => {
                let velocity = (self.core.speed_rad_s() * self.counts_per_rad()).round() as i32;
                (velocity as u32, 4)
            }
            at::SUPPORTED_MODES => (1 << (CYCLIC_POSITION - 1), 4),
            at::TORQUE => ((torque * 1000.0).round() as i16 as u16 as u32, 2),
            _ => {
                let known = WRITABLE.iter().find(|(known, _)| *known == object);
                (self.stored(object), known?.1)
            }
        })
    }

    /// Why an object is not there: its index, or its subindex alone.
    fn missing(&self, object: u32) -> u32 {
        let index = object >> 8;
        let has_index = (0..=4).any(|sub| self.read(index << 8 | sub).is_some());
        if has_index { ABORT_NO_SUBINDEX } else { ABORT_NO_OBJECT }
    }

    /// Writes an object of so many bytes, if the host says how many.
    fn write(&mut self, object: u32, value: u32, said: Option<u8>) -> Result<(), u32> {
        let Some((_, bytes)) = WRITABLE.iter().find(|(known, _)| *known == object) else {
            return Err(match self.read(object) {
                Some(_) => ABORT_READ_ONLY,
                None => self.missing(object),
            });
        };
        if said.is_some_and(|said| said != *bytes) {
            return Err(ABORT_LENGTH);
        }
        let is_mapping = matches!(object >> 16, 0x14 | 0x16 | 0x18 | 0x1A);
        if is_mapping && self.nmt == OPERATIONAL {
            return Err(ABORT_STATE);
        }
        let unused = 8 * (4 - u32::from(*bytes));
        self.objects.insert(object, value << unused >> unused);
        match object {
            at::CONTROL => self.control(value),
            at::MAX_TORQUE => {
                let share = f64::from(value) / 1000.0;
                let most_nm = self.core.settings.model.torque_nm;
                self.core.torque_limit_nm = (share * most_nm).min(most_nm);
            }
            at::CONSUMER => {
                self.watched = false;
                self.core.timeout_s = None;
            }
            _ => {}
        }
        Ok(())
    }

    fn control(&mut self, word: u32) {
        self.settle();
        self.state = match (self.state, word & 0x8F) {
            (DriveState::Fault, command) if command & 0x80 != 0 => {
                self.core.fault = None;
                self.last_emergency = None;
                DriveState::SwitchOnDisabled
            }
            (DriveState::Fault, _) => DriveState::Fault,
            // Disable voltage, quick stop.
            (_, command) if command & 0x02 == 0 || command & 0x04 == 0 => {
                DriveState::SwitchOnDisabled
            }
            (DriveState::SwitchOnDisabled, 0x06) => DriveState::ReadyToSwitchOn,
            (DriveState::ReadyToSwitchOn, 0x07) => DriveState::SwitchedOn,
            (DriveState::SwitchedOn, 0x0F) if self.stored(at::MODE) == CYCLIC_POSITION => {
                DriveState::OperationEnabled
            }
            (DriveState::SwitchedOn | DriveState::OperationEnabled, 0x06) => {
                DriveState::ReadyToSwitchOn
            }
            (DriveState::OperationEnabled, 0x07) => DriveState::SwitchedOn,
            (state, _) => state,
        };
        if self.state != DriveState::OperationEnabled {
            self.core.disable();
        } else if !self.core.enabled {
            self.core.enable();
            self.follow();
        }
    }

    /// The target becomes a goal of the drive's own loop, which has stock gains.
    fn follow(&mut self) {
        let target = self.stored(at::TARGET) as i32;
        self.core.command(TorqueCommand {
            goal_rad: f64::from(target) / self.counts_per_rad(),
            kp: self.core.settings.kp,
            kd: self.core.settings.kd,
            ..TorqueCommand::default()
        });
    }

    fn sdo(&mut self, data: [u8; 8]) -> CanFrame {
        let [command, low, high, sub, value @ ..] = data;
        let object = u32::from(u16::from_le_bytes([low, high])) << 8 | u32::from(sub);
        let answer = match command {
            UPLOAD => match self.read(object) {
                Some((value, bytes)) => Ok((0x43 | (4 - bytes) << 2, value)),
                None => Err(self.missing(object)),
            },
            0x23 | 0x27 | 0x2B | 0x2F | 0x22 => {
                let said = (command & 1 == 1).then_some(4 - (command >> 2 & 3));
                let written = self.write(object, u32::from_le_bytes(value), said);
                written.map(|()| (DOWNLOADED, 0))
            }
            // Segmented and block transfers are not there.
            _ => Err(0x0504_0001),
        };
        let (said, value) = answer.unwrap_or_else(|abort| (ABORT, abort));
        let [a, b, c, d] = value.to_le_bytes();
        let data = [said, low, high, sub, a, b, c, d];
        CanFrame::standard(SDO_ANSWER + self.id(), &data)
    }

    /// Objects of a mapping: number and bytes.
    fn mapping(&self, mapping: u32) -> Vec<(u32, usize)> {
        let count = self.stored(mapping << 8).min(3);
        (1..=count)
            .map(|entry| self.stored(mapping << 8 | entry))
            .map(|mapped| (mapped >> 8, (mapped as usize & 0xFF) / 8))
            .collect()
    }

    fn take_rpdo(&mut self, data: &[u8]) {
        let mut rest = data;
        for (object, bytes) in self.mapping(RPDO_PARAMETERS.1.into()) {
            let Some((taken, later)) = rest.split_at_checked(bytes.min(4)) else {
                return;
            };
            let append = |sum, byte: &u8| sum << 8 | u32::from(*byte);
            let value = taken.iter().rev().fold(0, append);
            match object {
                at::CONTROL => self.control_waiting = Some(value),
                at::TARGET => {
                    self.objects.insert(object, value);
                }
                _ => {}
            }
            rest = later;
        }
    }

    fn sync(&mut self, out: &mut Vec<CanFrame>) {
        if let Some(word) = self.control_waiting.take() {
            self.control(word);
            if self.core.enabled {
                self.follow();
            }
        }
        let id = self.stored(at::TPDO_ID);
        if id & PDO_OFF != 0 {
            return;
        }
        let mut data = Vec::with_capacity(8);
        for (object, bytes) in self.mapping(TPDO_PARAMETERS.1.into()) {
            let (value, _) = self.read(object).unwrap_or((0, 4));
            data.extend(value.to_le_bytes().iter().take(bytes));
        }
        out.push(CanFrame::standard(id, &data));
    }

    fn set_nmt(&mut self, command: u8, out: &mut Vec<CanFrame>) {
        match command {
            NMT_START => self.nmt = OPERATIONAL,
            NMT_STOP => self.nmt = STOPPED,
            NMT_PRE_OPERATIONAL => self.nmt = PRE_OPERATIONAL,
            NMT_RESET | NMT_RESET_COMMUNICATION => {
                self.core.disable();
                self.restart();
                out.push(CanFrame::standard(HEARTBEAT + self.id(), &[0]));
            }
            _ => return,
        }
        if self.nmt != OPERATIONAL && self.core.enabled {
            self.state = DriveState::SwitchOnDisabled;
            self.core.disable();
        }
    }

    /// A heartbeat of the node that 1016 names.
    fn heartbeat_of(&mut self, node: u32) {
        let watched = self.stored(at::CONSUMER);
        if watched >> 16 & 0x7F != node || watched & 0xFFFF == 0 {
            return;
        }
        self.watched = true;
        self.core.timeout_s = Some(f64::from(watched & 0xFFFF) * 1e-3);
        self.core.silent_s = 0.0;
    }
}

impl CanDevice for Cia402Drive {
    fn core(&self) -> &MotorCore {
        &self.core
    }

    fn core_mut(&mut self) -> &mut MotorCore {
        &mut self.core
    }

    fn receive(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if frame.is_extended() || frame.is_remote() {
            return;
        }
        self.settle();
        let (id, data) = (frame.id(), frame.data());
        match (id, data) {
            (0, &[command, node]) if node == 0 || node == self.core.id => {
                self.set_nmt(command, out);
            }
            (SYNC, _) if self.nmt == OPERATIONAL => self.sync(out),
            (0x701..=0x77F, _) => self.heartbeat_of(id - HEARTBEAT),
            _ if id == SDO_REQUEST + self.id() && self.nmt != STOPPED => {
                if let Some(data) = frame.eight() {
                    out.push(self.sdo(data));
                }
            }
            _ if id == self.stored(at::RPDO_ID) && self.nmt == OPERATIONAL => self.take_rpdo(data),
            _ => {}
        }
    }

    fn due(&mut self, out: &mut Vec<CanFrame>) {
        self.settle();
        if self.core.fault != self.last_emergency {
            self.last_emergency = self.core.fault;
            let [low, high] = self.error_code().to_le_bytes();
            let register = u8::from(self.last_emergency.is_some());
            let data = [low, high, register, 0, 0, 0, 0, 0];
            out.push(CanFrame::standard(EMERGENCY + self.id(), &data));
        }
        if self.core.body.time_s >= self.next_heartbeat_s {
            self.next_heartbeat_s = self.core.body.time_s + HEARTBEAT_S;
            out.push(CanFrame::standard(HEARTBEAT + self.id(), &[self.nmt]));
        }
    }

    fn renamed(&mut self) {
        self.objects.insert(at::RPDO_ID, RPDO + self.id());
        self.objects.insert(at::TPDO_ID, TPDO + self.id());
    }

    fn restart(&mut self) {
        let id = self.id();
        self.nmt = PRE_OPERATIONAL;
        self.state = DriveState::SwitchOnDisabled;
        self.control_waiting = None;
        self.watched = false;
        self.last_emergency = None;
        self.objects.clear();
        for (object, value) in [
            (at::RPDO_ID, RPDO + id),
            (at::TPDO_ID, TPDO + id),
            (0x160000, 2),
            (0x160001, mapped(registers::CONTROL)),
            (0x160002, mapped(registers::TARGET)),
            (0x1A0000, 2),
            (0x1A0001, mapped(registers::STATUS)),
            (0x1A0002, mapped(registers::POSITION)),
            (at::MAX_TORQUE, 1000),
            (at::ABORT_OPTION, 1),
        ] {
            self.objects.insert(object, value);
        }
    }
}
