//! How much of a dance a robot can stand: found by dancing it in several worlds.

use servodance_sim::world::WorldOptions;
use servodance_types::MotionFrame;

use super::servo_loop::ServoVariation;
use super::standing_trial::{StandingTrial, TrialOptions, TrialReport};
use crate::robot::Robot;

/// Shares of the pelvis's movement that are tried, largest first; after the last one
/// arms and head give way too.
const PELVIS_SHARES: [f64; 7] = [1.0, 0.8, 0.6, 0.45, 0.3, 0.15, 0.0];
const ARM_SHARES: [f64; 2] = [0.7, 0.4];
/// A robot that leans further than this beyond its plan is about to fall, degrees.
const MOST_LEAN_DEG: f64 = 15.0;

/// What a robot can stand, and how it went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandingAmplitude {
    /// Share of the movement of pelvis and legs.
    pub pelvis: f64,
    /// Share of the movement of arms and head.
    pub arms: f64,
    /// The worst of the worlds.
    pub worst: TrialReport,
}

/// The robot with its gains scaled.
pub fn scaled(robot: &Robot, pelvis: f64, arms: f64) -> Robot {
    let mut scaled = robot.clone();
    let gain = &mut scaled.retarget.gain;
    for part in [&mut gain.torso, &mut gain.left_leg, &mut gain.right_leg] {
        *part *= pelvis;
    }
    for part in [&mut gain.left_arm, &mut gain.right_arm, &mut gain.head] {
        *part *= arms;
    }
    scaled
}

/// The largest share of `frames` that the robot dances in every world without a fall;
/// `None` if it falls whatever it leaves out.
pub fn find_amplitude(
    robot: &Robot,
    frames: &[MotionFrame],
    sized: bool,
) -> anyhow::Result<Option<StandingAmplitude>> {
    let tried: Vec<(f64, f64)> = PELVIS_SHARES
        .map(|pelvis| (pelvis, 1.0))
        .into_iter()
        .chain(ARM_SHARES.map(|arms| (0.0, arms)))
        .collect();
    // Bisection: what stands with more stands with less.
    let (mut low, mut high, mut found) = (0, tried.len(), None);
    let mut next = 0;
    while low < high {
        let (pelvis, arms) = tried[next];
        match stands_everywhere(&scaled(robot, pelvis, arms), frames, sized)? {
            Some(worst) => {
                found = Some(StandingAmplitude { pelvis, arms, worst });
                high = next;
            }
            None => low = next + 1,
        }
        next = usize::midpoint(low, high);
    }
    Ok(found)
}

/// The worst report of all worlds; `None` if the robot falls in one.
fn stands_everywhere(
    robot: &Robot,
    frames: &[MotionFrame],
    sized: bool,
) -> anyhow::Result<Option<TrialReport>> {
    let dance = |options| StandingTrial::new(robot, options)?.run(frames, |_, _, _| ());
    let reports: Vec<anyhow::Result<TrialReport>> = std::thread::scope(|scope| {
        let trials = worlds(sized).map(|options| scope.spawn(move || dance(options)));
        let failed = |_| Err(anyhow::anyhow!("a trial in the simulated world panicked"));
        trials.into_iter().map(|trial| trial.join().unwrap_or_else(failed)).collect()
    });
    let mut worst = TrialReport::default();
    for report in reports {
        let report = report?;
        if report.fell_s.is_some() || report.tilt_beyond_plan_max_deg > MOST_LEAN_DEG {
            return Ok(None);
        }
        if report.tilt_beyond_plan_max_deg >= worst.tilt_beyond_plan_max_deg {
            worst = report;
        }
    }
    Ok(Some(worst))
}

/// Worlds that a robot must stand in, without the help of a sensor: softer and stiffer
/// servos, a slippery floor, a heavier robot, a floor that leans.
fn worlds(sized: bool) -> [TrialOptions; 5] {
    let plain = TrialOptions { sized, feedback: false, ..TrialOptions::default() };
    let servos = |stiffness: f64| TrialOptions {
        servos: ServoVariation { stiffness, ..plain.servos },
        ..plain
    };
    let world = |friction: f64, tilt_rad: [f64; 2]| TrialOptions {
        world: WorldOptions { friction, tilt_rad, ..plain.world },
        ..plain
    };
    let lean = 1.0_f64.to_radians();
    [
        servos(0.8),
        servos(1.3),
        world(0.4, [0.0; 2]),
        TrialOptions { mass: 1.1, ..world(0.8, [lean, -lean]) },
        world(0.8, [-lean, lean]),
    ]
}
