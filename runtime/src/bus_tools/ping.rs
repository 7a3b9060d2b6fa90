//! Whether a servo answers, and its state.

use super::listen::{ProtocolChoice, SerialListener, line, vitals};
use super::plug;
use crate::robot::Robot;
use servodance_drivers::{open_bus, open_buses};

/// The line about one id.
pub fn servo(
    port: &str,
    id: u8,
    baud: Option<u32>,
    protocol: ProtocolChoice,
) -> anyhow::Result<String> {
    let (mut probe, found) = SerialListener::new(port, baud, protocol)?.find(id)?;
    let vitals = vitals(&mut probe, &found);
    Ok(line(&found, &vitals))
}

/// A line for each joint of a robot, or for one of them: where it stands. All
/// that are asked must answer. `ports` are those of its buses.
pub fn joints(robot: &Robot, ports: &[String], joint: Option<&str>) -> anyhow::Result<Vec<String>> {
    let mut bus = match joint {
        None => open_buses(&plug::ports(robot, ports)?, &robot.buses, &robot.servos)?,
        Some(joint) => {
            let (port, layout) = plug::joint(robot, joint, ports)?;
            open_bus(&port, &layout.config, layout.servos)?
        }
    };
    let states = bus.observe()?;
    let lines = bus.servos().iter().zip(&states).map(|(servo, state)| {
        let limits = servo.limits;
        let inside = (limits.lower_rad..=limits.upper_rad).contains(&state.position_rad);
        format!(
            "{:<14} id {:>3}  {}  at {:>7.1} degrees{}",
            servo.name,
            servo.id,
            servo.model.name,
            state.position_rad.to_degrees(),
            if inside { "" } else { ", outside its limits" }
        )
    });
    Ok(lines.collect())
}
