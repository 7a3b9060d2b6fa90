//! One fault, one dance, one row of the table.

use std::fmt::Write;

use servodance_drivers::{
    Bus, BusConfig, BusKind, ReplyClock, SafeBus, SafetyConfig, Servo, State, open_bus,
};
use servodance_sim::{SimBus, SimOptions, SimServoSpec, WireFault};
use servodance_types::JointState;

use super::{HZ, PERIOD_S};

pub const HEAD: &str = "\
| fault | the user is told | safe after, ms | retries | goals beyond a limit | motion beyond a limit |
|---|---|---|---|---|---|
";

/// What one fault came to.
#[derive(Debug)]
pub struct Outcome {
    /// The error that the program saw, if it could not dance on.
    pub error: Option<String>,
    /// From the fault until every servo had no torque or stood by its own
    /// watchdog, simulated seconds. Zero periods when the dance went on.
    pub safe_after_s: f64,
    pub retries: u64,
    /// What the safety layer remarked on the way.
    pub remarks: Vec<String>,
    /// By the true motion, and by what was told.
    pub went: u64,
    pub told: u64,
    pub notes: Vec<String>,
}

/// Something that happens at a time, seconds.
pub type Event<'a> = (f64, Box<dyn FnOnce(&mut SimBus) + 'a>);

/// By whose clock a reply is lost.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum LostBy {
    /// The simulation's: however busy the machine is.
    Simulation,
    /// The wall's, as on real servos: what a fault holds back is late.
    Wall,
}

/// Whose clock shows what this fault does.
pub fn clock_for(fault: WireFault) -> LostBy {
    match fault {
        WireFault::Late(_) => LostBy::Wall,
        _ => LostBy::Simulation,
    }
}

/// Dances these servos, lets `happen` take place after 2 s, goes on for 3 s more.
pub fn dance(
    servos: &[Servo],
    specs: &[SimServoSpec],
    config: BusConfig,
    clock: LostBy,
    happen: impl FnOnce(&mut SimBus),
) -> Outcome {
    let safety = SafetyConfig::at_hz(HZ);
    let events: Vec<Event> = vec![(2.0, Box::new(happen))];
    play(servos, specs, config, clock, safety, events)
}

/// Dances these servos until 3 s after the last of the events.
pub fn play(
    servos: &[Servo],
    specs: &[SimServoSpec],
    config: BusConfig,
    clock: LostBy,
    safety: SafetyConfig,
    events: Vec<Event<'_>>,
) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("port");
    // The table is the same wherever it is written.
    let usual = |text: String| text.replace(&*path.to_string_lossy(), "/dev/ttyUSB0");
    let options = SimOptions { path: Some(path.clone()), ..SimOptions::lockstep(config.baud, HZ) };
    let mut sim = SimBus::start(specs, options).unwrap();
    let config = BusConfig {
        accept_no_watchdog: true,
        reply_clock: match clock {
            LostBy::Simulation => sim.reply_clock(),
            LostBy::Wall => ReplyClock::Wall,
        },
        ..config
    };
    let bus = open_bus(&sim.port(), &config, servos.to_vec()).unwrap();
    let mut safe = SafeBus::new(bus, safety).unwrap();
    // Nothing is wrong yet but a busy machine, which may stall for longer than all tries.
    assert!((0..5).any(|_| safe.arm(0.0).is_ok()), "not armed");
    let mut states = vec![JointState::default(); servos.len()];
    let mut error = None;
    let last_s = events.last().map_or(2.0, |event| event.0);
    let mut events = events.into_iter().peekable();
    for k in 0..((last_s + 3.0) * HZ) as usize {
        let now_s = k as f64 * PERIOD_S;
        if let Some((_, happen)) = events.next_if(|event| event.0 <= now_s) {
            happen(&mut sim);
        }
        // Each joint its own way, so that one that follows a neighbour's goals breaks its limits.
        let swing = |joint: usize| 0.6 * (1.0 - ((4.0 - 0.4 * joint as f64) * now_s).cos());
        let targets: Vec<f64> = (0..servos.len()).map(swing).collect();
        safe.command(now_s, &targets);
        if let Err(reason) = safe.tick(now_s, &mut states) {
            error = Some(usual(reason.to_string()));
            break;
        }
        sim.advance(PERIOD_S);
    }
    let began_s = if error.is_some() { 2.0 } else { sim.time_s() };
    let mut waited = 0;
    while error.is_some() && !is_safe(&sim, servos) && waited < 1000 {
        sim.advance(PERIOD_S);
        waited += 1;
    }
    Outcome {
        error,
        safe_after_s: sim.time_s() - began_s,
        retries: safe.stats().retries,
        remarks: remarks(&safe).into_iter().map(usual).collect(),
        went: sim.motion_violations().total(),
        told: sim.violations().total() - sim.motion_violations().total(),
        notes: sim.violation_notes(),
    }
}

/// What was said beyond the states that every dance has.
fn remarks(safe: &SafeBus<Box<dyn Bus>>) -> Vec<String> {
    let told = safe.transitions().iter();
    let told = told.filter(|t| t.from == t.to || t.from == State::Fault || t.to == State::Fault);
    told.map(|t| t.cause.clone()).collect()
}

/// No torque, stopped by its own watchdog, or (where there is none) at rest.
fn is_safe(sim: &SimBus, servos: &[Servo]) -> bool {
    servos.iter().enumerate().all(|(index, servo)| {
        let state = sim.servo(index).unwrap();
        let rests = !has_watchdog(servo) && state.velocity_rad_s.abs() < 0.02;
        !state.torque_enabled || state.watchdog_tripped || rests
    })
}

fn has_watchdog(servo: &Servo) -> bool {
    match &servo.motor {
        // CubeMars and RobStride motors in MIT mode have none.
        Some(motor) => motor.model.has_registers,
        None => servo.model.kind == BusKind::Dynamixel2,
    }
}

/// Adds a row, and checks what every row must hold.
pub fn row(table: &mut String, what: &str, outcome: &Outcome) {
    assert!(outcome.went == 0, "{what}: {:?}", outcome.notes);
    // A lost goal makes the next a double step, goals said again because an answer is late
    // bunch up, and a motor on CAN with another's id hears one command of the other's before
    // its silence is known: nobody can take that back.
    let astray = ["damaged request", "commands lost", "late by 150 ms", "asked by its command"];
    let astray = astray.iter().any(|word| what.contains(word));
    assert!(outcome.told == 0 || astray, "{what}: {:?}", outcome.notes);
    let recovered = match outcome.remarks.join("; ").as_str() {
        "" => "danced on".into(),
        remarks => format!("danced on: {remarks}"),
    };
    let told = outcome.error.as_ref().unwrap_or(&recovered);
    let safe_ms = outcome.safe_after_s * 1e3;
    assert!(outcome.error.is_none() || safe_ms < 2500.0, "{what}: {outcome:?}");
    writeln!(
        table,
        "| {what} | {told} | {safe_ms:.0} | {} | {} | {} |",
        outcome.retries, outcome.told, outcome.went
    )
    .unwrap();
}
