//! Whether the feet carry the robot, by what the servos of the legs do: torque is
//! stiffness times how far a servo stays behind its command, less its damping. A robot
//! that stands shows the torques that standing was estimated to take, a lifted one does not.

use servodance_types::JointState;

use super::leg_servo::LegServo;

/// Time constant of both torques, seconds.
const SMOOTH_S: f64 = 0.1;
/// Share of the estimated torques below which, and for how long, feet carry nothing; and
/// above which they carry again.
const LIFTED_SHARE: f64 = 0.25;
const LIFTED_S: f64 = 0.15;
const LOADED_SHARE: f64 = 0.5;
const LOADED_S: f64 = 0.05;
/// In which the balance comes back after a touch-down, seconds.
const RESUME_S: f64 = 0.6;

struct LoadedJoint {
    joint: usize,
    servo: LegServo,
    commanded_rad: f64,
    measured_nm: f64,
    estimated_nm: f64,
}

/// What the legs of one robot carry.
pub(super) struct FootLoad {
    joints: Vec<LoadedJoint>,
    dt_s: f64,
    /// For how long the load has contradicted the present state, seconds.
    contradicted_s: f64,
    is_lifted: bool,
    /// How far the balance is back, 0 to 1.
    resumed: f64,
}

impl FootLoad {
    /// For these joints, whose servos are in `servos` by joint; cycles of `dt_s`.
    pub fn new(joints: &[usize], servos: &[LegServo], dt_s: f64) -> Self {
        let loaded = |&joint: &usize| {
            let servo = *servos.get(joint).filter(|servo| servo.kp_nm_rad > 0.0)?;
            let still = LoadedJoint {
                joint,
                servo,
                commanded_rad: f64::NAN,
                measured_nm: 0.0,
                estimated_nm: 0.0,
            };
            Some(still)
        };
        Self {
            joints: joints.iter().filter_map(loaded).collect(),
            dt_s,
            contradicted_s: 0.0,
            is_lifted: false,
            resumed: 1.0,
        }
    }

    /// Takes in where the joints are after the last commands; `torque_nm` is what standing
    /// would take.
    pub fn observe(&mut self, states: &[JointState], torque_nm: &[f64]) {
        let share = self.dt_s / (SMOOTH_S + self.dt_s);
        let (mut along, mut size2) = (0.0, 0.0);
        for joint in &mut self.joints {
            let (state, LegServo { kp_nm_rad, damping_nm_s }) = (&states[joint.joint], joint.servo);
            if joint.commanded_rad.is_nan() {
                return;
            }
            let behind_rad = joint.commanded_rad - state.position_rad;
            let measured_nm = kp_nm_rad * behind_rad - damping_nm_s * state.velocity_rad_s;
            joint.measured_nm += (measured_nm - joint.measured_nm) * share;
            joint.estimated_nm += (torque_nm[joint.joint] - joint.estimated_nm) * share;
            along += joint.measured_nm * joint.estimated_nm;
            size2 += joint.estimated_nm * joint.estimated_nm;
        }
        if size2 > 0.0 {
            self.judge(along / size2);
        }
    }

    fn judge(&mut self, carried: f64) {
        let (contradicts, for_s) = match self.is_lifted {
            false => (carried < LIFTED_SHARE, LIFTED_S),
            true => (carried > LOADED_SHARE, LOADED_S),
        };
        self.contradicted_s = if contradicts { self.contradicted_s + self.dt_s } else { 0.0 };
        if self.contradicted_s >= for_s {
            self.is_lifted = !self.is_lifted;
            self.contradicted_s = 0.0;
        }
        self.resumed = match self.is_lifted {
            true => 0.0,
            false => (self.resumed + self.dt_s / RESUME_S).min(1.0),
        };
    }

    /// Remembers what the servos are told in this cycle.
    pub fn command(&mut self, commands_rad: &[f64]) {
        for joint in &mut self.joints {
            joint.commanded_rad = commands_rad[joint.joint];
        }
    }

    /// Whether the feet carry nothing.
    pub fn is_lifted(&self) -> bool {
        self.is_lifted
    }

    /// Share of a correction that is to be made.
    pub fn share(&self) -> f64 {
        self.resumed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint that was told 0.5 rad and gives way by its torque over its stiffness.
    fn after(load: &mut FootLoad, carried_nm: f64, seconds: f64) {
        for _ in 0..(seconds * 100.0) as usize {
            let state = JointState { position_rad: 0.5 - carried_nm / 20.0, ..Default::default() };
            load.observe(&[state], &[1.0]);
            load.command(&[0.5]);
        }
    }

    #[test]
    fn feet_without_load_are_seen_and_balance_comes_back_softly() {
        let servo = LegServo { kp_nm_rad: 20.0, damping_nm_s: 1.0 };
        let mut load = FootLoad::new(&[0], &[servo], 0.01);
        after(&mut load, 1.0, 1.0);
        assert!(!load.is_lifted() && load.share() == 1.0);
        after(&mut load, -0.1, 0.1);
        assert!(!load.is_lifted(), "a moment is no lift");
        after(&mut load, -0.1, 0.4);
        assert!(load.is_lifted() && load.share() == 0.0);
        after(&mut load, 1.0, 0.3);
        assert!(!load.is_lifted() && load.share() > 0.0 && load.share() < 0.5);
        after(&mut load, 1.0, 0.6);
        assert_eq!(load.share(), 1.0);
    }
}
