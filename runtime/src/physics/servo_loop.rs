//! A servo as a position loop with limited torque: what a physics engine needs of it.

use crate::robot::Robot;
use servodance_drivers::Servo;
use servodance_retarget::{JointLoad, LegServo, Retargeter};
use servodance_sim::world::{JointDrive, JointMechanics};

/// Position error at which a Dynamixel of stock gain gives its stall torque, and the
/// inertia of its rotor behind the gear against that torque: as identified for the
/// XM430-W350 in a public MuJoCo model of OP3 (21.1 N m/rad, 4.1 N m, 0.045 kg m2).
const STALL_ERROR_RAD: f64 = 4.1 / 21.1;
const ROTOR_KG_M2_PER_NM: f64 = 0.045 / 4.1;
/// Damping against stall torque over no-load speed, from the same source.
const DAMPING_SHARE: f64 = 1.084 / 0.851;
const FRICTION_SHARE: f64 = 0.0075;
/// Servos that are sized for their load: rotor against load, damping ratio.
const SIZED_ROTOR: f64 = 0.1;
const SIZED_DAMPING: f64 = 0.5;
const SIZED_LEG: Sizing = Sizing { natural_hz: 3.0, weights: 2.0, sag_rad: 1.0 };
/// Above the legs. Softer, a forearm hangs 0.1 rad under its command; weaker, a hand whose arm
/// swings does not follow.
const SIZED_UPPER: Sizing = Sizing { natural_hz: 6.0, weights: 5.0, sag_rad: 0.1 };

/// `torque = clamp(kp (goal - position), limit) - damping velocity`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoLoop {
    /// Newton metres a radian.
    pub kp: f64,
    /// Newton metres for one radian a second.
    pub damping_nm_s: f64,
    /// Most torque, newton metres.
    pub limit_nm: f64,
    /// What it adds to its joint.
    pub mechanics: JointMechanics,
}

/// What a servo is asked for that is sized for its load.
struct Sizing {
    /// Natural frequency with the load.
    natural_hz: f64,
    /// How many times the load's weight it carries, and by how much it gives way then.
    weights: f64,
    sag_rad: f64,
}

/// How the servos of one robot differ from their nominal ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoVariation {
    /// Factor on the stiffness.
    pub stiffness: f64,
    /// Stiffness in place of each servo's own, N m/rad.
    pub kp: Option<f64>,
    /// Play of all gears, radians.
    pub play_rad: f64,
}

impl Default for ServoVariation {
    fn default() -> Self {
        Self { stiffness: 1.0, kp: None, play_rad: 0.0 }
    }
}

impl ServoLoop {
    /// The loop of a servo as the robot file describes it.
    pub fn of(servo: &Servo, variation: &ServoVariation) -> Self {
        let nominal = match &servo.motor {
            Some(motor) => Self {
                kp: motor.kp,
                damping_nm_s: motor.kd,
                limit_nm: motor.torque_limit_nm,
                mechanics: JointMechanics {
                    armature_kg_m2: motor.model.rotor_inertia_kg_m2(),
                    friction_nm: FRICTION_SHARE * motor.model.torque_nm,
                    play_rad: 0.0,
                },
            },
            None => {
                let sheet = &servo.model.sheet;
                let speed_rad_s = sheet.no_load_rpm * std::f64::consts::TAU / 60.0;
                let stall_nm = sheet.stall_torque_nm;
                Self {
                    kp: stall_nm / STALL_ERROR_RAD,
                    damping_nm_s: DAMPING_SHARE * stall_nm / speed_rad_s,
                    limit_nm: stall_nm,
                    mechanics: JointMechanics {
                        armature_kg_m2: ROTOR_KG_M2_PER_NM * stall_nm,
                        friction_nm: FRICTION_SHARE * stall_nm,
                        play_rad: 0.0,
                    },
                }
            }
        };
        Self {
            kp: variation.kp.unwrap_or(nominal.kp) * variation.stiffness,
            mechanics: JointMechanics { play_rad: variation.play_rad, ..nominal.mechanics },
            ..nominal
        }
    }

    /// The same, but stiff and strong enough for what its joint carries, and to give that
    /// the acceleration.
    fn sized(
        self,
        load: &JointLoad,
        sizing: &Sizing,
        acceleration_rad_s2: f64,
        variation: &ServoVariation,
    ) -> Self {
        let bounce = std::f64::consts::TAU * sizing.natural_hz;
        let inertia = load.inertia_kg_m2.max(1e-3);
        let carried_nm = sizing.weights * load.gravity_nm_rad;
        let kp = (inertia * bounce * bounce).max(carried_nm / sizing.sag_rad);
        let armature_kg_m2 = SIZED_ROTOR * inertia;
        Self {
            kp: kp * variation.stiffness,
            damping_nm_s: 2.0 * SIZED_DAMPING * (kp * (inertia + armature_kg_m2)).sqrt(),
            limit_nm: load
                .effort_nm
                .unwrap_or(self.limit_nm)
                .max(carried_nm)
                .max(load.gravity_nm_rad + inertia * acceleration_rad_s2),
            mechanics: JointMechanics {
                armature_kg_m2,
                friction_nm: FRICTION_SHARE * load.gravity_nm_rad,
                ..self.mechanics
            },
        }
    }

    /// The loops of a robot's servos; those of a robot whose servos are placeholders, or
    /// that are to be `sized`, are strong enough for what their joints carry.
    pub fn of_robot(
        robot: &Robot,
        retargeter: &Retargeter,
        variation: &ServoVariation,
        sized: bool,
    ) -> Vec<Self> {
        let nominal = robot.servos.iter().map(|servo| Self::of(servo, variation));
        match sized || robot.placeholder_servos {
            false => nominal.collect(),
            true => {
                let (loads, upper) = (retargeter.joint_loads(), retargeter.upper_joints());
                let sized = |(joint, (servo, load)): (usize, (Self, &JointLoad))| {
                    let limits = &robot.servos[joint].limits;
                    match upper.contains(&joint) {
                        true => {
                            servo.sized(load, &SIZED_UPPER, limits.acceleration_rad_s2, variation)
                        }
                        false => servo.sized(load, &SIZED_LEG, 0.0, variation),
                    }
                };
                nominal.zip(&loads).enumerate().map(sized).collect()
            }
        }
    }

    /// How many times as strong as its model a placeholder has to be for this loop.
    pub fn strength(&self, servo: &Servo) -> f64 {
        let nominal = Self::of(servo, &ServoVariation::default());
        (self.kp / nominal.kp).max(self.limit_nm / nominal.limit_nm).max(1.0)
    }

    /// The same as balance has to know it.
    pub fn leg_servo(&self) -> LegServo {
        LegServo { kp_nm_rad: self.kp, damping_nm_s: self.damping_nm_s }
    }

    /// What the servo does at `position` with this goal.
    pub fn drive(&self, goal_rad: f64, position_rad: f64) -> JointDrive {
        let asked_nm = self.kp * (goal_rad - position_rad);
        JointDrive {
            torque_nm: asked_nm.clamp(-self.limit_nm, self.limit_nm),
            damping_nm_s: self.damping_nm_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_servo_above_the_legs_carries_its_hand_while_the_arm_swings() {
        let weak = ServoLoop {
            kp: 1.0,
            damping_nm_s: 0.0,
            limit_nm: 1.0,
            mechanics: JointMechanics::default(),
        };
        // 0.8 kg, 0.1 m beyond the wrist, in an arm that accelerates by 4 g.
        let load = JointLoad { inertia_kg_m2: 0.01, gravity_nm_rad: 0.8, effort_nm: None };
        let swing_nm = 4.0 * load.gravity_nm_rad;
        let sized = |sizing| weak.sized(&load, sizing, 50.0, &ServoVariation::default());
        let hand = sized(&SIZED_UPPER);
        assert!(hand.limit_nm > swing_nm && swing_nm / hand.kp < 0.1, "{hand:?}");
        assert!(sized(&SIZED_LEG).limit_nm < swing_nm);
    }
}
