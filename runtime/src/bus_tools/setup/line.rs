//! One serial bus whose servos are set up: which are, which are not, and what becomes of a
//! new one.

use crate::bus_tools::listen::{SerialListener, is_motion_sensor};
use crate::bus_tools::set_baud::{BaudChange, Whose};
use crate::bus_tools::setup::newcomer::Newcomers;
use crate::bus_tools::setup::settings::settle;
use crate::bus_tools::setup::voice::{NextServo, Voice};
use anyhow::{anyhow, bail};
use servodance_drivers::serial::{FACTORY_ID, ServoFamily, family_of};
use servodance_drivers::{BusLayout, FoundServo, Port, Servo};

pub(super) struct SetupLine<'a> {
    port: &'a Port,
    layout: &'a BusLayout,
    listener: SerialListener,
    family: &'static dyn ServoFamily,
}

impl<'a> SetupLine<'a> {
    /// A bus of a robot on a serial port. Nothing is sent.
    pub fn new(port: &'a Port, layout: &'a BusLayout) -> anyhow::Result<Self> {
        let listener = SerialListener::of_bus(port, &layout.config)?;
        let family = family_of(layout.config.kind);
        let family = family.ok_or_else(|| anyhow!("{port}: these servos are on no serial bus"))?;
        Ok(Self { port, layout, listener, family })
    }

    /// Sets up one servo after the other.
    pub fn set_up(&self, next: NextServo, voice: &Voice) -> anyhow::Result<()> {
        let servos = &self.layout.servos;
        let mut done = self.look_who_is_set_up()?;
        for (servo, _) in servos.iter().zip(&done).filter(|(_, done)| **done) {
            (voice.say)(&format!("{}: set up already ({})", servo.name, self.address(servo)));
        }
        while let Some(asked) = self.next_joint(&done) {
            let count = done.iter().filter(|done| **done).count();
            let newcomers = Newcomers {
                listener: &self.listener,
                family: self.family,
                asked: &servos[asked],
                baud: self.layout.config.baud,
                known: servos
                    .iter()
                    .zip(&done)
                    .filter(|(_, done)| **done)
                    .map(|(s, _)| s.id)
                    .collect(),
                place: format!("{} of {}", count + 1, servos.len()),
            };
            let found = newcomers.next(next, voice)?;
            let index = self.joint_of(&found, &done).unwrap_or(asked);
            self.adopt(&found, &servos[index], voice)?;
            done[index] = true;
        }
        Ok(())
    }

    /// Where a servo of this bus answers when all is done.
    fn address(&self, servo: &Servo) -> String {
        format!("{}, id {}, {} baud", servo.model.name, servo.id, self.layout.config.baud)
    }

    /// Whether new servos answer where this one is to answer in the end.
    fn is_as_new(&self, servo: &Servo) -> bool {
        let factory_baud = self.family.factory_baud(servo.model);
        servo.id == FACTORY_ID && factory_baud == Some(self.layout.config.baud)
    }

    /// Which servos have their id, rate and model. One that answers as a new one does counts
    /// only when it is the last that is missing.
    fn look_who_is_set_up(&self) -> anyhow::Result<Vec<bool>> {
        let servos = &self.layout.servos;
        let mut probe = self.listener.probe(self.family.framing(), self.layout.config.baud)?;
        let mut everyone = probe.everyone()?;
        everyone.retain(|found| !is_motion_sensor(found));
        let mut done = vec![false; servos.len()];
        for (done, servo) in done.iter_mut().zip(servos) {
            let Some(found) = everyone.iter().find(|found| found.id == servo.id) else { continue };
            // Damaged answers, without a model in them, are those of two.
            let is_right = found.model_number == servo.model.number;
            if found.model_number == 0 || (is_right && probe.is_doubled(found)?) {
                bail!("two servos answer to id {}: disconnect one of them", found.id);
            }
            if is_right {
                *done = true;
            } else if !self.is_as_new(servo) {
                bail!(
                    "id {} answers as {}, but {} is an {} in the robot file: disconnect that servo",
                    found.id,
                    found.model.unwrap_or("a servo of an unknown model"),
                    servo.name,
                    servo.model.name
                );
            }
        }
        let misses_more =
            |place: usize| done.iter().enumerate().any(|(i, done)| i != place && !done);
        match servos.iter().position(|servo| self.is_as_new(servo)) {
            Some(place) if misses_more(place) => done[place] = false,
            _ => {}
        }
        Ok(done)
    }

    /// The next joint without a servo. The one whose servo answers as a new one does comes last:
    /// the others would collide with it.
    fn next_joint(&self, done: &[bool]) -> Option<usize> {
        let missing = || (0..done.len()).filter(|&index| !done[index]);
        let usual = missing().find(|&index| !self.is_as_new(&self.layout.servos[index]));
        usual.or_else(|| missing().next())
    }

    /// The joint that a servo was meant for when its set-up was interrupted.
    fn joint_of(&self, found: &FoundServo, done: &[bool]) -> Option<usize> {
        let servos = self.layout.servos.iter().zip(done);
        let mut meant = servos.map(|(servo, done)| {
            !done && servo.id == found.id && servo.model.number == found.model_number
        });
        if found.id == FACTORY_ID { None } else { meant.position(|is_meant| is_meant) }
    }

    /// Settings, then the id, then the rate: as long as the last is missing it is a new servo.
    fn adopt(&self, found: &FoundServo, servo: &Servo, voice: &Voice) -> anyhow::Result<()> {
        let config = &self.layout.config;
        let code = found.baud_code(config.baud).map_err(|known| {
            anyhow!("{} knows no {} baud, only {known:?}", servo.model.name, config.baud)
        })?;
        settle(self.port, &self.listener, config, servo, found, voice.say)?;
        let framing = self.family.framing();
        if found.id != servo.id {
            let mut probe = self.listener.patient_probe(framing, found.baud)?;
            probe.set_id(found, servo.id)?;
        }
        let mut named = found.clone();
        named.id = servo.id;
        if found.baud != config.baud {
            let change = BaudChange {
                port: self.listener.path(),
                whose: Whose::One(servo.id),
                to: config.baud,
                from: Some(found.baud),
                protocol: framing.into(),
            };
            change.change(&self.listener, &named, code)?;
        }
        let mut probe = self.listener.patient_probe(framing, config.baud)?;
        let there = probe.ping(servo.id)?;
        if there.is_none_or(|there| there.model_number != servo.model.number) {
            bail!("{} does not answer as {}", servo.name, self.address(servo));
        }
        (voice.say)(&format!("{}: {}, read back", servo.name, self.address(servo)));
        Ok(())
    }
}
