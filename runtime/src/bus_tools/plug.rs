//! The ports of a robot's buses, for tools that need real servos (or those of
//! `sim-bus`).

use crate::control::bus_choice::BusChoice;
use crate::control::bus_choice::{choose, named};
use crate::robot::Robot;
use anyhow::{Context, bail};
use servodance_drivers::{BusLayout, Port};

/// The port of each bus of the robot, from the values of `--bus`.
pub fn ports(robot: &Robot, given: &[String]) -> anyhow::Result<Vec<Port>> {
    let given: Vec<String> = given.iter().map(|port| named(port)).collect();
    let chosen = choose(robot, &given)?;
    let port = |choice| match choice {
        BusChoice::Port(port) => Ok(port),
        BusChoice::Sim => {
            bail!("--bus sim ends with the program: start `servodance sim-bus` and give its port")
        }
    };
    chosen.into_iter().map(port).collect()
}

/// The bus that a joint is on, with that joint alone, and its port: `given` is
/// the one port of that bus, or as for [`ports`].
pub fn joint(robot: &Robot, joint: &str, given: &[String]) -> anyhow::Result<(Port, BusLayout)> {
    let servo = robot.servo(joint)?;
    let on_it = |bus: &&BusLayout| bus.servos.iter().any(|other| other.name == servo.name);
    let place = robot.buses.iter().position(|bus| on_it(&bus));
    let place = place.with_context(|| format!("joint {joint} is on no bus"))?;
    let layout = BusLayout {
        config: robot.buses[place].config.clone(),
        servos: vec![servo.clone()],
        joints: vec![0],
    };
    let port = match given {
        [one] if !one.contains('=') && one != "sim" => named(one).parse()?,
        several => ports(robot, several)?.remove(place),
    };
    Ok((port, layout))
}
