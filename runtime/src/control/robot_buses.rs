//! The robot's buses as the control loop sees them: the safety layer, and below
//! it real servos, or simulated ones at the other end of a socket.
//!
//! The drivers are the same for both. Two things tell a simulated bus apart: its
//! port, and in simulated time the clock by which replies are waited for
//! (`reply_clock`).

use super::bus_choice::BusChoice;
use super::cycle_gaps::CycleGaps;
use crate::pipeline::step_times::StepTimes;
use crate::process::speed::Speed;
use crate::robot::{Lying, Robot};
use crate::telemetry::following_report::{FollowingReport, ServoErrorReport};
use crate::telemetry::pose_array::{pose_array, pose_of};
use crate::telemetry::report::{BusReport, SafetyEvent, ViolationReport};
use crate::world::{BodyReport, RobotWorld, WorldChoice};
use anyhow::{Context, bail};
use servodance_drivers::{
    Bus, BusLayout, EStop, ImuKind, Port, SafeBus, SerialImu, ServoErrors, State, Transition,
    open_buses,
};
use servodance_retarget::Retargeter;
use servodance_sim::{
    Cue, Happening, SimBus, SimImu, SimLink, SimOptions, SimServoSpec, Violations, happen,
};
use servodance_types::{ImuState, JointState, Placement};
use std::iter::Peekable;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

/// In lockstep the simulated servos themselves say when no reply will come
/// (`SimBus::reply_clock`): a busy machine must not look like a lost reply, or
/// runs would not be repeatable. This is for a program that has gone wrong.
const LOCKSTEP_TIMEOUT_MS: f64 = 60_000.0;
/// Slower than this a joint stands still, radians a second.
const STILL_RAD_S: f64 = 0.01;

/// What simulated servos meet: a world, and faults to inject.
#[derive(Clone, Debug, Default)]
pub struct SimulationPlan {
    /// The world that they carry the robot in.
    pub world: WorldChoice,
    /// How the robot lies at the start, unless it stands.
    pub lying: Option<Lying>,
    /// In the order of time, seconds since torque on.
    pub faults: Vec<Cue>,
    /// Which replies a fault of the wire hits.
    pub seed: u64,
}

impl SimulationPlan {
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
    world: Option<RobotWorld>,
    /// Where the root link was in the world when the servos were read last.
    root: Option<Placement>,
    /// What the motion sensor told then.
    imu: Option<ImuState>,
    imu_kind: Option<ImuKind>,
    /// A simulated sensor on a serial port of its own.
    sim_imu: Option<SimImu>,
    /// Robot time of the fall, and of its announcement by the sensor, seconds.
    fell_s: Option<f64>,
    announced_s: Option<f64>,
    faults: Peekable<std::vec::IntoIter<Cue>>,
    period_s: f64,
    states: Vec<JointState>,
    truth: Vec<JointState>,
    now_s: f64,
    /// In real time.
    gaps: Option<CycleGaps>,
    /// What the safety layer tells, until somebody listens.
    events: Option<Receiver<Transition>>,
}

impl RobotBuses {
    /// Opens the buses; no servo moves and none is powered yet. Simulated servos turn
    /// by themselves, without a world.
    pub fn open(
        robot: &Robot,
        choices: &[BusChoice],
        speed: Speed,
        estop: &EStop,
    ) -> anyhow::Result<Self> {
        Self::open_simulating(robot, choices, speed, estop, SimulationPlan::default())
    }

    /// The same, with what simulated servos meet. Real ones are in the real world.
    pub fn open_simulating(
        robot: &Robot,
        choices: &[BusChoice],
        speed: Speed,
        estop: &EStop,
        plan: SimulationPlan,
    ) -> anyhow::Result<Self> {
        let has_real = choices.iter().any(|choice| *choice != BusChoice::Sim);
        if has_real && plan.world != WorldChoice::None {
            bail!("--world needs the simulated bus: real servos are in the real world");
        }
        // A controller on ROS 2 knows its motors itself.
        let has_servos = choices.iter().any(
            |choice| matches!(choice, BusChoice::Port(port) if !matches!(port, Port::Ros2(_))),
        );
        if has_servos && robot.placeholder_servos {
            let name = &robot.name;
            bail!(
                "{name}: its servos are placeholders: fill in [bus] and each [[joint]], then remove \
                 placeholder_servos from its file"
            );
        }
        let world = RobotWorld::open_lying(robot, plan.world, plan.lying)?;
        let mut layouts = robot.buses.clone();
        let mut sims = Vec::new();
        let mut ports = Vec::with_capacity(layouts.len());
        for (place, (layout, choice)) in layouts.iter_mut().zip(choices).enumerate() {
            if speed == Speed::Max {
                layout.config.reply_timeout_ms = LOCKSTEP_TIMEOUT_MS;
            }
            ports.push(match choice {
                BusChoice::Sim => {
                    let sim = simulated(layout, robot.control_hz, speed, &plan, world.as_ref())?;
                    let port = sim.port();
                    layout.config.reply_clock = sim.reply_clock();
                    // Simulated servos end with the program.
                    layout.config.accept_no_watchdog = true;
                    sims.push((place, sim));
                    port
                }
                BusChoice::Port(port) => port.clone(),
            });
        }
        let has_sim = choices.contains(&BusChoice::Sim);
        let own_port = robot.imu.as_ref().filter(|imu| imu.port.is_some());
        let sim_imu = match own_port.filter(|_| has_sim) {
            Some(imu) => {
                Some(SimImu::start(imu, world.as_ref().map(|world| world.shared.clone()))?)
            }
            None => None,
        };
        let sensor = match own_port {
            Some(imu) => {
                let real = imu.port.as_deref().unwrap_or_default();
                let path = sim_imu.as_ref().map_or(real, SimImu::port_path);
                Some(SerialImu::open(imu, path, robot.control_hz).context("[imu]")?)
            }
            None => None,
        };
        let bus = open_buses(&ports, &layouts, &robot.servos)?;
        let joints = robot.servos.len();
        let (listener, events) = channel();
        let safe = SafeBus::new(bus, robot.safety)?.with_estop(estop.clone()).with_sensor(sensor);
        Ok(Self {
            bus: safe.with_listener(listener),
            gaps: (speed == Speed::Realtime).then(|| CycleGaps::new(robot.period_s())),
            events: Some(events),
            sims,
            layouts,
            root: world.as_ref().map(|world| world.shared.root()),
            world,
            imu: None,
            imu_kind: robot.imu.as_ref().map(|imu| imu.kind),
            sim_imu,
            fell_s: None,
            announced_s: None,
            faults: plan.faults.into_iter().peekable(),
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
        // Nobody has to know what a simulated servo's memory held.
        Ok(if self.all_simulated() { Vec::new() } else { merge_notes(&armed.notes) })
    }

    /// One control cycle: targets through the limits to the wire, states back.
    /// `now_s` counts from torque on.
    pub fn cycle(&mut self, now_s: f64, targets_rad: &[f64]) -> anyhow::Result<()> {
        self.inject_faults(now_s)?;
        if let Some(told) = self.gaps.as_mut().and_then(|gaps| gaps.cycle(Instant::now())) {
            self.bus.note(now_s, &told);
        }
        self.bus.command(now_s, targets_rad);
        if self.bus.tick(now_s, &mut self.states)? == State::Disarmed {
            bail!("{}", self.stopped_because());
        }
        self.root = self.world.as_ref().map(|world| world.shared.root());
        self.imu = self.read_imu();
        self.advance_silently(self.period_s);
        if let Some(imu) = &mut self.sim_imu {
            imu.advance(self.period_s);
        }
        self.see_truth();
        if self.fell_s.is_none() && self.world.as_ref().is_some_and(|world| world.shared.fell()) {
            self.fell_s = Some(now_s);
        }
        self.now_s = now_s;
        Ok(())
    }

    /// Why the safety layer turned torque off by itself.
    fn stopped_because(&self) -> String {
        let mut stops = self.bus.transitions().iter().rev().filter(|t| t.to == State::Stopping);
        stops.next().map_or_else(|| "torque is off".into(), |stop| stop.cause.clone())
    }

    /// A remark, told and kept like those of the safety layer.
    pub fn note(&mut self, text: &str) {
        self.bus.note(self.now_s, text);
    }

    fn read_imu(&self) -> Option<ImuState> {
        match self.imu_kind? {
            ImuKind::Simulated => self.world.as_ref().map(|world| world.shared.imu()),
            _ => self.bus.imu(),
        }
    }

    /// What the robot's motion sensor told when the servos were read last, in the axes of
    /// the root link. `None` without a sensor, and 100 ms after it fell silent.
    pub fn imu(&self) -> Option<ImuState> {
        self.imu
    }

    /// Whether the servos carry the robot's weight on its feet.
    pub fn carries_weight(&self) -> bool {
        let on_floor =
            self.world.as_ref().is_some_and(|world| world.choice() == WorldChoice::Floor);
        on_floor || !self.all_simulated()
    }

    /// Whether a motion sensor tells how that goes.
    pub fn senses_motion(&self) -> bool {
        match self.imu_kind {
            None => false,
            Some(ImuKind::Simulated) => self.world.is_some(),
            Some(_) => self.carries_weight(),
        }
    }

    fn see_truth(&mut self) {
        for (place, sim) in &self.sims {
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
    }

    fn inject_faults(&mut self, now_s: f64) -> anyhow::Result<()> {
        while let Some(cue) = self.faults.next_if(|cue| cue.time_s <= now_s) {
            if let (Happening::Imu(silent), Some(imu)) = (&cue.what, &mut self.sim_imu) {
                imu.silence(*silent);
            }
            for (place, sim) in &mut self.sims {
                let joints = std::slice::from_ref(&self.layouts[*place].joints);
                happen(&cue.what, std::slice::from_mut(sim), joints)?;
            }
        }
        Ok(())
    }

    /// Simulated time goes on without any traffic on the bus: on several buses that
    /// share a world by one step of it after the other.
    pub fn advance_silently(&self, seconds: f64) {
        let slices = match &self.world {
            Some(world) if self.sims.len() > 1 => world.steps_in(seconds),
            _ => 1,
        };
        for _ in 0..slices {
            for (_, sim) in &self.sims {
                sim.advance(seconds / slices as f64);
            }
        }
    }

    /// Whether the robot has fallen in its world.
    pub fn has_fallen(&self) -> bool {
        self.fell_s.is_some()
    }

    /// Remembers when the sensor announced a fall.
    pub fn announce_fall(&mut self) {
        self.announced_s = self.announced_s.or(Some(self.now_s));
    }

    /// When the robot fell, or when its sensor announced that it would, whichever came
    /// first; seconds since torque on.
    pub fn fall_s(&self) -> Option<f64> {
        self.announced_s.or(self.fell_s)
    }

    /// Where the root link was when the servos were read last (x, y, z, quaternion): as
    /// the floor's world has it, else as `retargeter` reckons from the joints.
    pub fn root_pose(&self, retargeter: &Retargeter) -> [f64; 7] {
        let stands = |world: &&RobotWorld| world.choice() == WorldChoice::Floor;
        match (self.world.as_ref().filter(stands), &self.root) {
            (Some(_), Some(root)) => pose_array(&pose_of(root)),
            _ => {
                let positions: Vec<f64> = self.states.iter().map(|s| s.position_rad).collect();
                pose_array(&retargeter.world_from_root(&positions))
            }
        }
    }

    /// What the body did in its world; `None` without one.
    pub fn body_report(&self) -> Option<BodyReport> {
        let world = self.world.as_ref()?;
        let moved = self.counted(SimBus::motion_violations);
        let mut report =
            BodyReport::new(world.choice(), &world.shared.figures(), self.fell_s, moved);
        report.fall_announced_s = self.announced_s;
        Some(report)
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
        self.bus.transitions().iter().map(safety_event).collect()
    }

    /// What the safety layer tells from the beginning on, as it happens; for one listener.
    pub fn listen(&mut self) -> impl Iterator<Item = SafetyEvent> + use<> {
        let events = self.events.take();
        std::iter::from_fn(move || events.as_ref()?.try_recv().ok())
            .map(|event| safety_event(&event))
    }

    /// Percentiles of the time from command to command; `None` in simulated time.
    pub fn cycle_gaps(&self) -> Option<StepTimes> {
        self.gaps.as_ref().map(CycleGaps::percentiles)
    }

    /// The same of the last second.
    pub fn recent_gaps(&self) -> StepTimes {
        self.gaps.as_ref().map(CycleGaps::recent).unwrap_or_default()
    }

    /// How well the servos followed what they were told.
    pub fn following(&self) -> FollowingReport {
        let servos = self.bus.bus().servos();
        FollowingReport::new(servos.iter().map(|servo| servo.name.as_str()), &self.bus.followed())
    }

    /// The servos with which something went wrong on the wire.
    pub fn servo_errors(&self) -> Vec<ServoErrorReport> {
        let bus = self.bus.bus();
        let counted = bus.servos().iter().zip(bus.error_counters().read());
        let wrong = counted.filter(|(_, errors)| *errors != ServoErrors::default());
        wrong.map(|(servo, errors)| ServoErrorReport::new(&servo.name, errors)).collect()
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
            delay_ms: stats.delay_us as f64 * 1e-3,
        }
    }

    /// Limits broken at the simulated servos; `None` on a real bus. In a world by what
    /// they were told alone: weight moves joints beyond a goal that is at its limit.
    pub fn violations(&self) -> Option<ViolationReport> {
        if !self.all_simulated() {
            return None;
        }
        let all = self.counted(SimBus::violations);
        let moved = match &self.world {
            Some(_) => self.counted(SimBus::motion_violations),
            None => ViolationReport::default(),
        };
        Some(ViolationReport {
            position: all.position - moved.position,
            velocity: all.velocity - moved.velocity,
            acceleration: all.acceleration - moved.acceleration,
        })
    }

    fn counted(&self, count: impl Fn(&SimBus) -> Violations) -> ViolationReport {
        let mut sum = Violations::default();
        for (_, sim) in &self.sims {
            sum += count(sim);
        }
        let Violations { position, velocity, acceleration } = sum;
        ViolationReport { position, velocity, acceleration }
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

fn safety_event(event: &Transition) -> SafetyEvent {
    SafetyEvent {
        time_s: event.time_s,
        from: format!("{:?}", event.from),
        to: format!("{:?}", event.to),
        cause: event.cause.clone(),
        routine: is_routine(event.from, event.to),
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
    plan: &SimulationPlan,
    world: Option<&RobotWorld>,
) -> anyhow::Result<SimBus> {
    let mut specs: Vec<SimServoSpec> = layout.servos.iter().map(SimServoSpec::from).collect();
    if let Some(world) = world {
        specs = world.placed(specs, layout);
    }
    let options = match speed {
        Speed::Max => SimOptions::lockstep(layout.config.baud, control_hz),
        Speed::Realtime => SimOptions::realtime(layout.config.baud, control_hz),
    };
    let options = SimOptions {
        // A socket: no terminal of the kernel in between that delays bytes.
        link: SimLink::Unix,
        seed: plan.seed,
        path: plan.path(),
        seat: world.map(|world| world.seat(layout)),
        imu: layout.config.imu.clone(),
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
