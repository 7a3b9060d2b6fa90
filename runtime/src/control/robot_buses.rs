//! The robot's buses as the control loop sees them: the safety layer, and below
//! it real servos, or simulated ones at the other end of a socket.
//!
//! The drivers are the same for both. Two things tell a simulated bus apart: its
//! port, and in simulated time the clock by which replies are waited for
//! (`reply_clock`).

use super::bus_choice::BusChoice;
use crate::process::speed::Speed;
use crate::robot::Robot;
use crate::telemetry::report::{BusReport, SafetyEvent, ViolationReport};
use anyhow::Context;
use servodance_drivers::{Bus, BusLayout, EStop, SafeBus, State, open_buses};
use servodance_sim::{
    Cue, Happening, SimBus, SimLink, SimOptions, SimServoSpec, Violations, happen,
};
use servodance_types::JointState;
use std::iter::Peekable;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

/// In lockstep the simulated servos themselves say when no reply will come
/// (`SimBus::reply_clock`): a busy machine must not look like a lost reply, or
/// runs would not be repeatable. This is for a program that has gone wrong.
const LOCKSTEP_TIMEOUT_MS: f64 = 60_000.0;
/// Slower than this a joint stands still, radians a second.
const STILL_RAD_S: f64 = 0.01;

/// Faults to inject at simulated servos.
#[derive(Clone, Debug, Default)]
pub struct FaultPlan {
    /// In the order of time, seconds since torque on.
    pub faults: Vec<Cue>,
    /// Which replies a fault of the wire hits.
    pub seed: u64,
}

impl FaultPlan {
    /// A path at which the port is found again after its adapter was unplugged
    /// and plugged in; `None` where that does not happen.
    fn path(&self) -> Option<PathBuf> {
        static PORTS: AtomicU64 = AtomicU64::new(0);
        let unplugs = |cue: &Cue| matches!(cue.what, Happening::Adapter(_));
        self.faults.iter().any(unplugs).then(|| {
            let number = PORTS.fetch_add(1, Ordering::Relaxed);
            let name = format!("servodance-{}-trial-{number}", std::process::id());
            std::env::temp_dir().join(name)
        })
    }
}

/// A robot on its buses. Dropped at any moment, it turns torque off.
pub struct RobotBuses {
    // Before `sims`, so dropped first: torque off needs servos that answer.
    bus: SafeBus<Box<dyn Bus>>,
    /// For each simulated bus its place among the robot's buses.
    sims: Vec<(usize, SimBus)>,
    layouts: Vec<BusLayout>,
    faults: Peekable<std::vec::IntoIter<Cue>>,
    period_s: f64,
    states: Vec<JointState>,
    truth: Vec<JointState>,
    now_s: f64,
}

impl RobotBuses {
    /// Opens the buses; no servo moves and none is powered yet.
    pub fn open(
        robot: &Robot,
        choices: &[BusChoice],
        speed: Speed,
        estop: &EStop,
    ) -> anyhow::Result<Self> {
        Self::open_with_faults(robot, choices, speed, estop, FaultPlan::default())
    }

    /// The same with faults at simulated servos.
    pub fn open_with_faults(
        robot: &Robot,
        choices: &[BusChoice],
        speed: Speed,
        estop: &EStop,
        faults: FaultPlan,
    ) -> anyhow::Result<Self> {
        let mut layouts = robot.buses.clone();
        let mut sims = Vec::new();
        let mut ports = Vec::with_capacity(layouts.len());
        for (place, (layout, choice)) in layouts.iter_mut().zip(choices).enumerate() {
            if speed == Speed::Max {
                layout.config.reply_timeout_ms = LOCKSTEP_TIMEOUT_MS;
            }
            ports.push(match choice {
                BusChoice::Sim => {
                    let sim = simulated(layout, robot.control_hz, speed, &faults)?;
                    let port = sim.port();
                    layout.config.reply_clock = sim.reply_clock();
                    sims.push((place, sim));
                    port
                }
                BusChoice::Port(port) => port.clone(),
            });
        }
        let bus = open_buses(&ports, &layouts, &robot.servos)?;
        let joints = robot.servos.len();
        Ok(Self {
            bus: SafeBus::new(bus, robot.safety)?.with_estop(estop.clone()),
            sims,
            layouts,
            faults: faults.faults.into_iter().peekable(),
            period_s: robot.period_s(),
            states: vec![JointState::default(); joints],
            truth: vec![JointState::default(); joints],
            now_s: 0.0,
        })
    }

    /// Checks every servo and turns torque on where the robot stands; robot time
    /// begins. Returns what the user should know.
    pub fn arm(&mut self) -> anyhow::Result<Vec<String>> {
        let armed = self.bus.arm(0.0)?;
        self.states.copy_from_slice(&armed.states);
        Ok(merge_notes(&armed.notes))
    }

    /// One control cycle: targets through the limits to the wire, states back.
    /// `now_s` counts from torque on.
    pub fn cycle(&mut self, now_s: f64, targets_rad: &[f64]) -> anyhow::Result<()> {
        self.inject_faults(now_s)?;
        self.bus.command(now_s, targets_rad);
        self.bus.tick(now_s, &mut self.states)?;
        for (place, sim) in &self.sims {
            sim.advance(self.period_s);
            for (servo, &joint) in self.layouts[*place].joints.iter().enumerate() {
                if let Some(servo) = sim.servo(servo) {
                    self.truth[joint] = JointState {
                        position_rad: servo.position_rad,
                        velocity_rad_s: servo.velocity_rad_s,
                        current_a: servo.current_a,
                    };
                }
            }
        }
        self.now_s = now_s;
        Ok(())
    }

    fn inject_faults(&mut self, now_s: f64) -> anyhow::Result<()> {
        while let Some(cue) = self.faults.next_if(|cue| cue.time_s <= now_s) {
            for (place, sim) in &mut self.sims {
                let joints = std::slice::from_ref(&self.layouts[*place].joints);
                happen(&cue.what, std::slice::from_mut(sim), joints)?;
            }
        }
        Ok(())
    }

    /// Simulated time goes on without any traffic on the bus.
    pub fn advance_silently(&self, seconds: f64) {
        for (_, sim) in &self.sims {
            sim.advance(seconds);
        }
    }

    /// The joints whose simulated servos still drive, other than those that
    /// their own watchdog holds still.
    pub fn unsafe_joints(&self) -> Vec<String> {
        let mut names = Vec::new();
        for (place, sim) in &self.sims {
            for (index, servo) in self.layouts[*place].servos.iter().enumerate() {
                let drives = sim.servo(index).is_some_and(|now| {
                    let held = now.watchdog_tripped && now.velocity_rad_s.abs() < STILL_RAD_S;
                    now.torque_enabled && !held
                });
                if drives {
                    names.push(servo.name.clone());
                }
            }
        }
        names
    }

    /// Robot time of the last cycle, seconds since torque on.
    pub fn now_s(&self) -> f64 {
        self.now_s
    }

    /// Turns torque off and verifies it.
    pub fn disarm(&mut self, cause: &str) -> anyhow::Result<()> {
        Ok(self.bus.disarm(self.now_s, cause)?)
    }

    /// What the servos reported last, one a joint.
    pub fn states(&self) -> &[JointState] {
        &self.states
    }

    fn all_simulated(&self) -> bool {
        self.sims.len() == self.layouts.len()
    }

    /// Where the simulated servos truly are; `None` on a real bus.
    pub fn truth(&self) -> Option<&[JointState]> {
        self.all_simulated().then_some(self.truth.as_slice())
    }

    /// The safety layer: last commands, state, health, counters, events.
    pub fn safety(&self) -> &SafeBus<Box<dyn Bus>> {
        &self.bus
    }

    /// Brakes and holds position, or follows targets again.
    pub fn hold(&mut self, hold: bool) {
        self.bus.hold(hold);
    }

    /// Whether what is sent is still being blended into the targets.
    pub fn is_ramping(&self) -> bool {
        self.bus.is_ramping(self.now_s)
    }

    /// What the safety layer did and why, in order, for the report.
    pub fn safety_log(&self) -> Vec<SafetyEvent> {
        let transitions = self.bus.transitions().iter();
        transitions
            .map(|event| SafetyEvent {
                time_s: event.time_s,
                from: format!("{:?}", event.from),
                to: format!("{:?}", event.to),
                cause: event.cause.clone(),
                routine: is_routine(event.from, event.to),
            })
            .collect()
    }

    /// Totals of the wire, for the report.
    pub fn bus_report(&self) -> BusReport {
        let stats = self.bus.stats();
        let robot_s = self.now_s + self.period_s;
        BusReport {
            cycles: stats.cycles,
            packets: stats.packets,
            bytes: stats.bytes,
            crc_errors: stats.crc_errors,
            timeouts: stats.timeouts,
            retries: stats.retries,
            rate_hz: stats.cycles as f64 / robot_s,
        }
    }

    /// Limits broken at the simulated servos; `None` on a real bus.
    pub fn violations(&self) -> Option<ViolationReport> {
        let mut counted = Violations::default();
        for (_, sim) in &self.sims {
            counted += sim.violations();
        }
        if !self.all_simulated() {
            return None;
        }
        Some(ViolationReport {
            position: counted.position,
            velocity: counted.velocity,
            acceleration: counted.acceleration,
        })
    }

    /// The first violations, one sentence each.
    pub fn violation_notes(&self) -> Vec<String> {
        let notes = self.sims.iter().map(|(_, sim)| sim.violation_notes());
        notes.flatten().collect()
    }

    /// How often the safety layer changed a command.
    pub fn interventions(&self) -> u64 {
        let counted = self.bus.interventions();
        counted.nan
            + counted.position
            + counted.velocity
            + counted.acceleration
            + counted.stale
            + counted.derated
    }

    /// Bytes and packets so far, as counted below the safety layer.
    pub fn wire_totals(&self) -> (u64, u64) {
        let stats = self.bus.bus().stats();
        (stats.bytes, stats.packets)
    }
}

/// Whether a dance in which all goes well has this change of state.
fn is_routine(from: State, to: State) -> bool {
    matches!(
        (from, to),
        (State::Disarmed, State::Arming)
            | (State::Arming, State::Running)
            | (State::Running, State::Stopping)
            | (State::Stopping, State::Disarmed)
    )
}

fn simulated(
    layout: &BusLayout,
    control_hz: f64,
    speed: Speed,
    faults: &FaultPlan,
) -> anyhow::Result<SimBus> {
    let specs: Vec<SimServoSpec> = layout.servos.iter().map(SimServoSpec::from).collect();
    let options = match speed {
        Speed::Max => SimOptions::lockstep(layout.config.baud, control_hz),
        Speed::Realtime => SimOptions::realtime(layout.config.baud, control_hz),
    };
    let options = SimOptions {
        // A socket: no terminal of the kernel in between that delays bytes.
        link: SimLink::Unix,
        seed: faults.seed,
        path: faults.path(),
        ..options
    };
    SimBus::start(&specs, options).context("cannot start the simulated bus")
}

/// Notes that say the same of many servos (`NAME (id N): TEXT`) become one.
fn merge_notes(notes: &[String]) -> Vec<String> {
    let text = |note: &'_ String| note.split_once("): ").map(|(_, text)| text.to_owned());
    let mut lines: Vec<String> = Vec::new();
    for note in notes {
        let alike = notes.iter().filter(|other| text(other) == text(note)).count();
        let line = match text(note) {
            Some(text) if alike > 1 => format!("{alike} servos: {text}"),
            _ => note.clone(),
        };
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_that_say_the_same_become_one() {
        let notes = [
            "neck (id 1): return delay time changed from 250 to 0",
            "knee (id 2): return delay time changed from 250 to 0",
            "knee (id 2): 61 degrees",
        ]
        .map(String::from);
        assert_eq!(
            merge_notes(&notes),
            ["2 servos: return delay time changed from 250 to 0", "knee (id 2): 61 degrees"]
        );
    }
}
