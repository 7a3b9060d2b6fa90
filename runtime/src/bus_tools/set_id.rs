//! A new id for one servo.

use super::consent::Consent;
use super::listen::{ProtocolChoice, SerialListener};
use crate::process::wrong_usage::misused;
use anyhow::{Context, bail};

/// Gives the servo with id `old` the id `new`, for good. Returns a line about it.
///
/// Refused: an id out of range or in use, a servo that does not answer, and one
/// that shares its id with another (both would change).
pub fn set_id(
    port: &str,
    (old, new): (u16, u16),
    baud: Option<u32>,
    protocol: ProtocolChoice,
    consent: Consent,
) -> anyhow::Result<String> {
    let in_range = |id: u16| -> anyhow::Result<u8> {
        match u8::try_from(id) {
            Ok(id) if id <= 253 => Ok(id),
            _ => misused!("id {id} is out of range: 0 to 252 (253 with protocol 1)"),
        }
    };
    let (old, new) = (in_range(old)?, in_range(new)?);
    if old == new {
        misused!("the servo has id {old} already");
    }
    let listener = SerialListener::new(port, baud, protocol)?;
    let (mut probe, servo) = listener.find(old)?;
    let model = servo.model.unwrap_or("servo of an unknown model");
    let last = servo.last_id();
    if new > last {
        bail!("id {new} is out of range: 0 to {last} for {model}");
    }
    if probe.is_doubled(&servo)? {
        bail!("two servos answer to id {old}, and both would change: connect one at a time");
    }
    probe.vitals(&servo).with_context(|| format!("id {old} cannot be read: is it given twice?"))?;
    if let Some(taken) = probe.ping(new).with_context(|| format!("id {new} is in use"))? {
        let by = taken.model.unwrap_or("a servo of an unknown model");
        bail!("id {new} is in use by {by} at {} baud", taken.baud);
    }
    consent.obtain(&format!(
        "The {model} with id {old} on {} ({} baud) will have id {new} from now on. \
         Its torque goes off: hold what it carries.",
        listener.path(),
        servo.baud
    ))?;
    probe.set_id(&servo, new)?;
    if probe.ping(old)?.is_some() {
        bail!("id {new} is set, but id {old} still answers: two servos had it");
    }
    Ok(format!("id {old} is now id {new} ({model}), read back"))
}
