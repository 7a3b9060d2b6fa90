//! Position servos give way under load: torque over stiffness. The legs' commands go
//! ahead by what the estimated torque will take back, so that the robot leans as planned.

use super::leg_servo::LegServo;

/// Time constant of the torque that is reckoned with, seconds: the estimate is rough.
const SMOOTH_S: f64 = 0.04;
/// A joint's command is never moved further, radians.
const MOST_RAD: f64 = 0.12;

/// What the servos of the standing legs give way.
pub(super) struct ServoGive {
    joints: Vec<(usize, f64)>,
    torque_nm: Vec<f64>,
    share: f64,
}

impl ServoGive {
    /// For these joints, whose servos are in `servos` by joint; cycles of `dt_s`.
    pub fn new(joints: &[usize], servos: &[LegServo], dt_s: f64) -> Self {
        let stiff = |&joint: &usize| Some((joint, servos.get(joint)?.kp_nm_rad));
        let joints: Vec<_> =
            joints.iter().filter_map(stiff).filter(|(_, stiffness)| *stiffness > 0.0).collect();
        Self { torque_nm: vec![0.0; joints.len()], joints, share: dt_s / (SMOOTH_S + dt_s) }
    }

    /// Moves the commands of one cycle ahead. `torque_nm` by joint.
    pub fn compensate(&mut self, torque_nm: &[f64], commands_rad: &mut [f64]) {
        for ((joint, stiffness), smooth_nm) in self.joints.iter().zip(&mut self.torque_nm) {
            *smooth_nm += (torque_nm[*joint] - *smooth_nm) * self.share;
            commands_rad[*joint] += (*smooth_nm / stiffness).clamp(-MOST_RAD, MOST_RAD);
        }
    }
}
