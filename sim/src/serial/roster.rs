//! The servos of one serial line, whatever they speak.

use crate::bus::line::Burst;
use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::servo::body::{ServoBody, SimServoState};

/// What a line needs of each of its servos.
pub trait LineServo {
    fn body(&self) -> &ServoBody;

    /// Its body, to be changed.
    fn body_mut(&mut self) -> &mut ServoBody;

    fn id(&self) -> u8;

    /// The rate at which it hears and answers, bits a second.
    fn baud(&self) -> u32;

    /// One step of firmware and motor.
    fn step(&mut self, dt_s: f64);

    /// What it really does.
    fn state(&self) -> SimServoState;

    /// Something goes wrong with it.
    fn suffer(&mut self, fault: ServoFault);
}

/// Servos on one line, and what came from the host.
#[derive(Clone, Debug)]
pub struct Roster<S> {
    pub servos: Vec<S>,
    pub packets_in: u64,
    pub bad_packets: u64,
    /// Resistance of the supply line, ohms.
    supply_ohm: f64,
    /// The rate of the line, and the one at which the host speaks.
    line_baud: u32,
    baud: u32,
}

impl<S: LineServo> Roster<S> {
    pub fn new(servos: Vec<S>, supply_ohm: f64, line_baud: u32) -> Self {
        Self {
            servos,
            packets_in: 0,
            bad_packets: 0,
            supply_ohm,
            line_baud,
            baud: line_baud,
        }
    }

    /// The host speaks at this rate from now on. A pseudo-terminal carries any: a
    /// host at a rate that no servo has is taken to be at the line's own.
    pub fn set_host_baud(&mut self, baud: u32) {
        let is_known = self.servos.iter().any(|servo| servo.baud() == baud);
        self.baud = if is_known { baud } else { self.line_baud };
    }

    /// Whether a servo hears and answers; what comes at another rate is garbage.
    fn hears(&self, servo: &S) -> bool {
        servo.body().listens() && servo.baud() == self.baud
    }

    /// More than one where ids were given twice.
    pub fn find_all(&self, id: u8) -> Vec<usize> {
        let servos = self.servos.iter().enumerate();
        let heard = servos.filter(|(_, servo)| self.hears(servo) && servo.id() == id);
        heard.map(|(index, _)| index).collect()
    }

    pub fn listeners(&self) -> Vec<usize> {
        let servos = self.servos.iter().enumerate();
        let heard = servos.filter(|(_, servo)| self.hears(servo));
        heard.map(|(index, _)| index).collect()
    }

    pub fn step(&mut self, time_s: f64, dt_s: f64, period_ends: bool) {
        if self.supply_ohm > 0.0 {
            let currents = self
                .servos
                .iter()
                .map(|servo| servo.state().current_a.abs());
            let sag_v = self.supply_ohm * currents.sum::<f64>();
            self.servos
                .iter_mut()
                .for_each(|servo| servo.body_mut().set_sag_v(sag_v));
        }
        for servo in &mut self.servos {
            servo.body_mut().time_s = time_s;
            servo.step(dt_s);
            if period_ends {
                servo.body_mut().end_period();
            }
        }
    }

    pub fn judges(&self) -> Vec<&Judge> {
        self.servos
            .iter()
            .map(|servo| &servo.body().judge)
            .collect()
    }

    pub fn state(&self, index: usize) -> Option<SimServoState> {
        self.servos.get(index).map(LineServo::state)
    }

    pub fn suffer(&mut self, index: usize, fault: ServoFault) -> bool {
        let servo = self.servos.get_mut(index);
        servo.map(|servo| servo.suffer(fault)).is_some()
    }
}

/// Servos that answer at the same time pull the line low together: every zero
/// bit wins. Identical answers pass, as on a real bus.
pub(crate) fn collided(answers: Vec<Burst>) -> Vec<Burst> {
    let mut answers = answers.into_iter();
    let Some(mut heard) = answers.next() else {
        return Vec::new();
    };
    for other in answers {
        for (byte, also) in heard.bytes.iter_mut().zip(&other.bytes) {
            *byte &= also;
        }
        let tail = other.bytes.get(heard.bytes.len()..).unwrap_or_default();
        heard.bytes.extend_from_slice(tail);
    }
    vec![heard]
}
