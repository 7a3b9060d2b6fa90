//! One CAN bus whose motors are set up: a scan tells who is there, and one new motor after the
//! other gets its id. Nothing here turns torque on.
//!
//! Not every family can be asked for its id or given one: what needs the vendor's own program
//! is said before anything is changed. A MyActuator motor must be alone on the bus while it
//! gets its id, since every motor that hears of a new id takes it.

use crate::bus_tools::consent::pause;
use crate::bus_tools::setup::voice::{NextServo, Voice};
use anyhow::{anyhow, bail};
use servodance_drivers::can::{CanFound, CanScanner, IdSetting};
use servodance_drivers::serial::FACTORY_ID;
use servodance_drivers::{Bus, BusConfig, BusLayout, Port, Servo, open_bus};
use std::time::Duration;

/// Between two scans for a new motor.
const BETWEEN: Duration = Duration::from_millis(300);

pub(super) struct CanLine<'a> {
    port: &'a Port,
    layout: &'a BusLayout,
}

impl<'a> CanLine<'a> {
    /// A bus of a robot on a CAN port. Refused: motors whose id only the vendor's program sets.
    pub fn new(port: &'a Port, layout: &'a BusLayout) -> anyhow::Result<Self> {
        let by_vendor = |servo: &&Servo| CanScanner::id_setting(servo.model) == IdSetting::Vendor;
        if let Some(servo) = layout.servos.iter().find(by_vendor) {
            bail!(
                "{port}: {} motors get their ids from the vendor's own program; give {} id {}, \
                 the others theirs, then: servodance ping {port} --robot FILE",
                servo.model.name,
                servo.name,
                servo.id
            );
        }
        Ok(Self { port, layout })
    }

    /// Sets up one motor after the other. One whose id is that of new motors comes last.
    pub fn set_up(&self, next: NextServo, voice: &Voice) -> anyhow::Result<()> {
        let servos = &self.layout.servos;
        let mut order: Vec<&Servo> = servos.iter().collect();
        order.sort_by_key(|servo| servo.id == FACTORY_ID);
        let mut known: Vec<u8> = Vec::new();
        let there = self.look()?;
        for servo in order.iter().filter(|servo| servo.id != FACTORY_ID) {
            if there.iter().any(|found| found.id == servo.id) {
                (voice.say)(&format!("{}: set up already ({})", servo.name, address(servo)));
                known.push(servo.id);
            }
        }
        for servo in order {
            if known.contains(&servo.id) {
                continue;
            }
            let place = format!("{} of {}", known.len() + 1, servos.len());
            let found = self.newcomer(servo, &known, &place, next, voice)?;
            self.adopt(&found, servo, voice)?;
            known.push(servo.id);
        }
        Ok(())
    }

    fn look(&self) -> anyhow::Result<Vec<CanFound>> {
        let port = self.port.to_string();
        let mut scanner = CanScanner::open(&port, self.layout.config.baud)?;
        scanner.everyone().map_err(|error| anyhow!("{port}: {error}"))
    }

    /// The one motor that is there and not set up yet.
    fn newcomer(
        &self,
        servo: &Servo,
        known: &[u8],
        place: &str,
        next: NextServo,
        voice: &Voice,
    ) -> anyhow::Result<CanFound> {
        let alone = CanScanner::id_setting(servo.model) == IdSetting::OfAll;
        let alone = if alone { " alone" } else { "" };
        let Servo { name, id, model, .. } = servo;
        let wanted = format!("one new {} for {name}{alone}, which will have id {id}", model.name);
        if next == NextServo::Awaited {
            (voice.note)(&format!("{place}: waiting for {wanted}"));
        }
        loop {
            if next == NextServo::Asked {
                pause(&format!("{place}: connect {wanted}"))?;
            }
            let mut found = self.look()?;
            let set_up = found.iter().filter(|found| known.contains(&found.id)).count();
            found.retain(|found| !known.contains(&found.id));
            let reason = match &found[..] {
                [] => "no new motor answers: check its power, its cable and the terminators".into(),
                [_] if !alone.is_empty() && set_up > 0 => {
                    "every motor would take the new id: disconnect those that have theirs".into()
                }
                [one] => match self.misfit(one, servo) {
                    None => return Ok(one.clone()),
                    Some(reason) => reason,
                },
                several => {
                    let ids: Vec<String> = several.iter().map(|one| one.id.to_string()).collect();
                    format!(
                        "several new motors answer: ids {}; connect one at a time",
                        ids.join(", ")
                    )
                }
            };
            match next {
                NextServo::Asked => (voice.note)(&reason),
                NextServo::Awaited if found.is_empty() => std::thread::sleep(BETWEEN),
                NextServo::Awaited => bail!(reason),
            }
        }
    }

    /// Why a motor is not the one that is asked for, as far as it can tell.
    fn misfit(&self, found: &CanFound, servo: &Servo) -> Option<String> {
        // A model in another mode has the same ranges.
        let same = |told: &str| servo.model.name.split('(').next() == told.split('(').next();
        let told = found.model.filter(|told| !same(told))?;
        Some(format!("{told} is connected, but {} needs {}", servo.name, servo.model.name))
    }

    /// Its ids, then the checks and settings of arming.
    fn adopt(&self, found: &CanFound, servo: &Servo, voice: &Voice) -> anyhow::Result<()> {
        let port = self.port.to_string();
        let mut scanner = CanScanner::open(&port, self.layout.config.baud)?;
        if !scanner.set_id(found.id, servo)? {
            bail!("{} does not take an id: has it its vendor's newest firmware?", servo.name);
        }
        drop(scanner);
        if !self.look()?.iter().any(|there| there.id == servo.id) {
            bail!("{} does not answer as {}", servo.name, address(servo));
        }
        let config = BusConfig {
            control_hz: None,
            imu: None,
            accept_no_watchdog: true,
            ..self.layout.config.clone()
        };
        for note in open_bus(self.port, &config, vec![servo.clone()])?.prepare()? {
            (voice.say)(&note);
        }
        (voice.say)(&format!("{}: {}, read back", servo.name, address(servo)));
        Ok(())
    }
}

fn address(servo: &Servo) -> String {
    format!("{}, id {}", servo.model.name, servo.id)
}
