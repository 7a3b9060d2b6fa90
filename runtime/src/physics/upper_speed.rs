//! How fast the joints above the legs (arms, head, waist) are asked to move, and how fast they
//! would be if nothing but their limits held them back.

use servodance_retarget::{Gains, Stance};
use servodance_types::MotionFrame;

use crate::offline::motion_tracking::track_with;
use crate::robot::Robot;

/// Mean squared speed that is asked of the joints above the legs, rad2/s2.
pub fn upper_speed2(robot: &Robot, frames: &[MotionFrame]) -> anyhow::Result<f64> {
    let retargeter = robot.servo_retargeter()?;
    let upper = retargeter.upper_joints();
    // The first pose is taken up before the dance: the way to it is no speed of the dance.
    let mut before: Vec<f64> = Vec::new();
    let mut sum = 0.0;
    let tracked = track_with(retargeter, robot, frames, |_, now| {
        let speed2 = |&joint: &usize| ((now[joint] - before[joint]) / robot.period_s()).powi(2);
        if !before.is_empty() {
            sum += upper.iter().map(speed2).sum::<f64>();
        }
        before.clear();
        before.extend_from_slice(now);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::human;
    use servodance_types::FRAME_RATE_HZ;

    #[test]
    fn arms_that_are_raised_from_the_first_frame_on_do_not_move() {
        let mut frames = vec![human(2); 60];
        for (at, arms_up) in frames.iter_mut().enumerate() {
            arms_up.time_s = at as f64 / FRAME_RATE_HZ;
        }
        let robot = Robot::load("torso13").unwrap();
        let speed2 = upper_speed2_by_limits(&robot, &frames).unwrap();
        assert!(speed2 < 1e-3, "{speed2} rad2/s2");
    }
}
