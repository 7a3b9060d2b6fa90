//! Serving a robot's simulated servos to other programs.

use crate::robot::Robot;
use crate::sim_link::{LinkChoice, sim_link};
use servodance_sim::{SimBus, SimOptions, SimServoSpec, Violations, WireStats};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

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
