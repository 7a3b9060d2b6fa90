//! The one new servo on a line: waited or asked for, found at whatever rate it has, and
//! refused if it is not alone or not the right one.

use crate::bus_tools::consent::pause;
use crate::bus_tools::listen::{SerialListener, is_motion_sensor};
use crate::bus_tools::setup::voice::{NextServo, Voice};
use anyhow::bail;
use servodance_drivers::serial::{FACTORY_ID, ServoFamily};
use servodance_drivers::{BusError, FoundServo, Framing, SerialScanner, Servo};
use std::time::Duration;

/// Between two looks for a servo that answers as new ones do.
const BETWEEN: Duration = Duration::from_millis(150);
/// Every so many looks all usual rates are looked at.
const WIDE_LOOK: u32 = 40;
/// The rates of servos out of the box, bits a second: a servo in the wrong protocol is one.
const FACTORY_BAUDS: [u32; 2] = [57_600, 1_000_000];

/// What is looked for, and what is not new.
pub(super) struct Newcomers<'a> {
    pub listener: &'a SerialListener,
    pub family: &'static dyn ServoFamily,
    /// The joint whose servo is asked for.
    pub asked: &'a Servo,
    /// The rate of the robot's bus, bits a second.
    pub baud: u32,
    /// The ids that are set up.
    pub known: Vec<u8>,
    /// How far the set-up is, in words.
    pub place: String,
}

impl Newcomers<'_> {
    /// The next new servo. Where somebody is asked, what does not fit is told and asked for
    /// again; where not, it is an error.
    pub fn next(&self, next: NextServo, voice: &Voice) -> anyhow::Result<FoundServo> {
        let Servo { name, id, model, .. } = self.asked;
        let wanted = format!("one new {} for {name}, which will have id {id}", model.name);
        if next == NextServo::Awaited {
            (voice.note)(&format!("{}: waiting for {wanted}", self.place));
            return match self.fitting(self.await_someone()?)? {
                Ok(found) => Ok(found),
                Err(reason) => bail!(reason),
            };
        }
        loop {
            pause(&format!("{}: connect {wanted}", self.place))?;
            let mut found = self.look(self.usual_bauds())?;
            if found.is_empty() {
                found = self.look(self.all_bauds())?;
            }
            match self.fitting(found)? {
                Ok(found) => return Ok(found),
                Err(reason) => (voice.note)(&reason),
            }
        }
    }

    fn probe(&self, baud: u32) -> anyhow::Result<SerialScanner> {
        self.listener.probe(self.family.framing(), baud)
    }

    /// Where new servos and those of this robot answer.
    fn usual_bauds(&self) -> Vec<u32> {
        let mut bauds: Vec<u32> = self.family.factory_baud(self.asked.model).into_iter().collect();
        if !bauds.contains(&self.baud) {
            bauds.push(self.baud);
        }
        bauds
    }

    fn all_bauds(&self) -> Vec<u32> {
        let usual = self.usual_bauds();
        let others = SerialScanner::usual_bauds(self.family.framing());
        let others = others.filter(|baud| !usual.contains(baud));
        usual.iter().copied().chain(others).collect()
    }

    /// Whoever is new at these rates.
    fn look(&self, bauds: Vec<u32>) -> anyhow::Result<Vec<FoundServo>> {
        let mut new: Vec<FoundServo> = Vec::new();
        for baud in bauds {
            let is_known = |found: &FoundServo| baud == self.baud && self.known.contains(&found.id);
            let mut everyone = self.probe(baud)?.everyone()?;
            everyone.retain(|found| !is_motion_sensor(found) && !is_known(found));
            everyone.retain(|found| new.iter().all(|n| (n.id, n.baud) != (found.id, found.baud)));
            new.extend(everyone);
        }
        Ok(new)
    }

    /// Waits until somebody new answers.
    fn await_someone(&self) -> anyhow::Result<Vec<FoundServo>> {
        for look in 1u32.. {
            let wide = look.is_multiple_of(WIDE_LOOK);
            if wide || self.is_one_there()? {
                let bauds = if wide { self.all_bauds() } else { self.usual_bauds() };
                let found = self.look(bauds)?;
                if !found.is_empty() || (wide && self.of_other_protocol()?.is_some()) {
                    return Ok(found);
                }
            }
            std::thread::sleep(BETWEEN);
        }
        Ok(Vec::new())
    }

    /// Whether anybody answers as new servos do, or as the joint that is asked for.
    fn is_one_there(&self) -> anyhow::Result<bool> {
        for baud in self.usual_bauds() {
            let mut probe = self.probe(baud)?;
            for id in [FACTORY_ID, self.asked.id] {
                if baud == self.baud && self.known.contains(&id) {
                    continue;
                }
                match probe.ping(id) {
                    Ok(None) => {}
                    Ok(Some(_)) | Err(BusError::Corrupt { .. }) => return Ok(true),
                    Err(error) => return Err(error.into()),
                }
            }
        }
        Ok(false)
    }

    /// A new servo that speaks another protocol, such as an MX with the firmware that it
    /// left the factory with.
    fn of_other_protocol(&self) -> anyhow::Result<Option<FoundServo>> {
        let own = self.family.framing();
        let others = SerialScanner::FRAMINGS.into_iter().filter(|framing| *framing != own);
        for framing in others {
            for baud in FACTORY_BAUDS {
                // Damage says nothing here: it may be the answer of a servo of this robot.
                if let Ok(Some(found)) = self.listener.probe(framing, baud)?.ping(FACTORY_ID) {
                    return Ok(Some(found));
                }
            }
        }
        Ok(None)
    }

    /// The one servo that was found, if it is alone and the right one; else why not.
    fn fitting(&self, found: Vec<FoundServo>) -> anyhow::Result<Result<FoundServo, String>> {
        let wanted = self.asked.model;
        let one = match &found[..] {
            [] => return Ok(Err(self.nobody()?)),
            [one] => one,
            several => {
                let several: Vec<String> = several.iter().map(who).collect();
                return Ok(Err(format!(
                    "several new servos answer: {}; connect one at a time",
                    several.join(", ")
                )));
            }
        };
        // Damaged answers, without a model in them, are those of two.
        let is_damaged = one.model_number == 0;
        if !is_damaged && one.model_number != wanted.number {
            return Ok(Err(format!(
                "{} is connected, but {} needs {}: disconnect it",
                who(one),
                self.asked.name,
                wanted.name
            )));
        }
        // Two of one model may answer a ping with one voice.
        if is_damaged || self.probe(one.baud)?.is_doubled(one)? {
            return Ok(Err(format!(
                "two servos answer to id {} at {} baud: connect one at a time",
                one.id, one.baud
            )));
        }
        Ok(Ok(one.clone()))
    }

    fn nobody(&self) -> anyhow::Result<String> {
        Ok(match self.of_other_protocol()? {
            Some(found) => {
                let protocol = match found.family.framing() {
                    Framing::Protocol2 => "2.0",
                    Framing::Protocol1 => "1",
                };
                format!(
                    "{} is connected, which speaks protocol {protocol}, but {} needs {}",
                    who(&found),
                    self.asked.name,
                    self.asked.model.name
                )
            }
            None => "no new servo answers at any usual rate: check its power and its cable".into(),
        })
    }
}

fn who(found: &FoundServo) -> String {
    let model = found.model.unwrap_or("a servo of an unknown model");
    format!("{model} with id {} at {} baud", found.id, found.baud)
}
