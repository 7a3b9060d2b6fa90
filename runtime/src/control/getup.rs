//! From the floor to its feet, by the poses that the robot's file has: from rest through
//! each of them and back to rest, along minimum-jerk paths inside the limits.

use super::bus_choice::BusChoice;
use super::cycle_clock::CycleClock;
use super::emergency_stop::EmergencyStopWatch;
use super::minimum_jerk::MinimumJerk;
use super::robot_buses::{RobotBuses, SimulationPlan};
use crate::process::interrupted::Interrupted;
use crate::process::speed::Speed;
use crate::robot::{GetupPlan, Lying, Robot};
use crate::world::WorldChoice;
use anyhow::{Context, anyhow, bail};
use servodance_drivers::EStop;
use std::sync::atomic::{AtomicBool, Ordering};

/// A robot whose sensor's vertical is within this cosine of an axis stands or lies on it.
const ALONG: f64 = 0.7;
/// How long the sensor is waited for, and how long the robot has to stand to be up, seconds.
const SENSED_S: f64 = 1.5;
const STANDS_S: f64 = 1.0;
/// Share of the joints' velocity and acceleration limits that is used.
const EFFORT: f64 = 0.8;
/// Cosine of the lean of a robot that stands.
const UPRIGHT: f64 = 0.94;

/// A robot that is to get up.
pub struct GetUp<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Where its servos are.
    pub buses: &'a [BusChoice],
    /// How it lies: where a simulated one is put, and what a robot without a motion sensor is
    /// taken to do.
    pub lying: Option<Lying>,
    /// How long it stands afterwards before torque goes off, seconds.
    pub stands_s: f64,
}

impl GetUp<'_> {
    /// Gets up; returns what came of it, in a line. Torque is off in the end. Fails where
    /// there is no way, or the robot does not stand after it.
    pub fn run(&self, speed: Speed, stop: &AtomicBool) -> anyhow::Result<String> {
        if self.robot.getup.is_none() {
            let (name, side) = (&self.robot.name, self.lying.map(Lying::name));
            let side = side.map(|side| format!(" from its {side}")).unwrap_or_default();
            bail!("{name} has no way up{side} ([getup] in its file): put it on its feet");
        }
        let is_simulated = self.buses.iter().all(|choice| *choice == BusChoice::Sim);
        let world = if is_simulated { WorldChoice::Floor } else { WorldChoice::None };
        let lying = is_simulated.then_some(self.lying).flatten();
        let plan = SimulationPlan { world, lying, ..SimulationPlan::default() };
        let estop = EStop::default();
        let _watch = EmergencyStopWatch::start(&estop, None, true)?;
        let mut servos = RobotBuses::open_simulating(self.robot, self.buses, speed, &estop, plan)?;
        servos.arm()?;
        let mut motion = Motion {
            clock: CycleClock::new(speed, self.robot.period_s()),
            targets_rad: servos.states().iter().map(|state| state.position_rad).collect(),
            servos,
            robot: self.robot,
            stop,
        };
        let told = self.get_up(&mut motion);
        let cause = if told.is_ok() { "it stood" } else { "getting up failed" };
        let disarmed = motion.servos.disarm(cause);
        disarmed.context("torque off could not be verified: cut the power")?;
        told
    }

    fn get_up(&self, motion: &mut Motion) -> anyhow::Result<String> {
        let name = &self.robot.name;
        motion.hold(SENSED_S)?;
        let up = motion.servos.imu().map(|imu| imu.up);
        let lying = match up {
            Some([_, _, z]) if z > ALONG => return Ok(format!("{name} stands already")),
            Some([x, _, _]) if x < -ALONG => Lying::Front,
            Some([x, _, _]) if x > ALONG => Lying::Back,
            Some(_) => bail!("{name} lies on neither front nor back: turn it over"),
            None => self.lying.ok_or_else(|| {
                anyhow!("{name}: no motion sensor says how it lies: say --lying front or back")
            })?,
        };
        let rest = self.robot.retargeter()?.rest().to_vec();
        let Robot { getup, servos, .. } = self.robot;
        let poses = GetupPlan::poses(getup.as_ref(), name, servos, lying, &rest)?;
        motion.go(0.0, &rest)?;
        for (seconds, pose) in poses {
            motion.go(seconds, &pose)?;
        }
        motion.hold(STANDS_S)?;
        if motion.servos.imu().is_some_and(|imu| imu.up[2] < UPRIGHT) {
            bail!("{name} did not get up from its {}", lying.name());
        }
        let took_s = motion.clock.cycle_s() - SENSED_S - STANDS_S;
        motion.hold(self.stands_s)?;
        Ok(format!("{name} got up from its {} in {took_s:.1} s", lying.name()))
    }
}

struct Motion<'a> {
    servos: RobotBuses,
    clock: CycleClock,
    targets_rad: Vec<f64>,
    robot: &'a Robot,
    stop: &'a AtomicBool,
}

impl Motion<'_> {
    fn cycle(&mut self) -> anyhow::Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(Interrupted.into());
        }
        self.clock.wait();
        self.servos.cycle(self.clock.cycle_s(), &self.targets_rad)?;
        self.clock.advance();
        Ok(())
    }

    fn hold(&mut self, seconds: f64) -> anyhow::Result<()> {
        (0..(seconds * self.robot.control_hz) as u64).try_for_each(|_| self.cycle())
    }

    /// To a pose, in no less than so many seconds.
    fn go(&mut self, seconds: f64, pose_rad: &[f64]) -> anyhow::Result<()> {
        let limits = self.robot.servos.iter().map(|servo| &servo.limits);
        let hz = self.robot.control_hz;
        let path = MinimumJerk::with_effort(EFFORT, &self.targets_rad, pose_rad, limits, hz);
        let path = path.lasting(seconds, hz);
        for cycle in 1..=path.cycles() {
            path.at(cycle, &mut self.targets_rad);
            self.cycle()?;
        }
        Ok(())
    }
}
