//! How fast the buses of a robot are: the drivers against simulated servos in
//! real time, with the time imposed that bytes and frames take on the wire.
//!
//! Each bus is measured by itself, as they run side by side: the slowest one
//! gives the robot's rate. Figures are this machine's, and those of a machine
//! with other work to do are worse.

use crate::bench::bus_cycles::{BusBench, bare_wait_us, bench_bus};
use anyhow::Context;
use serde::Serialize;
use servodance_drivers::{BusConfig, BusLayout, Servo, check_rate};
use servodance_runtime::bus_tools::sim_link::{LinkChoice, sim_link};
use servodance_runtime::process::realtime::{Awake, OrdinaryAfterwards, ThreadRole, raise};
use servodance_runtime::robot::Robot;
use std::collections::BTreeMap;
use std::fmt;

const PACES_HZ: [u32; 3] = [100, 250, 500];
/// How late a reply may be, and how long the host silent, before the run fails.
const PATIENCE_MS: f64 = 500.0;
const LONGEST_WATCHDOG_MS: u32 = 2540;
const RUN_S: f64 = 3.0;

/// The rates that a robot's buses reach on this machine.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct BusBenchReport {
    pub robot: String,
    /// What is between driver and simulated servos; the wire's own time comes on top.
    pub link: LinkChoice,
    /// Cycles a second of the slowest bus, as fast as it goes: the median over
    /// windows of 50 cycles.
    pub hz: f64,
    /// What the wire of that bus carries at best.
    pub wire_limit_hz: f64,
    /// Processor time of the drivers for one cycle of every bus, microseconds.
    pub cpu_us_per_cycle: f64,
    /// How much of that the kernel took: the serial port, sleeping and waking up.
    pub kernel_us_per_cycle: f64,
    /// Processor time of one wait of this system without a driver, microseconds.
    pub bare_wait_us: f64,
    /// How late cycles began, 99th percentile, microseconds, at the robot's own rate.
    pub jitter_us_p99: f64,
    pub jitter_us_p99_at_hz: BTreeMap<u32, Option<f64>>,
    /// How many servos were on the buses then: all, or as many as the wires carry.
    pub jitter_servos_at_hz: BTreeMap<u32, usize>,
    /// Whether the system kept the processors awake between cycles: where not,
    /// each cycle also waits for one to wake up, twice.
    pub kept_awake: bool,
    /// Whether the system ran the driver before ordinary work, as it does the control loop of a
    /// dance.
    pub real_time: bool,
    pub buses: Vec<BusRate>,
}

/// The rate that one bus reaches by itself.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct BusRate {
    /// Its name; empty for an only bus.
    pub name: String,
    pub servos: usize,
    pub baud: u32,
    /// Cycles a second, as fast as it goes: the median over windows of 50 cycles.
    pub hz: f64,
    /// The mean over the whole run, stalls of this machine included.
    pub hz_mean: f64,
    pub wire_limit_hz: f64,
    /// Processor time of the driver for one cycle, microseconds.
    pub cpu_us_per_cycle: f64,
    pub kernel_us_per_cycle: f64,
}

/// Measures every bus of the robot.
/// Fails for: a rate that the servos cannot be set to, or a bus that fails.
pub fn run(robot: &Robot, baud: Option<u32>, link: LinkChoice) -> anyhow::Result<BusBenchReport> {
    let awake = Awake::keep();
    let _afterwards = OrdinaryAfterwards;
    let real_time = raise(ThreadRole::Control).is_ok();
    let layouts: Vec<BusLayout> =
        robot.buses.iter().map(|bus| at_baud(bus, baud)).collect::<Result<_, _>>()?;
    let mut buses = Vec::with_capacity(layouts.len());
    for layout in &layouts {
        buses.push(flat_out(layout, link)?);
    }
    let slowest = buses.iter().min_by(|a, b| a.hz.total_cmp(&b.hz));
    let slowest = slowest.context("the robot has no bus")?;
    let (own, _) = jitter_us(&layouts, robot.control_hz, link)?;
    let (mut paces, mut servos) = (BTreeMap::new(), BTreeMap::new());
    for hz in PACES_HZ {
        let (jitter_us, count) = jitter_us(&layouts, f64::from(hz), link)?;
        paces.insert(hz, jitter_us);
        servos.insert(hz, count);
    }
    Ok(BusBenchReport {
        robot: robot.name.clone(),
        link,
        hz: slowest.hz,
        wire_limit_hz: slowest.wire_limit_hz,
        cpu_us_per_cycle: buses.iter().map(|bus| bus.cpu_us_per_cycle).sum(),
        kernel_us_per_cycle: buses.iter().map(|bus| bus.kernel_us_per_cycle).sum(),
        bare_wait_us: bare_wait_us(),
        jitter_us_p99: own.with_context(|| {
            let hz = robot.control_hz;
            format!("the wire does not carry the robot's {hz} cycles a second")
        })?,
        jitter_us_p99_at_hz: paces,
        jitter_servos_at_hz: servos,
        kept_awake: awake.is_some(),
        real_time,
        buses,
    })
}

fn at_baud(bus: &BusLayout, baud: Option<u32>) -> anyhow::Result<BusLayout> {
    let config = BusConfig {
        baud: baud.unwrap_or(bus.config.baud),
        // A machine that stalls is not what is measured.
        reply_timeout_ms: PATIENCE_MS.max(bus.config.reply_timeout_ms),
        watchdog_ms: LONGEST_WATCHDOG_MS,
        ..bus.config.clone()
    };
    Ok(BusLayout { config: config.checked()?, ..bus.clone() })
}

fn flat_out(layout: &BusLayout, link: LinkChoice) -> anyhow::Result<BusRate> {
    let limit_hz = wire_limit_hz(layout)?;
    let cycles = (limit_hz * RUN_S).ceil() as usize;
    let bench = bench(&layout.servos, layout, None, cycles, link)?;
    Ok(BusRate {
        name: layout.config.name.clone(),
        servos: layout.servos.len(),
        baud: layout.config.baud,
        hz: bench.hz,
        hz_mean: bench.hz_mean,
        wire_limit_hz: bench.wire_limit_hz,
        cpu_us_per_cycle: bench.cpu_us_per_cycle,
        kernel_us_per_cycle: bench.kernel_us_per_cycle,
    })
}

/// A run behind this link; the wire alone, no USB adapter's delay.
fn bench(
    servos: &[Servo],
    layout: &BusLayout,
    control_hz: Option<f64>,
    cycles: usize,
    link: LinkChoice,
) -> anyhow::Result<BusBench> {
    let link = sim_link(&layout.config, Some(link), 0)?;
    bench_bus(servos, &layout.config, control_hz, cycles, 0.0, link)
}

fn wire_limit_hz(layout: &BusLayout) -> anyhow::Result<f64> {
    Ok(check_rate(&layout.config, &layout.servos, 1.0)?.fast_hz)
}

/// The worst bus's jitter at a rate, each with as many of its servos as its wire
/// carries then, and how many those are; `None` if a wire carries not even one.
fn jitter_us(
    layouts: &[BusLayout],
    hz: f64,
    link: LinkChoice,
) -> anyhow::Result<(Option<f64>, usize)> {
    let (mut worst_us, mut servos) = (0.0f64, 0);
    for layout in layouts {
        let carried = carried(layout, hz);
        if carried.is_empty() {
            return Ok((None, 0));
        }
        servos += carried.len();
        let cycles = (hz * RUN_S).ceil() as usize;
        let bench = bench(carried, layout, Some(hz), cycles, link)?;
        worst_us = worst_us.max(bench.jitter_us_p99);
    }
    Ok((Some(worst_us), servos))
}

/// The first servos of a bus, as many as the wire carries at a rate with a
/// tenth to spare: without, one late cycle makes all later ones late.
fn carried(layout: &BusLayout, hz: f64) -> &[Servo] {
    let fits = |count: &usize| {
        let servos = &layout.servos[..*count];
        check_rate(&layout.config, servos, hz * 1.1).is_ok()
    };
    let most = (1..=layout.servos.len()).rev().find(fits);
    &layout.servos[..most.unwrap_or(0)]
}

impl fmt::Display for BusBenchReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for bus in &self.buses {
            let BusRate { name, servos, baud, hz, hz_mean, wire_limit_hz, .. } = bus;
            let BusRate { cpu_us_per_cycle, kernel_us_per_cycle, .. } = bus;
            let colon = if name.is_empty() { "" } else { ": " };
            let share = 100.0 * hz / wire_limit_hz;
            writeln!(
                f,
                "{name}{colon}{servos} servos at {baud} baud: {hz:.1} cycles a second ({hz_mean:.1} \
                 mean), {share:.1} % of the wire's {wire_limit_hz:.1}; {cpu_us_per_cycle:.1} us of \
                 processor a cycle, {kernel_us_per_cycle:.1} of them in the kernel"
            )?;
        }
        writeln!(
            f,
            "a wait alone takes {:.1} us of processor here; a cycle waits for its servos, and for a \
             motion sensor",
            self.bare_wait_us
        )?;
        if !self.kept_awake {
            writeln!(
                f,
                "the processors may sleep between cycles, which takes some of that \
                 (allowed to write /dev/cpu_dma_latency, this command keeps them awake)"
            )?;
        }
        if !self.real_time {
            writeln!(
                f,
                "the driver waits behind ordinary work, which takes some of that as well (a dance \
                 asks for real-time priority, which is not allowed here)"
            )?;
        }
        writeln!(
            f,
            "cycles begin late by (99th percentile): {:.0} us at the robot's own rate",
            self.jitter_us_p99
        )?;
        for (hz, jitter_us) in &self.jitter_us_p99_at_hz {
            let servos = self.jitter_servos_at_hz.get(hz).copied().unwrap_or(0);
            match jitter_us {
                Some(jitter_us) => writeln!(f, "  {hz} Hz: {jitter_us:.0} us ({servos} servos)")?,
                None => writeln!(f, "  {hz} Hz: more than the wire carries")?,
            }
        }
        Ok(())
    }
}
