//! The settings of a robot's servos against the robot file: what another program left.

use super::consent::Consent;
use super::plug;
use crate::robot::Robot;
use servodance_drivers::serial::Remedy;
use servodance_drivers::{Bus, ServoDeviation, open_buses};

/// What a check found.
#[derive(Debug, Default)]
pub struct ServoCheck {
    /// A line for each deviation, and for each change.
    pub lines: Vec<String>,
    /// Deviations with which the robot would be put right, or refused, when armed.
    pub open: usize,
}

/// Looks at every servo of the robot; nothing is written. With `fix`, after consent, torque
/// goes off and what can be put right is.
pub fn check(
    robot: &Robot,
    ports: &[String],
    fix: bool,
    consent: Consent,
) -> anyhow::Result<ServoCheck> {
    let ports = plug::ports(robot, ports)?;
    let mut bus = open_buses(&ports, &robot.buses, &robot.servos)?;
    let mut found = ServoCheck::default();
    let (deviations, refused) = (bus.deviations()?, bus.refused()?);
    found.lines.extend(deviations.iter().map(|deviation| line(robot, deviation)));
    found.lines.extend(refused.iter().map(ToString::to_string));
    found.open = count_open(&deviations) + refused.len();
    let fixable = |found: &&ServoDeviation| matches!(found.deviation.remedy, Remedy::Write(_));
    if !fix || deviations.iter().filter(fixable).count() == 0 {
        return Ok(found);
    }
    consent.obtain(&format!(
        "Torque goes off on all {} servos of {}: hold the robot.",
        robot.servos.len(),
        robot.name
    ))?;
    bus.disarm()?;
    found.lines.extend(bus.set_up()?);
    found.open = count_open(&bus.deviations()?) + bus.refused()?.len();
    Ok(found)
}

fn count_open(deviations: &[ServoDeviation]) -> usize {
    deviations.iter().filter(|found| found.deviation.remedy != Remedy::Tell).count()
}

fn line(robot: &Robot, found: &ServoDeviation) -> String {
    let servo = &robot.servos[found.index];
    format!("{} (id {}): {}", servo.name, servo.id, found.deviation.line())
}
