//! Simulated CiA 402 drives: object dictionary, PDOs on SYNC, state machine.
//!
//! Cyclic synchronous position only; other modes are refused. PDOs can be
//! mapped, but only as objects in the order of the mapping parameters.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use servodance_drivers::can::CanFrame;

use crate::can::core::{Command, Core, Trouble};
use crate::can::net::Device;

const PRE_OPERATIONAL: u8 = 127;
const OPERATIONAL: u8 = 5;
const STOPPED: u8 = 4;
const HEARTBEAT_S: f64 = 0.1;
const CYCLIC_POSITION: u32 = 8;
const PDO_OFF: u32 = 1 << 31;

const ABORT_READ_ONLY: u32 = 0x0601_0002;
const ABORT_NO_OBJECT: u32 = 0x0602_0000;
const ABORT_STATE: u32 = 0x0800_0022;

/// Objects that can be written, with their bytes; what they hold at first is 0.
const WRITABLE: [(u32, u8); 20] = [
    (0x101601, 4),
    (0x101700, 2),
    (0x140001, 4),
    (0x140002, 1),
    (0x160000, 1),
    (0x160001, 4),
    (0x160002, 4),
    (0x160003, 4),
    (0x180001, 4),
    (0x180002, 1),
    (0x1A0000, 1),
    (0x1A0001, 4),
    (0x1A0002, 4),
    (0x1A0003, 4),
    (0x600700, 2),
    (0x604000, 2),
    (0x606000, 1),
    (0x607200, 2),
    (0x607A00, 4),
    (0x60C201, 1),
];

/// The drive's states, as the status word shows them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
    Fault,
}

/// One drive.
#[derive(Debug)]
pub struct Cia402Drive {
    core: Core,
    nmt: u8,
    state: State,
    /// Values by index << 8 | subindex.
    objects: BTreeMap<u32, u32>,
    /// The target of the last RPDO, to take effect at the next SYNC.
    control_waiting: Option<u32>,
    watched: bool,
    /// The last emergency that was sent.
    told: Option<Trouble>,
    next_heartbeat_s: f64,
}

impl Cia402Drive {
    /// A drive fresh from the factory but for its node id.
    pub fn new(core: Core) -> Self {
        let mut drive = Self {
            core,
            nmt: PRE_OPERATIONAL,
            state: State::SwitchOnDisabled,
            objects: BTreeMap::new(),
            control_waiting: None,
            watched: false,
            told: None,
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
        match self.core.trouble {
            None => 0,
            Some(Trouble::OverVoltage) => 0x3210,
            Some(Trouble::UnderVoltage) => 0x3220,
            Some(Trouble::Overheat) => 0x4310,
            Some(Trouble::Overload) => 0x7121,
            Some(Trouble::CommunicationLost) => 0x8130,
        }
    }

    /// Trouble of the motor shows in the state.
    fn settle(&mut self) {
        if self.core.trouble.is_some() {
            self.state = State::Fault;
        }
    }

    fn status_word(&self) -> u32 {
        // Voltage enabled, remote.
        0x0210
            | match self.state {
                State::SwitchOnDisabled => 0x40,
                State::ReadyToSwitchOn => 0x21,
                State::SwitchedOn => 0x23,
                State::OperationEnabled => 0x27,
                State::Fault => 0x08,
            }
    }

    /// An object's value and bytes.
    fn read(&self, object: u32) -> Option<(u32, u8)> {
        let position = (self.core.angle_rad() * self.counts_per_rad()).round() as i32;
        let torque = self.core.torque_nm() / self.core.settings.model.torque_nm;
        Some(match object {
            0x100000 => (0x0002_0192, 4),
            0x100100 => (u32::from(self.core.trouble.is_some()), 1),
            0x101800 => (4, 1),
            0x101801..=0x101804 => (0, 4),
            0x101600 => (1, 1),
            0x603F00 => (u32::from(self.error_code()), 2),
            0x604100 => (self.status_word(), 2),
            0x606100 => (self.stored(0x606000), 1),
            0x606400 => (position as u32, 4),
            0x607700 => ((torque * 1000.0).round() as i16 as u16 as u32, 2),
            _ => {
                let known = WRITABLE.iter().find(|(known, _)| *known == object);
                (self.stored(object), known?.1)
            }
        })
    }

    fn write(&mut self, object: u32, value: u32) -> Result<(), u32> {
        let Some((_, bytes)) = WRITABLE.iter().find(|(known, _)| *known == object) else {
            return Err(match self.read(object) {
                Some(_) => ABORT_READ_ONLY,
                None => ABORT_NO_OBJECT,
            });
        };
        let is_mapping = matches!(object >> 16, 0x14 | 0x16 | 0x18 | 0x1A);
        if is_mapping && self.nmt == OPERATIONAL {
            return Err(ABORT_STATE);
        }
        let unused = 8 * (4 - u32::from(*bytes));
        self.objects.insert(object, value << unused >> unused);
        match object {
            0x604000 => self.control(value),
            0x607200 => {
                let share = f64::from(value) / 1000.0;
                let most_nm = self.core.settings.model.torque_nm;
                self.core.torque_limit_nm = (share * most_nm).min(most_nm);
            }
            0x101601 => {
                self.watched = false;
                self.core.timeout_s = None;
            }
            _ => {}
        }
        Ok(())
    }

    /// The control word moves the state machine.
    fn control(&mut self, word: u32) {
        self.settle();
        self.state = match (self.state, word & 0x8F) {
            (State::Fault, command) if command & 0x80 != 0 => {
                self.core.clear();
                self.told = None;
                State::SwitchOnDisabled
            }
            (State::Fault, _) => State::Fault,
            // Disable voltage, quick stop.
            (_, command) if command & 0x02 == 0 || command & 0x04 == 0 => State::SwitchOnDisabled,
            (State::SwitchOnDisabled, 0x06) => State::ReadyToSwitchOn,
            (State::ReadyToSwitchOn, 0x07) => State::SwitchedOn,
            (State::SwitchedOn, 0x0F) if self.stored(0x606000) == CYCLIC_POSITION => {
                State::OperationEnabled
            }
            (State::SwitchedOn | State::OperationEnabled, 0x06) => State::ReadyToSwitchOn,
            (State::OperationEnabled, 0x07) => State::SwitchedOn,
            (state, _) => state,
        };
        if self.state != State::OperationEnabled {
            self.core.disable();
        } else if !self.core.enabled() {
            self.core.enable();
            self.follow();
        }
    }

    /// The target becomes a goal of the drive's own loop, which has stock gains.
    fn follow(&mut self) {
        let target = self.stored(0x607A00) as i32;
        let (kp, kd) = (self.core.settings.kp, self.core.settings.kd);
        self.core.command(Command {
            goal_rad: f64::from(target) / self.counts_per_rad(),
            speed_rad_s: 0.0,
            kp,
            kd,
            torque_nm: 0.0,
        });
    }

    fn sdo(&mut self, data: [u8; 8]) -> CanFrame {
        let [command, low, high, sub, value @ ..] = data;
        let object = u32::from(u16::from_le_bytes([low, high])) << 8 | u32::from(sub);
        let answer = match command {
            0x40 => match self.read(object) {
                Some((value, bytes)) => Ok((0x43 | (4 - bytes) << 2, value)),
                None => Err(ABORT_NO_OBJECT),
            },
            0x23 | 0x27 | 0x2B | 0x2F | 0x22 => {
                let written = self.write(object, u32::from_le_bytes(value));
                written.map(|()| (0x60, 0))
            }
            // Segmented and block transfers are not there.
            _ => Err(0x0504_0001),
        };
        let (said, value) = answer.unwrap_or_else(|abort| (0x80, abort));
        let [a, b, c, d] = value.to_le_bytes();
        let data = [said, low, high, sub, a, b, c, d];
        CanFrame::standard(0x580 + self.id(), &data)
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
        for (object, bytes) in self.mapping(0x1600) {
            let Some((taken, later)) = rest.split_at_checked(bytes.min(4)) else {
                return;
            };
            let append = |sum, byte: &u8| sum << 8 | u32::from(*byte);
            let value = taken.iter().rev().fold(0, append);
            match object {
                0x604000 => self.control_waiting = Some(value),
                0x607A00 => {
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
            if self.core.enabled() {
                self.follow();
            }
        }
        let id = self.stored(0x180001);
        if id & PDO_OFF != 0 {
            return;
        }
        let mut data = Vec::with_capacity(8);
        for (object, bytes) in self.mapping(0x1A00) {
            let (value, _) = self.read(object).unwrap_or((0, 4));
            data.extend(value.to_le_bytes().iter().take(bytes));
        }
        out.push(CanFrame::standard(id, &data));
    }

    fn set_nmt(&mut self, command: u8, out: &mut Vec<CanFrame>) {
        match command {
            1 => self.nmt = OPERATIONAL,
            2 => self.nmt = STOPPED,
            128 => self.nmt = PRE_OPERATIONAL,
            129 | 130 => {
                self.core.disable();
                self.restart();
                out.push(CanFrame::standard(0x700 + self.id(), &[0]));
            }
            _ => return,
        }
        if self.nmt != OPERATIONAL && self.core.enabled() {
            self.state = State::SwitchOnDisabled;
            self.core.disable();
        }
    }

    /// A heartbeat of the node that 1016 names.
    fn heartbeat_of(&mut self, node: u32) {
        let watched = self.stored(0x101601);
        if watched >> 16 & 0x7F != node || watched & 0xFFFF == 0 {
            return;
        }
        self.watched = true;
        self.core.timeout_s = Some(f64::from(watched & 0xFFFF) * 1e-3);
        self.core.feed();
    }
}

impl Device for Cia402Drive {
    fn core(&self) -> &Core {
        &self.core
    }

    fn core_mut(&mut self) -> &mut Core {
        &mut self.core
    }

    fn hear(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if frame.is_extended() || frame.is_remote() {
            return;
        }
        self.settle();
        let (id, data) = (frame.id(), frame.data());
        match (id, data) {
            (0, &[command, node]) if node == 0 || node == self.core.id => {
                self.set_nmt(command, out);
            }
            (0x080, _) if self.nmt == OPERATIONAL => self.sync(out),
            (0x701..=0x77F, _) => self.heartbeat_of(id - 0x700),
            _ if id == 0x600 + self.id() && self.nmt != STOPPED => {
                if let Some(data) = frame.eight() {
                    out.push(self.sdo(data));
                }
            }
            _ if id == self.stored(0x140001) && self.nmt == OPERATIONAL => self.take_rpdo(data),
            _ => {}
        }
    }

    fn due(&mut self, out: &mut Vec<CanFrame>) {
        self.settle();
        if self.core.trouble != self.told {
            self.told = self.core.trouble;
            let [low, high] = self.error_code().to_le_bytes();
            let data = [low, high, u8::from(self.told.is_some()), 0, 0, 0, 0, 0];
            out.push(CanFrame::standard(0x080 + self.id(), &data));
        }
        if self.core.time_s() >= self.next_heartbeat_s {
            self.next_heartbeat_s = self.core.time_s() + HEARTBEAT_S;
            out.push(CanFrame::standard(0x700 + self.id(), &[self.nmt]));
        }
    }

    fn renamed(&mut self) {
        self.objects.insert(0x140001, 0x200 + self.id());
        self.objects.insert(0x180001, 0x180 + self.id());
    }

    fn restart(&mut self) {
        let id = self.id();
        self.nmt = PRE_OPERATIONAL;
        self.state = State::SwitchOnDisabled;
        self.control_waiting = None;
        self.watched = false;
        self.told = None;
        self.objects.clear();
        for (object, value) in [
            (0x140001, 0x200 + id),
            (0x180001, 0x180 + id),
            (0x160000, 2),
            (0x160001, 0x6040_0010),
            (0x160002, 0x607A_0020),
            (0x1A0000, 2),
            (0x1A0001, 0x6041_0010),
            (0x1A0002, 0x6064_0020),
            (0x607200, 1000),
            (0x600700, 1),
        ] {
            self.objects.insert(object, value);
        }
    }
}
