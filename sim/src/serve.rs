//! Serving simulated servos to other programs.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::judge::Violations;
use crate::sim_bus::{SimBus, WireStats};
use crate::spec::{SimError, SimOptions, SimServoSpec};

/// Serves servos, in real time by the options, until `stop` is set. `ready` is
/// told the port to open. Returns what passed over the wire and which limits
/// were broken.
pub fn serve(
    specs: &[SimServoSpec],
    options: SimOptions,
    stop: &AtomicBool,
    ready: impl FnOnce(&str),
) -> Result<(WireStats, Violations), SimError> {
    let sim = SimBus::start(specs, options)?;
    ready(sim.port_path());
    while !stop.load(Ordering::Acquire) {
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok((sim.wire_stats(), sim.violations()))
}
