//! Serving simulated servos to other programs, and measuring a bus.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};
use servodance_drivers::{Bus, BusConfig, BusError, DynamixelBus, Servo, check_rate};
use servodance_types::{Clock, JointState, WallClock};

use crate::judge::Violations;
use crate::sim_bus::{SimBus, WireStats};
use crate::spec::{SimError, SimOptions, SimServoSpec};

/// Serves servos in real time until `stop` is set. `ready` is told the port to open.
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

/// What a bus reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusBench {
    /// Cycles a second, goals out and states in.
    pub hz: f64,
    /// What the wire carries with the read that was used.
    pub wire_limit_hz: f64,
    /// Processor time of the driver's thread for one cycle, microseconds.
    pub cpu_us_per_cycle: f64,
    /// How late cycles began against their schedule, 99th percentile,
    /// microseconds; with no schedule, how much longer than the median a cycle took.
    pub jitter_us_p99: f64,
}

/// Why a measurement failed.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The simulated bus did not start.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// The driver failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The configuration cannot work.
    #[error(transparent)]
    Config(#[from] servodance_drivers::ConfigError),
}

/// Runs the driver against simulated servos in real time, wire time imposed:
/// at `control_hz`, or as fast as the bus goes.
pub fn bench_bus(
    servos: &[Servo],
    config: &BusConfig,
    control_hz: Option<f64>,
    cycles: usize,
) -> Result<BusBench, BenchError> {
    let specs: Vec<SimServoSpec> = servos.iter().map(Into::into).collect();
    let judged_hz = control_hz.unwrap_or(100.0);
    let sim = SimBus::start(&specs, SimOptions::realtime(config.baud, judged_hz))?;
    let limits = check_rate(config, servos, control_hz.unwrap_or(1.0))?;
    let mut bus = DynamixelBus::open(sim.port_path(), config, servos.to_vec())?;
    let report = bus.arm()?;
    let targets: Vec<f64> = report.states.iter().map(|s| s.position_rad).collect();
    let mut states = report.states;
    let mut run = |count, begins: &mut Vec<f64>| {
        cycle_on(&mut bus, &targets, &mut states, control_hz, count, begins)
    };
    let mut begins = Vec::with_capacity(cycles);
    run(cycles.min(50), &mut begins)?; // caches and pages
    begins.clear();
    let cpu = thread_cpu_s();
    let elapsed_s = run(cycles, &mut begins)?;
    let cpu_s = thread_cpu_s() - cpu;
    let fast = bus.is_fast();
    bus.disarm()?;
    Ok(BusBench {
        hz: cycles as f64 / elapsed_s,
        wire_limit_hz: if fast {
            limits.fast_hz
        } else {
            limits.plain_hz
        },
        cpu_us_per_cycle: cpu_s / cycles as f64 * 1e6,
        jitter_us_p99: jitter_us_p99(&begins, control_hz),
    })
}

/// `count` cycles, on a schedule if there is one; when each began, and how long all took.
fn cycle_on(
    bus: &mut DynamixelBus,
    targets: &[f64],
    states: &mut [JointState],
    control_hz: Option<f64>,
    count: usize,
    begins: &mut Vec<f64>,
) -> Result<f64, BusError> {
    let clock = WallClock::start();
    for k in 0..count {
        if let Some(hz) = control_hz {
            let due_s = k as f64 / hz;
            let wait_s = due_s - clock.now_s();
            if wait_s > 0.0 {
                std::thread::sleep(Duration::from_secs_f64(wait_s));
            }
        }
        begins.push(clock.now_s());
        bus.cycle(targets, states)?;
    }
    Ok(clock.now_s())
}

fn jitter_us_p99(begins: &[f64], control_hz: Option<f64>) -> f64 {
    let mut late: Vec<f64> = match control_hz {
        Some(hz) => {
            let on_schedule = begins.iter().enumerate();
            on_schedule
                .map(|(k, begin)| begin - k as f64 / hz)
                .collect()
        }
        None => begins.windows(2).map(|pair| pair[1] - pair[0]).collect(),
    };
    late.sort_by(f64::total_cmp);
    let at = |share: f64| late.get((late.len() as f64 * share) as usize).copied();
    let base = control_hz.map_or_else(|| at(0.5), |_| Some(0.0));
    match (at(0.99), base) {
        (Some(p99), Some(base)) => (p99 - base) * 1e6,
        _ => 0.0,
    }
}

/// Processor time of this thread.
fn thread_cpu_s() -> f64 {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)
        .map(|time| Duration::from(time).as_secs_f64())
        .unwrap_or(f64::NAN)
}
