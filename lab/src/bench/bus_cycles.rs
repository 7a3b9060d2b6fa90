//! Measuring a driver against simulated servos in real time, wire time imposed.

use std::time::{Duration, Instant};

#[cfg(target_os = "linux")]
use nix::sys::{
    resource::{UsageWho, getrusage},
    time::TimeValLike,
};
use nix::time::{ClockId, clock_gettime};
use servodance_drivers::{Bus, BusConfig, BusError, Servo, check_rate, open_bus, sleep_precisely};
use servodance_sim::{SimBus, SimLink, SimOptions, SimServoSpec};
use servodance_types::JointState;

/// Cycles of one window: their rates are compared, so that a machine that stalls
/// for a moment does not decide the figure.
const WINDOW: usize = 50;

/// What a driver and its bus reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusBench {
    /// Cycles a second, goals out and states in: the median over windows of 50 cycles.
    pub hz: f64,
    /// Cycles a second over the whole run, stalls of the machine included.
    pub hz_mean: f64,
    /// What the wire carries at best, cycles a second.
    pub wire_limit_hz: f64,
    /// How long a cycle took, median, microseconds.
    pub cycle_us_p50: f64,
    /// Processor time of the driver's thread for one cycle, microseconds.
    pub cpu_us_per_cycle: f64,
    /// How much of that the kernel took: the serial port, sleeping and waking up.
    pub kernel_us_per_cycle: f64,
    /// How late cycles began against their schedule, 99th percentile,
    /// microseconds; with no schedule, how much longer than the median a cycle took.
    pub jitter_us_p99: f64,
}

/// Runs `cycles` control cycles at `control_hz`, or as fast as the bus goes,
/// with a USB adapter that delays each reply by `adapter_s` (0: the wire alone),
/// behind `link`.
pub fn bench_bus(
    servos: &[Servo],
    config: &BusConfig,
    control_hz: Option<f64>,
    cycles: usize,
    adapter_s: f64,
    link: SimLink,
) -> anyhow::Result<BusBench> {
    sleep_precisely();
    let limits = check_rate(config, servos, control_hz.unwrap_or(1.0))?;
    let config = &BusConfig { control_hz, ..config.clone() };
    let specs: Vec<SimServoSpec> = servos.iter().map(Into::into).collect();
    let options = SimOptions {
        adapter_s,
        link,
        ..SimOptions::realtime(config.baud, control_hz.unwrap_or(100.0))
    };
    let sim = SimBus::start(&specs, options)?;
    let mut bus = open_bus(&sim.port(), config, servos.to_vec())?;
    let mut states = bus.arm()?.states;
    let targets: Vec<f64> = states.iter().map(|state| state.position_rad).collect();
    run(&mut *bus, &targets, &mut states, control_hz, 50)?; // caches and pages
    let (cpu_s, kernel_s) = (thread_cpu_s(), thread_kernel_s());
    let times = run(&mut *bus, &targets, &mut states, control_hz, cycles)?;
    let (cpu_s, kernel_s) = (thread_cpu_s() - cpu_s, thread_kernel_s() - kernel_s);
    bus.disarm()?;
    let taken: Vec<f64> = times.iter().map(|(began, ended)| ended - began).collect();
    let late = match control_hz {
        Some(hz) => percentile(times.iter().enumerate().map(|(k, t)| t.0 - k as f64 / hz), 0.99),
        None => percentile(taken.iter().copied(), 0.99) - percentile(taken.iter().copied(), 0.5),
    };
    let ended_s = times.last().map_or(f64::NAN, |(_, ended)| *ended);
    let rates = times.chunks_exact(WINDOW).map(|window| {
        let (began_s, ended_s) = (window[0].0, window[WINDOW - 1].1);
        WINDOW as f64 / (ended_s - began_s)
    });
    Ok(BusBench {
        hz: percentile(rates, 0.5),
        hz_mean: times.len() as f64 / ended_s,
        wire_limit_hz: limits.fast_hz,
        cycle_us_p50: percentile(taken.iter().copied(), 0.5) * 1e6,
        cpu_us_per_cycle: cpu_s / times.len() as f64 * 1e6,
        kernel_us_per_cycle: kernel_s / times.len() as f64 * 1e6,
        jitter_us_p99: late * 1e6,
    })
}

/// Processor time that one wait takes here by itself, microseconds: falling asleep and waking up,
/// with no driver. A cycle waits once for its servos, and once for a motion sensor.
pub fn bare_wait_us() -> f64 {
    const WAITS: u32 = 500;
    sleep_precisely();
    let began_s = thread_cpu_s();
    (0..WAITS).for_each(|_| std::thread::sleep(Duration::from_micros(300)));
    (thread_cpu_s() - began_s) / f64::from(WAITS) * 1e6
}

/// When each cycle began and ended, seconds.
fn run(
    bus: &mut dyn Bus,
    targets: &[f64],
    states: &mut [JointState],
    control_hz: Option<f64>,
    count: usize,
) -> Result<Vec<(f64, f64)>, BusError> {
    let mut times = Vec::with_capacity(count);
    let clock = Instant::now();
    for k in 0..count {
        if let Some(hz) = control_hz {
            let wait_s = k as f64 / hz - clock.elapsed().as_secs_f64();
            if wait_s > 0.0 {
                std::thread::sleep(Duration::from_secs_f64(wait_s));
            }
        }
        let began_s = clock.elapsed().as_secs_f64();
        bus.cycle(targets, states)?;
        times.push((began_s, clock.elapsed().as_secs_f64()));
    }
    Ok(times)
}

fn percentile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let index = (sorted.len() as f64 * share) as usize;
    sorted.get(index).copied().unwrap_or(f64::NAN)
}

fn thread_cpu_s() -> f64 {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID)
        .map(|time| Duration::from(time).as_secs_f64())
        .unwrap_or(f64::NAN)
}

/// The part of it that this thread spent in the kernel, where the system tells.
fn thread_kernel_s() -> f64 {
    #[cfg(target_os = "linux")]
    if let Ok(usage) = getrusage(UsageWho::RUSAGE_THREAD) {
        return usage.system_time().num_microseconds() as f64 * 1e-6;
    }
    f64::NAN
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_a_ramp() {
        let ramp = || (0..100).map(f64::from);
        assert_eq!((percentile(ramp(), 0.5), percentile(ramp(), 0.99)), (50.0, 99.0));
        assert!(percentile(std::iter::empty(), 0.5).is_nan());
    }
}
