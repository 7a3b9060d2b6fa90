//! The servos of one serial line, whatever they speak.

use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::servo::SimServoState;

/// What a line needs of each of its servos.
pub trait Device {
    /// Its id.
    fn id(&self) -> u8;

    /// Whether it hears and answers.
    fn listens(&self) -> bool;

    /// One step of firmware and motor, ending at `time_s`.
    fn step(&mut self, time_s: f64, dt_s: f64);

    /// The end of a control period: the true position is judged.
    fn end_period(&mut self);

    /// The judge of its motion.
    fn judge(&self) -> &Judge;

    /// What it really does.
    fn state(&self) -> SimServoState;

    /// Something goes wrong with it.
    fn suffer(&mut self, fault: ServoFault);

    /// Its supply, volts; the line's sag is already taken off.
    fn set_sag_v(&mut self, sag_v: f64);
}

/// Servos on one line, and what came from the host.
#[derive(Clone, Debug)]
pub struct Roster<S> {
    pub servos: Vec<S>,
    pub packets_in: u64,
    pub bad_packets: u64,
    /// Resistance of the supply line, ohms.
    supply_ohm: f64,
}

impl<S: Device> Roster<S> {
    pub fn new(servos: Vec<S>, supply_ohm: f64) -> Self {
        Self {
            servos,
            packets_in: 0,
            bad_packets: 0,
            supply_ohm,
        }
    }

    /// More than one where ids were given twice.
    pub fn find_all(&self, id: u8) -> Vec<usize> {
        let servos = self.servos.iter().enumerate();
        let heard = servos.filter(|(_, servo)| servo.listens() && servo.id() == id);
        heard.map(|(index, _)| index).collect()
    }

    /// All who listen.
    pub fn listeners(&self) -> Vec<usize> {
        let servos = self.servos.iter().enumerate();
        let heard = servos.filter(|(_, servo)| servo.listens());
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
                .for_each(|servo| servo.set_sag_v(sag_v));
        }
        for servo in &mut self.servos {
            servo.step(time_s, dt_s);
            if period_ends {
                servo.end_period();
            }
        }
    }

    pub fn judges(&self) -> Vec<&Judge> {
        self.servos.iter().map(Device::judge).collect()
    }

    pub fn state(&self, index: usize) -> Option<SimServoState> {
        self.servos.get(index).map(Device::state)
    }

    pub fn suffer(&mut self, index: usize, fault: ServoFault) -> bool {
        let servo = self.servos.get_mut(index);
        servo.map(|servo| servo.suffer(fault)).is_some()
    }
}
