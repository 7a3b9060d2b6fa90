//! Serial ports, CAN interfaces, and what a robot's buses carry.

use super::Finding;
use crate::robot::Robot;
use servodance_drivers::{BusKind, BusLayout, available_ports, check_rate, latency_timer};
use std::fs::OpenOptions;
use std::path::Path;

/// Serial ports that look like adapters, with what slows them down. Boards have
/// dozens of `ttyS` that lead nowhere: those are left out.
pub fn serial() -> Vec<Finding> {
    let ports: Vec<String> =
        available_ports().into_iter().filter(|port| !port.contains("/ttyS")).collect();
    if ports.is_empty() {
        return vec![Finding::good(
            "serial",
            "no USB serial adapter is plugged in: fine for the simulated bus",
        )];
    }
    ports.iter().map(|port| serial_port(port)).collect()
}

fn serial_port(port: &str) -> Finding {
    use std::io::ErrorKind::PermissionDenied;
    let opened = OpenOptions::new().read(true).write(true).open(port);
    if opened.is_err_and(|error| error.kind() == PermissionDenied) {
        return Finding::bad(
            "serial",
            format!("{port} may not be opened by this user"),
            "sudo usermod -aG dialout $USER, then log in again (or install packaging/60-servodance.rules)",
        );
    }
    let Some(timer) = latency_timer(port) else {
        return Finding::good("serial", format!("{port} can be opened"));
    };
    let what = format!("{port} has a latency timer of {} ms", timer.latency_ms);
    match timer.note(port) {
        Some(remedy) => Finding::warning("serial", what, remedy),
        None => Finding::good("serial", what),
    }
}

/// The system's CAN interfaces and whether they are up.
pub fn can() -> Vec<Finding> {
    can_in(Path::new("/sys/class/net"))
}

/// What `type` says of a CAN interface (ARPHRD_CAN of Linux's if_arp.h).
const ARPHRD_CAN: &str = "280";

fn can_in(interfaces: &Path) -> Vec<Finding> {
    let Ok(entries) = std::fs::read_dir(interfaces) else {
        return Vec::new();
    };
    let read = |path: &Path, file: &str| {
        let text = std::fs::read_to_string(path.join(file)).unwrap_or_default();
        text.trim().to_owned()
    };
    let mut found: Vec<Finding> = entries
        .flatten()
        .filter(|entry| read(&entry.path(), "type") == ARPHRD_CAN)
        .map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            match read(&entry.path(), "operstate").as_str() {
                "down" => Finding::warning(
                    "CAN",
                    format!("{name} is down"),
                    format!("sudo ip link set {name} up type can bitrate 1000000"),
                ),
                state => Finding::good("CAN", format!("{name} is there (state {state})")),
            }
        })
        .collect();
    found.sort_by(|a, b| a.what.cmp(&b.what));
    found
}

/// The control rate against what each bus of the robot carries.
pub fn rates(robot: &Robot) -> Vec<Finding> {
    let one = |bus: &BusLayout| {
        let name = match bus.config.name.as_str() {
            "" => format!("the bus of {}", robot.name),
            name => format!("bus {name} of {}", robot.name),
        };
        match check_rate(&bus.config, &bus.servos, robot.control_hz) {
            Ok(rate) => Finding::good(
                "bus",
                format!(
                    "{name} carries {:.0} cycles a second ({:.0} at worst), {:.0} are wanted",
                    rate.fast_hz, rate.plain_hz, robot.control_hz
                ),
            ),
            Err(error) => Finding::bad(
                "bus",
                format!("{name}: {error}"),
                "raise the baud rate or lower control_hz in the robot file",
            ),
        }
    };
    robot.buses.iter().map(one).collect()
}

/// Servos that would go on driving under a program that was killed, unless somebody has said
/// that this is known.
pub fn watchdogs(robot: &Robot) -> Vec<Finding> {
    let lacks = |bus: &&BusLayout| {
        let lacks_one = matches!(bus.config.kind, BusKind::Feetech | BusKind::Dynamixel1);
        lacks_one && !bus.config.accept_no_watchdog
    };
    let one = |bus: &BusLayout| {
        let model = bus.servos.first().map_or("its servos", |servo| servo.model.name);
        Finding::warning(
            "watchdog",
            format!("{model} has none: a killed program leaves it driving, so nothing moves it"),
            "accept_no_watchdog = true in the [bus] table, and a hand on the power switch",
        )
    };
    robot.buses.iter().filter(lacks).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn can_interfaces_are_told_from_others_and_from_sleeping_ones() {
        let folder = tempfile::tempdir().unwrap();
        let interface = |name: &str, kind: &str, state: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir(&path).unwrap();
            std::fs::write(path.join("type"), format!("{kind}\n")).unwrap();
            std::fs::write(path.join("operstate"), format!("{state}\n")).unwrap();
        };
        interface("eth0", "1", "up");
        interface("can1", ARPHRD_CAN, "down");
        interface("can0", ARPHRD_CAN, "up");
        let found = can_in(folder.path());
        let verdicts: Vec<Verdict> = found.iter().map(|finding| finding.verdict).collect();
        assert_eq!(verdicts, [Verdict::Good, Verdict::Warning], "{found:?}");
        assert!(found[1].what.contains("can1"), "{found:?}");
    }

    #[test]
    fn servos_without_a_watchdog_are_told_of_unless_that_is_known() {
        let mut robot = Robot::load("so101").unwrap();
        robot.buses[0].config.accept_no_watchdog = false;
        assert!(watchdogs(&robot)[0].what.contains("STS3215"));
        robot.buses[0].config.accept_no_watchdog = true;
        assert!(watchdogs(&robot).is_empty());
        assert!(watchdogs(&Robot::load("op3").unwrap()).is_empty());
    }

    #[test]
    fn every_built_in_robot_fits_its_bus() {
        for built_in in crate::robot::BUILT_IN {
            let robot = Robot::load(built_in.name).unwrap();
            let found = rates(&robot);
            assert_eq!(found.len(), robot.buses.len());
            assert!(found.iter().all(|f| f.verdict == Verdict::Good), "{found:?}");
        }
    }
}
