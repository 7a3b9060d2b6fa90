//! A servo put back as it left the factory.

use crate::bus_tools::memory::backup::permanent;
use crate::bus_tools::memory::place::{OpenServo, ServoPlace};
use anyhow::{Context, bail};
use servodance_drivers::ServoModel;
use servodance_drivers::serial::FACTORY_ID;
use std::time::Duration;

/// How often a servo that starts again is looked for, and how long between two looks.
const LOOKS: u32 = 15;
const BETWEEN: Duration = Duration::from_millis(200);

/// Resets one servo, if `agreed`; else says what would be lost and fails. With `all` it
/// forgets its id and rate as well.
///
/// Refused: torque that is on, a family that has no such instruction.
pub fn factory_reset(
    place: &ServoPlace,
    all: bool,
    agreed: bool,
    say: impl Fn(&str),
) -> anyhow::Result<()> {
    let mut open = place.open()?;
    let who = open.who();
    let params = match (open.found.family.reset_params(!all), all) {
        (Some(params), _) => params,
        (None, false) if open.found.family.reset_params(false).is_some() => {
            bail!("{who} can only forget everything, its id and rate as well: --all says so")
        }
        (None, _) => bail!("{who} has no factory reset; `servos restore` writes a backup back"),
    };
    let (id, baud) = address_after(&open, all)?;
    if !agreed {
        for register in permanent(&mut open)? {
            say(&format!("{} = {}", register.name, register.shown));
        }
        let stays = match all {
            true => format!("and its id is {id} then, at {baud} baud"),
            false => "its id and rate stay".into(),
        };
        bail!(
            "nothing was changed: a reset of {who} loses these settings, gains and limits, {stays}; \
             `servos backup` keeps them in a file; --yes agrees to the reset"
        );
    }
    open.probe.factory_reset(&open.found, &open.table, params)?;
    let model = open.table.model;
    let model_number = open.found.model_number;
    let framing = open.found.family.framing();
    drop(open);
    let mut probe = place.listener().patient_probe(framing, baud)?;
    for _ in 0..LOOKS {
        let found = probe.ping(id)?;
        if found.is_some_and(|found| found.model_number == model_number) {
            say(&format!("{model} is as it left the factory: id {id}, {baud} baud"));
            return Ok(());
        }
        std::thread::sleep(BETWEEN);
    }
    bail!("{who} was reset, but does not answer at {baud} baud as id {id}; `servodance scan` looks")
}

/// Where it answers after the reset.
fn address_after(open: &OpenServo, all: bool) -> anyhow::Result<(u8, u32)> {
    if !all {
        return Ok((open.found.id, open.found.baud));
    }
    let model = ServoModel::from_number(open.found.model_number);
    let baud = model.and_then(|model| open.found.family.factory_baud(model));
    let baud = baud.with_context(|| format!("{}: the factory's rate is not known", open.who()))?;
    Ok((FACTORY_ID, baud))
}
