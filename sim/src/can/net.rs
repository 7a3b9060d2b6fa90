//! Motors on one CAN bus, and arbitration between them.
//!
//! Motors that answer with the same id at once disturb each other: different
//! data destroys both frames, as the error frames of a real bus would in the
//! end; equal data passes as one.

use std::fmt::Debug;

use servodance_drivers::can::CanFrame;

use crate::bus::line::{Burst, Line};
use crate::can::motor_core::MotorCore;
use crate::fault::ServoFault;
use crate::imu::CanBoard;
use crate::judge::Judge;
use crate::servo::body::{ServoBody, SimServoState};

pub(crate) trait CanDevice: Debug + Send {
    fn core(&self) -> &MotorCore;

    fn core_mut(&mut self) -> &mut MotorCore;

    /// Takes a frame; adds the answers to `out`.
    fn receive(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>);

    fn due(&mut self, _out: &mut Vec<CanFrame>) {}

    fn restart(&mut self) {}

    fn renamed(&mut self) {}
}

#[derive(Debug)]
pub(crate) struct CanNet {
    devices: Vec<Box<dyn CanDevice>>,
    board: Option<CanBoard>,
    frames_in: u64,
    collisions: u64,
}

impl CanNet {
    pub fn new(devices: Vec<Box<dyn CanDevice>>, board: Option<CanBoard>) -> Self {
        Self { devices, board, frames_in: 0, collisions: 0 }
    }

    /// The frames that survive of those offered at once, in the order in which the bus
    /// carries them: the lowest id first.
    fn arbitrate(&mut self, mut offered: Vec<(usize, CanFrame)>) -> Vec<CanFrame> {
        offered.sort_by_key(|(device, frame)| (arbitration_key(frame), *device));
        let mut carried: Vec<CanFrame> = Vec::with_capacity(offered.len());
        let mut rest = &offered[..];
        while let [(device, frame), later @ ..] = rest {
            let same = |(other, next): &&(usize, CanFrame)| {
                other != device && arbitration_key(next) == arbitration_key(frame)
            };
            let rivals = later.iter().take_while(same);
            if rivals.clone().all(|(_, rival)| rival == frame) {
                carried.push(*frame);
            } else {
                self.collisions += 1;
            }
            rest = &later[rivals.count()..];
        }
        carried
    }
}

/// Lower wins: the 29-bit id loses against the 11-bit one of the same beginning.
fn arbitration_key(frame: &CanFrame) -> (u32, bool, bool) {
    let id = frame.id();
    let aligned = if frame.is_extended() { id } else { id << 18 };
    (aligned, frame.is_extended(), frame.is_remote())
}

impl Line for CanNet {
    fn push(&mut self, _byte: u8) -> bool {
        false
    }

    fn execute(&mut self, _late_s: f64) -> Vec<Burst> {
        Vec::new()
    }

    fn receive(&mut self, frame: &CanFrame) -> Vec<CanFrame> {
        self.frames_in += 1;
        let mut offered = Vec::new();
        let mut answers = Vec::new();
        for (index, device) in self.devices.iter_mut().enumerate() {
            if device.core().body.listens() {
                device.receive(frame, &mut answers);
                offered.extend(answers.drain(..).map(|answer| (index, answer)));
            }
        }
        self.arbitrate(offered)
    }

    fn due(&mut self) -> Vec<CanFrame> {
        let mut offered = Vec::new();
        let mut sent = Vec::new();
        for (index, device) in self.devices.iter_mut().enumerate() {
            if device.core().body.listens() {
                device.due(&mut sent);
                offered.extend(sent.drain(..).map(|frame| (index, frame)));
            }
        }
        let mut carried = self.arbitrate(offered);
        if let Some(board) = &mut self.board {
            carried.extend(board.due());
        }
        carried
    }

    fn silence_board(&mut self, silent: bool) {
        if let Some(board) = &mut self.board {
            board.silent = silent;
        }
    }

    fn step(&mut self, time_s: f64, dt_s: f64, period_ends: bool) {
        if let Some(board) = &mut self.board {
            board.step(dt_s);
        }
        for device in &mut self.devices {
            device.core_mut().step(time_s, dt_s);
            if period_ends {
                device.core_mut().body.end_period();
            }
        }
    }

    fn each_body(&mut self, each: &mut dyn FnMut(usize, &mut ServoBody)) {
        for (index, device) in self.devices.iter_mut().enumerate() {
            each(index, &mut device.core_mut().body);
        }
    }

    fn judges(&self) -> Vec<&Judge> {
        let devices = self.devices.iter();
        devices.map(|device| &device.core().body.judge).collect()
    }

    fn state(&self, index: usize) -> Option<SimServoState> {
        self.devices.get(index).map(|device| device.core().state())
    }

    fn suffer(&mut self, index: usize, fault: ServoFault) -> bool {
        let Some(device) = self.devices.get_mut(index) else {
            return false;
        };
        if device.core_mut().suffer(fault) {
            device.restart();
        }
        if matches!(fault, ServoFault::Id(_)) {
            device.renamed();
        }
        true
    }

    fn packets(&self) -> (u64, u64) {
        (self.frames_in, self.collisions)
    }
}
