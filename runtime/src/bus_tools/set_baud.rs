//! Another rate for servos: new ones come at 57,600, and robots want more.
//!
//! One servo at a time, each looked for at the new rate before the next is changed. One
//! that is not there is looked for at every rate and told where it is.

use super::consent::Consent;
use super::listen::{ProtocolChoice, SerialListener};
use anyhow::{Context, bail};
use servodance_drivers::{FoundServo, SerialScanner};
use std::time::Duration;

/// How often a servo is looked for at its new rate, and how long between two looks.
const LOOKS: u32 = 10;
const BETWEEN: Duration = Duration::from_millis(50);

/// Whose rate is changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Whose {
    /// The servo with this id.
    One(u8),
    /// Every servo that answers on the port, whatever its rate.
    All,
}

/// Options of `servodance set-baud`.
#[derive(Debug)]
pub struct BaudChange<'a> {
    /// The serial port.
    pub port: &'a str,
    /// Whose rate.
    pub whose: Whose,
    /// The new rate, bits a second.
    pub to: u32,
    /// The rate at which they are now; every usual one if left out.
    pub from: Option<u32>,
    /// The framings to look for.
    pub protocol: ProtocolChoice,
}

impl BaudChange<'_> {
    /// Asks, changes one servo after the other, looks for each at its new rate.
    pub fn run(&self, consent: Consent, say: impl Fn(&str)) -> anyhow::Result<()> {
        let listener = SerialListener::new(self.port, self.from, self.protocol)?;
        let servos = self.servos(&listener)?;
        let mut codes = Vec::with_capacity(servos.len());
        for servo in &servos {
            codes.push(servo.baud_code(self.to).map_err(|known| self.refused(servo, &known))?);
        }
        let names: Vec<String> = servos.iter().map(name).collect();
        consent.obtain(&format!(
            "{} on {} will speak at {} baud from now on. Torque goes off: hold what they carry.",
            names.join(", "),
            listener.path(),
            self.to
        ))?;
        for (servo, code) in servos.iter().zip(codes) {
            if servo.baud == self.to {
                say(&format!("{} speaks at {} baud already", name(servo), self.to));
                continue;
            }
            self.change(&listener, servo, code)?;
            say(&format!("{}: {} baud, read back", name(servo), self.to));
        }
        Ok(())
    }

    fn servos(&self, listener: &SerialListener) -> anyhow::Result<Vec<FoundServo>> {
        let mut found = Vec::new();
        match self.whose {
            Whose::One(id) => found.push(listener.find(id)?.1),
            Whose::All => {
                for (protocol, baud) in listener.usual_channels() {
                    let everyone = listener.probe(protocol, baud)?.everyone()?;
                    // A board with a motion sensor keeps its rate.
                    found.extend(everyone.into_iter().filter(|found| found.model.is_some()));
                }
            }
        }
        if found.is_empty() {
            bail!("{}: no servo answers at {}", listener.path(), listener.rates());
        }
        for servo in &found {
            let mut probe = listener.probe(servo.family.framing(), servo.baud)?;
            if probe.is_doubled(servo)? {
                bail!("two servos answer to id {}: connect one at a time", servo.id);
            }
            let same_id = found.iter().filter(|other| other.id == servo.id).count();
            if same_id > 1 {
                bail!(
                    "id {} answers at more than one rate; at one rate they would be two servos with \
                     one id: connect one at a time",
                    servo.id
                );
            }
        }
        Ok(found)
    }

    fn refused(&self, servo: &FoundServo, known: &[u32]) -> anyhow::Error {
        let known: Vec<String> = known.iter().map(u32::to_string).collect();
        match known.is_empty() {
            true => anyhow::anyhow!("{}: its rates are not known", name(servo)),
            false => anyhow::anyhow!(
                "{} knows no {} baud; choose {}",
                name(servo),
                self.to,
                known.join(", ")
            ),
        }
    }

    /// Changes one servo, which `listener` found, to the rate whose code this is, and looks for
    /// it there.
    pub(super) fn change(
        &self,
        listener: &SerialListener,
        servo: &FoundServo,
        code: u8,
    ) -> anyhow::Result<()> {
        let framing = servo.family.framing();
        let mut probe = listener.probe(framing, servo.baud)?;
        probe.send_baud(servo, code)?;
        drop(probe);
        let mut probe = listener.probe(framing, self.to)?;
        if self.is_there(&mut probe, servo)? {
            return Ok(probe.lock(servo, servo.id)?);
        }
        drop(probe);
        // The adapter may not carry the new rate, or the servo never took it.
        let everywhere = SerialListener::new(self.port, None, self.protocol)?;
        let (_, now) = everywhere.find(servo.id).with_context(|| {
            format!(
                "{} does not answer at {} baud, nor at any other: the adapter may not carry that \
                 rate; switch its power off and on, and try another adapter",
                name(servo),
                self.to
            )
        })?;
        bail!("{} does not answer at {} baud; it is at {} now", name(servo), self.to, now.baud)
    }

    fn is_there(&self, probe: &mut SerialScanner, servo: &FoundServo) -> anyhow::Result<bool> {
        for _ in 0..LOOKS {
            let found = probe.ping(servo.id)?;
            if found.is_some_and(|found| found.model_number == servo.model_number) {
                return Ok(true);
            }
            std::thread::sleep(BETWEEN);
        }
        Ok(false)
    }
}

fn name(servo: &FoundServo) -> String {
    format!("{} with id {}", servo.model.unwrap_or("servo of an unknown model"), servo.id)
}
