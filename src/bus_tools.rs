//! Looking at a bus, and serving a simulated one: what people need before a
//! robot dances.

use crate::robot::Robot;
use crate::sim_link::{LinkChoice, sim_link};
use anyhow::bail;
use servodance_drivers::{BAUDS, Found, available_ports};
use servodance_sim::{SimBus, SimOptions, SimServoSpec, Violations, WireStats};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long a servo may take to answer a ping, on top of the time on the wire.
const PATIENCE: Duration = Duration::from_millis(30);

/// The serial ports of this machine, a line each.
pub fn ports() -> Vec<String> {
    let ports = available_ports();
    if ports.is_empty() {
        return vec![
            "no serial port found; plug the adapter in, or see `servodance sim-bus`".into(),
        ];
    }
    ports
}

/// Every servo that answers on `port`, a line each; all usual baud rates unless
/// one is given.
pub fn scan(port: &str, baud: Option<u32>) -> anyhow::Result<Vec<String>> {
    let bauds = baud.map_or(BAUDS.to_vec(), |baud| vec![baud]);
    let mut lines = Vec::new();
    for baud in &bauds {
        let found = servodance_drivers::scan(port, *baud, PATIENCE)?;
        lines.extend(found.iter().map(line));
    }
    if lines.is_empty() {
        bail!(
            "{port}: no servo answered at {bauds:?} baud; check power, wiring, and the protocol (2.0)"
        );
    }
    Ok(lines)
}

fn line(found: &Found) -> String {
    format!(
        "{} baud  id {:>3}  {} ({})  firmware {}  {}",
        found.baud,
        found.id,
        found.model.unwrap_or("unknown model"),
        found.model_number,
        found.firmware,
        found.hardware_error.as_deref().unwrap_or("no error")
    )
}

/// Serves the robot's servos in real time until `stop` is set; `ready` is told
/// the serial port to open, `NAME=PORT` for each bus where there are several.
/// Returns one line about what was seen.
pub fn serve(
    robot: &Robot,
    link: Option<LinkChoice>,
    stop: &AtomicBool,
    ready: impl Fn(&str),
) -> anyhow::Result<String> {
    let mut sims = Vec::with_capacity(robot.buses.len());
    for (place, bus) in robot.buses.iter().enumerate() {
        let specs: Vec<SimServoSpec> = bus.servos.iter().map(SimServoSpec::from).collect();
        let options = SimOptions {
            link: sim_link(&bus.config, link, place)?,
            ..SimOptions::realtime(bus.config.baud, robot.control_hz)
        };
        sims.push(SimBus::start(&specs, options)?);
    }
    for (bus, sim) in robot.buses.iter().zip(&sims) {
        match bus.config.name.as_str() {
            "" => ready(sim.port_path()),
            name => ready(&format!("{name}={}", sim.port_path())),
        }
    }
    while !stop.load(Ordering::Acquire) {
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut wire = WireStats::default();
    let mut broken = Violations::default();
    for sim in &sims {
        wire += sim.wire_stats();
        broken += sim.violations();
    }
    Ok(format!(
        "{} packets in, {} out, {} bad; limits broken: position {}, velocity {}, acceleration {}",
        wire.packets_in,
        wire.packets_out,
        wire.bad_packets,
        broken.position,
        broken.velocity,
        broken.acceleration
    ))
}
