//! How fast arms and head are asked to move, and how fast they would be if nothing but their
//! limits held them back.

use servodance_retarget::{Gains, Stance};
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

use crate::robot::Robot;

/// Mean squared speed that is asked of the joints of arms and head, rad2/s2.
pub fn upper_speed2(robot: &Robot, frames: &[MotionFrame]) -> anyhow::Result<f64> {
    let mut retargeter = robot.retargeter()?;
    let upper = retargeter.upper_joints();
    let mut now = retargeter.rest().to_vec();
    let mut before = now.clone();
    let mut waiting = frames.iter().peekable();
    let cycles = (frames.len() as f64 / FRAME_RATE_HZ / robot.period_s()) as u64;
    let mut sum = 0.0;
    for cycle in 0..cycles {
        let time_s = cycle as f64 * robot.period_s();
        let needed_s = time_s + retargeter.lookahead_s();
        while let Some(frame) = waiting.next_if(|frame| frame.time_s <= needed_s) {
            retargeter.push(frame);
        }
        before.copy_from_slice(&now);
        retargeter.next(time_s, &mut now)?;
        let speed2 = |&joint: &usize| ((now[joint] - before[joint]) / robot.period_s()).powi(2);
        sum += upper.iter().map(speed2).sum::<f64>();
    }
    Ok(sum / (cycles * upper.len() as u64).max(1) as f64)
}

/// The same of the robot on a stand, with the whole of every movement.
pub fn upper_speed2_by_limits(robot: &Robot, frames: &[MotionFrame]) -> anyhow::Result<f64> {
    let mut free = robot.clone();
    free.retarget.stance = Stance::Hung;
    free.retarget.gain = Gains::default();
    free.retarget.amplitude = 1.0;
    upper_speed2(&free, frames)
}
