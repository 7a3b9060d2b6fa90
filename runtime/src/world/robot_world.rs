//! A robot's body in a world, made from its description and its servos.

use super::choice::WorldChoice;
use crate::physics::ServoLoop;
use crate::robot::{Lying, Robot};
use anyhow::{Context, bail};
use servodance_drivers::BusLayout;
use servodance_sim::SimServoSpec;
use servodance_sim::world::{RootSupport, SharedWorld, WorldOptions, WorldSeat};

/// How high a stand holds the root link, metres: no limb reaches the floor.
const STAND_M: f64 = 5.0;

/// How high the root link of a robot that is to lie begins, as a share of where it is when
/// the robot stands.
const DROPPED_SHARE: f64 = 0.45;

/// A robot that is put into a world: on its feet in its rest pose, or on a stand.
#[derive(Clone, Debug)]
pub struct RobotWorld {
    /// The world, moved by the servos.
    pub shared: SharedWorld,
    choice: WorldChoice,
    positions_rad: Vec<f64>,
    strengths: Vec<f64>,
}

impl RobotWorld {
    /// The chosen world with this robot in it; `None` for no world. Fails where the
    /// description cannot be simulated, or a robot without feet is put on a floor.
    pub fn open(robot: &Robot, choice: WorldChoice) -> anyhow::Result<Option<Self>> {
        Self::open_lying(robot, choice, None)
    }

    /// The same; a robot that is to lie is dropped on its front or back from a little above
    /// the floor.
    pub fn open_lying(
        robot: &Robot,
        choice: WorldChoice,
        lying: Option<Lying>,
    ) -> anyhow::Result<Option<Self>> {
        let support = match choice {
            WorldChoice::None => return Ok(None),
            WorldChoice::Floor => RootSupport::Free,
            WorldChoice::Stand => RootSupport::Held,
        };
        let name = &robot.name;
        if choice == WorldChoice::Floor && !robot.retarget.stance.stands() {
            bail!("{name} does not stand on its feet (`stance`): say --world stand, or none");
        }
        let retargeter = robot.retargeter()?;
        let loops = ServoLoop::of_robot(robot, &retargeter, &Default::default(), false);
        let strengths: Vec<f64> = match robot.placeholder_servos {
            true => loops.iter().zip(&robot.servos).map(|(l, servo)| l.strength(servo)).collect(),
            false => vec![1.0; loops.len()],
        };
        let specs = robot.servos.iter().map(SimServoSpec::from).zip(&strengths);
        let mechanics: Result<Vec<_>, _> =
            specs.map(|(spec, &strength)| SimServoSpec { strength, ..spec }.mechanics()).collect();
        let positions_rad = retargeter.rest().to_vec();
        let mut root = retargeter.root_placement(&positions_rad);
        if choice == WorldChoice::Stand {
            root.at_m[2] += STAND_M;
        }
        if let Some(lying) = lying {
            let [x, y, z] = root.rotation;
            root.rotation = match lying {
                Lying::Front => [z, y, x.map(|part| -part)],
                Lying::Back => [z.map(|part| -part), y, x],
            };
            root.at_m[2] *= DROPPED_SHARE;
        }
        let options = WorldOptions { support, ..WorldOptions::default() };
        let placed = (Some(&root), positions_rad.as_slice());
        let shared = SharedWorld::new(
            &retargeter.rigid_links(),
            &mechanics?,
            options,
            robot.control_hz,
            placed,
        );
        let shared = shared.with_context(|| {
            format!("{name} cannot be put into a world (--world none goes without)")
        })?;
        Ok(Some(Self { shared, choice, positions_rad, strengths }))
    }

    /// Which world it is.
    pub fn choice(&self) -> WorldChoice {
        self.choice
    }

    /// The place of the servos of one bus.
    pub fn seat(&self, bus: &BusLayout) -> WorldSeat {
        WorldSeat::new(self.shared.clone(), bus.joints.clone())
    }

    /// The same servos where the robot was put, as strong as it needs them.
    pub fn placed(&self, specs: Vec<SimServoSpec>, bus: &BusLayout) -> Vec<SimServoSpec> {
        let specs = specs.into_iter().zip(&bus.joints);
        let placed = specs.map(|(spec, &joint)| SimServoSpec {
            initial_rad: self.positions_rad[joint],
            strength: self.strengths[joint],
            ..spec
        });
        placed.collect()
    }

    /// World steps in a control period of so many seconds.
    pub fn steps_in(&self, seconds: f64) -> u64 {
        (seconds / self.shared.step_s()).round().max(1.0) as u64
    }
}

impl WorldChoice {
    /// Where a simulated robot is unless somebody says so: on a floor if it stands on its
    /// feet and its description has what physics needs, else nowhere.
    pub fn of_robot(robot: &Robot) -> Self {
        let stands = robot.retarget.stance.stands();
        match stands && RobotWorld::open(robot, Self::Floor).is_ok() {
            true => Self::Floor,
            false => Self::None,
        }
    }
}
