//! The largest push that a standing robot survives, found by dancing nothing.

use servodance_types::MotionFrame;

use super::standing_trial::{StandingTrial, TrialOptions};
use crate::robot::Robot;

/// Pushes are sought up to this impulse for each kilogram, and to this precision.
const MOST_NS_PER_KG: f64 = 2.0;
const STEP_NS_PER_KG: f64 = 0.02;

/// The largest impulse towards the horizontal direction `towards`, newton seconds on the
/// root link for 50 ms, that the robot survives while it dances `frames`; by bisection.
pub fn survived_push_ns(
    robot: &Robot,
    frames: &[MotionFrame],
    options: TrialOptions,
    towards: [f64; 2],
) -> anyhow::Result<f64> {
    let links = robot.retargeter()?.rigid_links();
    let mass_kg = links.iter().map(|link| link.mass_kg).sum::<f64>().max(1e-3);
    let (mut low, mut high) = (0.0, MOST_NS_PER_KG * mass_kg);
    while high - low > STEP_NS_PER_KG * mass_kg {
        let middle = f64::midpoint(low, high);
        let options = TrialOptions { push_ns: towards.map(|share| share * middle), ..options };
        match StandingTrial::new(robot, options)?.run(frames, |_, _, _| ())?.fell_s {
            Some(_) => high = middle,
            None => low = middle,
        }
    }
    Ok(low)
}
