//! Motors on one CAN bus.
//!
//! Motors that answer with the same id at once disturb each other: different
//! data destroys both frames, as the error frames of a real bus would in the
//! end; equal data passes as one.

use std::fmt::Debug;

use servodance_drivers::can::CanFrame;

use crate::body::SimServoState;
use crate::bus::line::{Burst, Line};
use crate::can::core::Core;
use crate::fault::ServoFault;
use crate::judge::Judge;

/// A motor with its protocol.
pub trait Device: Debug + Send {
    /// The motor.
    fn core(&self) -> &Core;

    /// The motor, to be changed.
    fn core_mut(&mut self) -> &mut Core;

    /// Takes a frame; adds its answers.
    fn hear(&mut self, frame: &CanFrame, out: &mut Vec<CanFrame>);

    /// Adds what it says by itself.
    fn due(&mut self, _out: &mut Vec<CanFrame>) {}

    /// Its protocol begins anew.
    fn restart(&mut self) {}

    /// It has another id.
    fn renamed(&mut self) {}
}

/// A bus of motors.
#[derive(Debug)]
pub struct CanNet {
    devices: Vec<Box<dyn Device>>,
    frames_in: u64,
    /// Frames destroyed by motors that spoke at once.
    collisions: u64,
}

impl CanNet {
    /// A bus with these motors.
    pub fn new(devices: Vec<Box<dyn Device>>) -> Self {
        Self {
            devices,
            frames_in: 0,
            collisions: 0,
        }
    }

    /// What is left of frames that were offered at once, in the order in which
    /// the bus carries them: the lowest id first.
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

    fn execute(&mut self) -> Vec<Burst> {
        Vec::new()
    }

    fn hear(&mut self, frame: &CanFrame) -> Vec<CanFrame> {
        self.frames_in += 1;
        let mut offered = Vec::new();
        let mut answers = Vec::new();
        for (index, device) in self.devices.iter_mut().enumerate() {
            if device.core().listens() {
                device.hear(frame, &mut answers);
                offered.extend(answers.drain(..).map(|answer| (index, answer)));
            }
        }
        self.arbitrate(offered)
    }

    fn due(&mut self) -> Vec<CanFrame> {
        let mut offered = Vec::new();
        let mut said = Vec::new();
        for (index, device) in self.devices.iter_mut().enumerate() {
            if device.core().listens() {
                device.due(&mut said);
                offered.extend(said.drain(..).map(|frame| (index, frame)));
            }
        }
        self.arbitrate(offered)
    }

    fn step(&mut self, time_s: f64, dt_s: f64, period_ends: bool) {
        for device in &mut self.devices {
            device.core_mut().step(time_s, dt_s);
            if period_ends {
                device.core_mut().end_period();
            }
        }
    }

    fn judges(&self) -> Vec<&Judge> {
        let devices = self.devices.iter();
        devices.map(|device| device.core().judge()).collect()
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
