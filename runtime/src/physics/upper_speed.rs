//! How fast the joints above the legs (arms, head, waist) are asked to move, and how fast they
//! would be if nothing but their limits held them back.

use servodance_retarget::{Gains, Stance};
use servodance_types::MotionFrame;

use crate::offline::motion_tracking::track_motion;
use crate::robot::Robot;

/// Mean squared speed that is asked of the joints above the legs, rad2/s2.
pub fn upper_speed2(robot: &Robot, frames: &[MotionFrame]) -> anyhow::Result<f64> {
    let retargeter = robot.retargeter()?;
    let upper = retargeter.upper_joints();
    let mut before = retargeter.rest().to_vec();
    let mut sum = 0.0;
    let tracked = track_motion(robot, frames, |_, now| {
        let speed2 = |&joint: &usize| ((now[joint] - before[joint]) / robot.period_s()).powi(2);
        sum += upper.iter().map(speed2).sum::<f64>();
        before.copy_from_slice(now);
        Ok(())
    })?;
    Ok(sum / (tracked.cycles * upper.len() as u64).max(1) as f64)
}

/// The same of the robot on a stand, with the whole of every movement.
pub fn upper_speed2_by_limits(robot: &Robot, frames: &[MotionFrame]) -> anyhow::Result<f64> {
    let mut free = robot.clone();
    free.retarget.stance = Stance::Hung;
    free.retarget.gain = Gains::default();
    free.retarget.amplitude = 1.0;
    upper_speed2(&free, frames)
}
