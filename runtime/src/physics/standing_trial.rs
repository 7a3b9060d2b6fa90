//! A known motion is danced in the simulated world: does the robot stay on its feet?

use std::collections::VecDeque;
use std::ops::ControlFlow;

use servodance_sim::world::{Push, World, WorldOptions};
use servodance_types::{FRAME_RATE_HZ, JointState, MotionFrame, Placement, RigidLink};

use super::servo_loop::{ServoLoop, ServoVariation};
use crate::robot::Robot;
use servodance_retarget::{BalanceFeedback, LegServo, Retargeter};

/// Seconds in which the robot settles on its feet before the motion begins.
const SETTLE_S: f64 = 1.0;

/// The world, the servos and the way of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrialOptions {
    /// What is around the robot.
    pub world: WorldOptions,
    /// How the servos differ from nominal.
    pub servos: ServoVariation,
    /// Whether the servos are as strong as the robot's masses ask for, whatever the
    /// robot file says: for files whose servos are placeholders.
    pub sized: bool,
    /// Factor on all masses.
    pub mass: f64,
    /// Whether the sensor's readings correct the commands.
    pub feedback: bool,
    /// A push in the middle, newton seconds towards x and y; it lasts 50 ms.
    pub push_ns: [f64; 2],
}

impl Default for TrialOptions {
    fn default() -> Self {
        Self {
            world: WorldOptions::default(),
            servos: ServoVariation::default(),
            sized: false,
            mass: 1.0,
            feedback: true,
            push_ns: [0.0; 2],
        }
    }
}

/// What became of the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct TrialReport {
    /// Seconds that were danced: until the fall, or all.
    pub danced_s: f64,
    /// When the robot fell, seconds into the motion.
    pub fell_s: Option<f64>,
    /// When the sensor announced a fall that is coming, and when the body struck the
    /// floor, at most a second after the fall.
    pub announced_s: Option<f64>,
    /// See `announced_s`.
    pub struck_s: Option<f64>,
    /// Root mean square lean of the pelvis, degrees, and against what was commanded.
    pub tilt_rms_deg: f64,
    /// The lean that was not commanded one servo lag before.
    pub tilt_beyond_plan_rms_deg: f64,
    /// The most of that.
    pub tilt_beyond_plan_max_deg: f64,
    /// How far loaded soles slid, millimetres a minute.
    pub slip_mm_min: f64,
    /// Mean squared speed of the joints of arms and head that was commanded, rad2/s2.
    pub upper_speed2: f64,
    /// Mechanical work of the servos, joules a second.
    pub work_w: f64,
    /// Steps that were made, and those that balance refused.
    pub steps: u64,
    /// See `steps`.
    pub refused_steps: u64,
    /// For how long the feet seemed to carry nothing, seconds.
    pub lifted_s: f64,
}

/// One robot, ready to be tried.
pub struct StandingTrial {
    links: Vec<RigidLink>,
    servos: Vec<ServoLoop>,
    retargeter: Retargeter,
    period_s: f64,
    options: TrialOptions,
    upper: Vec<usize>,
    feedback: Option<BalanceFeedback>,
    lag_cycles: usize,
}

impl StandingTrial {
    /// Fails where the robot's description cannot be simulated.
    pub fn new(robot: &Robot, options: TrialOptions) -> anyhow::Result<Self> {
        let retargeter = robot.servo_retargeter()?;
        let mut links = retargeter.rigid_links();
        for link in &mut links {
            link.mass_kg *= options.mass;
            link.inertia_kg_m2.iter_mut().flatten().for_each(|entry| *entry *= options.mass);
        }
        let servos = ServoLoop::of_robot(robot, &retargeter, &options.servos, options.sized);
        // Balance knows the nominal servos.
        let nominal =
            |servo: &ServoLoop| ServoLoop { kp: servo.kp / options.servos.stiffness, ..*servo };
        let legs: Vec<LegServo> = servos.iter().map(|servo| nominal(servo).leg_servo()).collect();
        let limits: Vec<_> = robot.servos.iter().map(|servo| servo.limits).collect();
        Ok(Self {
            links,
            servos,
            feedback: BalanceFeedback::new(&retargeter, &legs, &limits),
            lag_cycles: (robot.servo_lag_s / robot.period_s()).round() as usize,
            upper: retargeter.upper_joints(),
            retargeter,
            period_s: robot.period_s(),
            options,
        })
    }

    /// The cycle, from the first one, in which a push comes.
    pub fn push_cycle(frames: usize, period_s: f64) -> usize {
        ((SETTLE_S + frames as f64 / FRAME_RATE_HZ / 2.0) / period_s).round() as usize
    }

    /// The robot's links as they are simulated.
    pub fn links(&self) -> &[RigidLink] {
        &self.links
    }

    /// The servos as they are simulated.
    pub fn servos(&self) -> &[ServoLoop] {
        &self.servos
    }

    /// Dances `frames`; `each` gets time, commands and world of every cycle.
    pub fn run(
        mut self,
        frames: &[MotionFrame],
        mut each: impl FnMut(f64, &[f64], &World),
    ) -> anyhow::Result<TrialReport> {
        let mut targets = self.retargeter.rest().to_vec();
        let mut world = self.world(&targets)?;
        let mut seen = Seen::new(&self, &targets);
        let mut waiting = frames.iter().peekable();
        let settle = (SETTLE_S / self.period_s).round() as i64;
        let cycles = (frames.len() as f64 / FRAME_RATE_HZ / self.period_s) as i64;
        let pushed = Self::push_cycle(frames.len(), self.period_s) as i64 - settle;
        for cycle in -settle..cycles {
            let time_s = cycle as f64 * self.period_s;
            let needed_s = time_s + self.retargeter.lookahead_s();
            while let Some(frame) = waiting.next_if(|frame| frame.time_s <= needed_s) {
                self.retargeter.push(frame);
            }
            if cycle >= 0 {
                self.retargeter.next(time_s, &mut targets)?;
            }
            if cycle == pushed {
                self.push(&mut world);
            }
            let commands = self.commands(&world, &targets, cycle > -settle);
            seen.lifted(&self);
            self.simulate(&mut world, &commands, |world| {
                if cycle >= 0 {
                    seen.sums.slip(world);
                }
            });
            each(time_s, &commands, &world);
            if cycle >= 0 && seen.cycle(&self, &world, &targets, time_s).is_break() {
                break;
            }
        }
        Ok(seen.into_report(&self, &world))
    }

    /// The robot in its world, in this pose.
    fn world(&self, positions_rad: &[f64]) -> anyhow::Result<World> {
        let mechanics: Vec<_> = self.servos.iter().map(|servo| servo.mechanics).collect();
        let dt_s = self.period_s / f64::from(self.steps());
        let options = WorldOptions { dt_s, ..self.options.world };
        let mut world = World::new(&self.links, &mechanics, options)?;
        world.place(Some(&self.retargeter.root_placement(positions_rad)), positions_rad);
        Ok(world)
    }

    /// Of the world in a control cycle.
    fn steps(&self) -> u32 {
        (self.period_s / self.options.world.dt_s).ceil() as u32
    }

    fn push(&self, world: &mut World) {
        if self.options.push_ns == [0.0; 2] {
            return;
        }
        let force_n = self.options.push_ns.map(|impulse| impulse / 0.05);
        world.push(Push { force_n: [force_n[0], force_n[1], 0.0], until_s: world.time_s() + 0.05 });
    }

    /// What the servos are told for these targets; `feels` the world once it has moved.
    fn commands(&mut self, world: &World, targets: &[f64], feels: bool) -> Vec<f64> {
        let mut commands = targets.to_vec();
        let Some(feedback) = &mut self.feedback else { return commands };
        if feels {
            let joint = |index| {
                let (position_rad, velocity_rad_s) = world.joint(index);
                JointState { position_rad, velocity_rad_s, current_a: 0.0 }
            };
            let states: Vec<JointState> = (0..targets.len()).map(joint).collect();
            feedback.feel(&self.retargeter, &states);
        }
        let reading = world.imu().filter(|_| self.options.feedback);
        feedback.correct(&self.retargeter, reading.as_ref(), &mut commands);
        self.retargeter.set_steady(feedback.is_steady());
        commands
    }

    /// One control cycle of the world; `each` sees every step.
    fn simulate(&self, world: &mut World, commands: &[f64], mut each: impl FnMut(&World)) {
        let mut drives = Vec::with_capacity(commands.len());
        for _ in 0..self.steps() {
            let servos = self.servos.iter().zip(commands).enumerate();
            drives.clear();
            drives.extend(
                servos.map(|(joint, (servo, wish))| servo.drive(*wish, world.joint(joint).0)),
            );
            world.step(&drives);
            each(world);
        }
    }
}

/// What was seen of a trial so far.
struct Seen {
    report: TrialReport,
    sums: Sums,
    /// Targets of the cycle before.
    before: Vec<f64>,
    /// Where the root was planned to be, over one servo lag.
    plans: VecDeque<Placement>,
}

impl Seen {
    fn new(trial: &StandingTrial, targets: &[f64]) -> Self {
        let root = trial.retargeter.root_placement(targets);
        Self {
            report: TrialReport::default(),
            sums: Sums::default(),
            before: targets.to_vec(),
            plans: VecDeque::from(vec![root; trial.lag_cycles + 1]),
        }
    }

    fn lifted(&mut self, trial: &StandingTrial) {
        if trial.feedback.as_ref().is_some_and(BalanceFeedback::is_lifted) {
            self.report.lifted_s += trial.period_s;
        }
    }

    /// After a cycle of the dance; breaks off when a robot that fell lies.
    fn cycle(
        &mut self,
        trial: &StandingTrial,
        world: &World,
        targets: &[f64],
        time_s: f64,
    ) -> ControlFlow<()> {
        let announces = trial.feedback.as_ref().is_some_and(BalanceFeedback::is_falling);
        if announces && self.report.announced_s.is_none() {
            self.report.announced_s = Some(time_s);
        }
        if let Some(fell_s) = self.report.fell_s {
            if world.lies() || time_s > fell_s + 1.0 {
                self.report.struck_s = Some(time_s);
                return ControlFlow::Break(());
            }
            return ControlFlow::Continue(());
        }
        self.plans.push_back(trial.retargeter.root_placement(targets));
        self.plans.pop_front();
        self.sums.cycle(world, &self.plans[0]);
        self.sums.upper(&trial.upper, targets, &self.before, trial.period_s);
        self.before.copy_from_slice(targets);
        if world.has_fallen() {
            self.report.fell_s = Some(time_s);
        }
        ControlFlow::Continue(())
    }

    fn into_report(self, trial: &StandingTrial, world: &World) -> TrialReport {
        let counts = trial.retargeter.counts();
        let report =
            TrialReport { steps: counts.steps, refused_steps: counts.refused_steps, ..self.report };
        self.sums.into_report(report, world, trial.period_s)
    }
}

#[derive(Default)]
struct Sums {
    cycles: u64,
    tilt2: f64,
    beyond2: f64,
    beyond_max: f64,
    slip_m: f64,
    upper2: f64,
}

impl Sums {
    fn slip(&mut self, world: &World) {
        self.slip_m += world.slip_m_s() * world.dt_s();
    }

    fn cycle(&mut self, world: &World, plan: &Placement) {
        let up = |at: &Placement| at.rotation[2];
        let (now, wanted) = (up(&world.root()), up(plan));
        let dot: f64 = now.iter().zip(&wanted).map(|(a, b)| a * b).sum();
        let beyond = dot.clamp(-1.0, 1.0).acos();
        self.cycles += 1;
        self.tilt2 += now[2].clamp(-1.0, 1.0).acos().powi(2);
        self.beyond2 += beyond * beyond;
        self.beyond_max = self.beyond_max.max(beyond);
    }

    fn upper(&mut self, joints: &[usize], now: &[f64], before: &[f64], period_s: f64) {
        let speeds = joints.iter().map(|&joint| ((now[joint] - before[joint]) / period_s).powi(2));
        self.upper2 += speeds.sum::<f64>() / joints.len().max(1) as f64;
    }

    fn into_report(self, report: TrialReport, world: &World, period_s: f64) -> TrialReport {
        let cycles = self.cycles.max(1) as f64;
        let danced_s = cycles * period_s;
        let rms_deg = |sum: f64| (sum / cycles).sqrt().to_degrees();
        TrialReport {
            danced_s,
            tilt_rms_deg: rms_deg(self.tilt2),
            tilt_beyond_plan_rms_deg: rms_deg(self.beyond2),
            tilt_beyond_plan_max_deg: self.beyond_max.to_degrees(),
            slip_mm_min: self.slip_m * 1e3 * 60.0 / danced_s,
            upper_speed2: self.upper2 / cycles,
            work_w: world.work_j() / danced_s,
            ..report
        }
    }
}
