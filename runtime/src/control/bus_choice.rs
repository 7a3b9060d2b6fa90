//! The port of each bus of the robot: the values of `--bus`.
//!
//! `sim` stands for every bus. Refused, with the buses' names listed: a bus
//! that is unknown, given twice, or left without a port.

use crate::robot::Robot;
use anyhow::{anyhow, bail};
use servodance_drivers::{BusLayout, Port};

/// Where commands of one bus go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusChoice {
    /// Servos that this program simulates.
    Sim,
    /// Real servos behind a port.
    Port(Port),
}

impl BusChoice {
    fn parse(text: &str) -> anyhow::Result<Self> {
        if text == "sim" {
            return Ok(Self::Sim);
        }
        Ok(Self::Port(
            named(text)
                .parse()
                .map_err(|error| anyhow!("--bus: {error} (or sim, for simulated servos)"))?,
        ))
    }

    fn name(&self) -> String {
        match self {
            Self::Sim => "sim".into(),
            Self::Port(port) => port.to_string(),
        }
    }
}

/// `serial:PATH` for a bare path, as of a device; other texts as they are.
pub fn named(port: &str) -> String {
    match port.starts_with('/') {
        true => format!("serial:{port}"),
        false => port.to_owned(),
    }
}

/// One choice a bus, from values like `sim`, `serial:PATH`, `NAME=serial:PATH`;
/// a bare path is that of a serial port.
pub fn choose(robot: &Robot, given: &[String]) -> anyhow::Result<Vec<BusChoice>> {
    choose_for(&robot.buses, given)
}

fn choose_for(buses: &[BusLayout], given: &[String]) -> anyhow::Result<Vec<BusChoice>> {
    if given == ["sim"] {
        return Ok(vec![BusChoice::Sim; buses.len()]);
    }
    // A controller has all joints.
    if let [one] = given
        && one.starts_with("ros2:")
    {
        return Ok(vec![BusChoice::parse(one)?; buses.len()]);
    }
    let names: Vec<&str> = buses.iter().map(|bus| bus.config.name.as_str()).collect();
    let wanted: Vec<String> = buses
        .iter()
        .map(|bus| {
            let port = if bus.config.kind.is_can() { "can:IFACE" } else { "serial:PATH" };
            format!("--bus {}={port}", bus.config.name)
        })
        .collect();
    let wanted = wanted.join(" ");
    let mut chosen: Vec<Option<BusChoice>> = vec![None; buses.len()];
    for text in given {
        let (name, port) = match text.split_once('=') {
            Some((name, port)) if !name.contains(':') => (Some(name), port),
            _ => (None, text.as_str()),
        };
        let place =
            match name {
                None if buses.len() == 1 => 0,
                None => bail!("--bus {text}: the robot has several buses; say {wanted}"),
                Some(name) => names.iter().position(|known| *known == name).ok_or_else(|| {
                    match names.join(", ").as_str() {
                        "" => anyhow!(
                            "--bus {text}: the robot's one bus has no name; say --bus {port}"
                        ),
                        names => anyhow!("--bus {text}: no bus \"{name}\"; this robot has {names}"),
                    }
                })?,
            };
        if chosen[place].replace(BusChoice::parse(port)?).is_some() {
            bail!("--bus {text}: this bus has a port already");
        }
    }
    let missing = chosen.iter().position(Option::is_none);
    match missing.map(|place| names[place]) {
        Some(name) => bail!("--bus: no port for the bus \"{name}\"; say {wanted}"),
        None => Ok(chosen.into_iter().flatten().collect()),
    }
}

/// All choices in a few words, for reports.
pub fn names(robot: &Robot, choices: &[BusChoice]) -> String {
    if choices.iter().all(|choice| *choice == BusChoice::Sim) {
        return BusChoice::Sim.name();
    }
    match choices {
        [one] => one.name(),
        several => robot
            .buses
            .iter()
            .zip(several)
            .map(|(bus, choice)| format!("{}={}", bus.config.name, choice.name()))
            .collect::<Vec<_>>()
            .join(" "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_drivers::BusConfig;

    fn chosen(names: &[&str], given: &[&str]) -> Result<Vec<String>, String> {
        let buses: Vec<BusLayout> = names
            .iter()
            .map(|name| BusLayout {
                config: BusConfig { name: (*name).into(), ..BusConfig::dynamixel2(1_000_000) },
                servos: Vec::new(),
                joints: Vec::new(),
            })
            .collect();
        let given: Vec<String> = given.iter().map(|text| (*text).into()).collect();
        match choose_for(&buses, &given) {
            Ok(choices) => Ok(choices.iter().map(BusChoice::name).collect()),
            Err(error) => Err(error.to_string()),
        }
    }

    #[test]
    fn each_bus_gets_its_port() {
        let left = "left=serial:/dev/ttyUSB0";
        let right = "right=can:can0";
        let check = |names: &[&str], given: &[&str], ports: &[&str]| {
            assert_eq!(chosen(names, given).unwrap(), ports, "{given:?}");
        };
        check(&[""], &["sim"], &["sim"]);
        check(&[""], &["serial:/dev/a=b"], &["serial:/dev/a=b"]);
        check(&["left", "right"], &["sim"], &["sim", "sim"]);
        check(&["left", "right"], &[right, left], &["serial:/dev/ttyUSB0", "can:can0"]);
        check(&["left", "right"], &["left=sim", right], &["sim", "can:can0"]);
        let ros2 = "ros2:127.0.0.1:9090/g1";
        check(&["left", "right"], &[ros2], &[ros2, ros2]);
    }

    #[test]
    fn what_does_not_fit_is_told_with_the_names() {
        for (names, given, says) in [
            (&[""][..], &["usb"][..], "choose serial:PATH"),
            (&[""], &["left=sim"], "has no name; say --bus sim"),
            (&["left", "right"], &["serial:/dev/a"], "several buses; say --bus left=serial:PATH"),
            (&["left", "right"], &["left=sim"], "no port for the bus \"right\""),
            (&["left", "right"], &["top=sim"], "this robot has left, right"),
            (&["left", "right"], &["left=sim", "left=sim"], "has a port already"),
        ] {
            let error = chosen(names, given).unwrap_err();
            assert!(error.contains(says), "{given:?}: {error}");
        }
    }
}
