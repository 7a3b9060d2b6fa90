//! How much one joint of arms or head moves the zero-moment point, beside the one that moves
//! it most: a shoulder swings the whole arm, a wrist next to nothing.
//!
//! Where arms have to give way (`arm_share`), a joint keeps their share to the power of its
//! weight: shoulders give way, hands and heads go on.

use k::nalgebra::Isometry3;
use servodance_types::JointLimits;

use super::CarriedAcceleration;
use crate::contact::SupportPolygon;
use crate::kinematics::{PosedRobot, RobotModel};

/// A bent arm is not a hanging one: postures over which is averaged, and how far from rest their
/// joints are at most, radians.
const POSTURES: u32 = 32;
const AROUND_REST_RAD: f64 = 1.2;
/// Multiples of the golden ratio fill the range of a joint evenly.
const GOLDEN_RATIO: f64 = 1.618_034;

pub(crate) struct ZmpWeights<'a> {
    pub model: &'a RobotModel,
    pub root: Isometry3<f64>,
    /// Joint positions, radians.
    pub rest: &'a [f64],
    pub limits: &'a [JointLimits],
    /// By joint: whether it belongs to an arm or the head.
    pub is_arm_or_head: &'a [bool],
    /// By link: whether it belongs to a leg that stands.
    pub is_leg: &'a [bool],
    pub support: &'a SupportPolygon,
}

impl ZmpWeights<'_> {
    /// By joint: mean square of what it does to the point over that of the joint of arms
    /// and head that does most, 0 to 1.
    pub fn by_joint(&self) -> Vec<f64> {
        let mut poses = vec![Isometry3::identity(); self.model.links.len()];
        let mut effects = vec![0.0; self.rest.len()];
        for posture in 1..=POSTURES {
            self.model.place(&self.root, &self.posture(posture), &mut poses);
            let carried = CarriedAcceleration {
                robot: PosedRobot::new(self.model, &poses),
                support: self.support,
                is_leg: self.is_leg,
            };
            for (effect, acceleration) in effects.iter_mut().zip(carried.joints()) {
                *effect += acceleration.powi(-2);
            }
        }
        let upper =
            effects.iter().zip(self.is_arm_or_head).filter(|(_, is_arm_or_head)| **is_arm_or_head);
        let most = upper.map(|(effect, _)| *effect).fold(f64::MIN_POSITIVE, f64::max);
        effects.iter().map(|effect| (effect / most).min(1.0)).collect()
    }

    fn posture(&self, number: u32) -> Vec<f64> {
        let position = |joint: usize| {
            let turn = (GOLDEN_RATIO * f64::from(number) * (joint + 1) as f64).fract();
            let away = AROUND_REST_RAD * (2.0 * turn - 1.0);
            match self.is_arm_or_head[joint] {
                true => self.limits[joint].clamp_rad(self.rest[joint] + away),
                false => self.rest[joint],
            }
        };
        (0..self.rest.len()).map(position).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An upper arm and a forearm of 1 kg each, 0.3 m long, that hang from a shoulder at 1 m over
    /// the feet; a hand of 0.1 kg turns about the forearm's axis.
    const ARM: &str = r#"<robot name="arm"><link name="base"/>
        <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
        <origin xyz="0 0 1"/><axis xyz="0 1 0"/>
        <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
        <link name="upper"><inertial><origin xyz="0 0 -0.15"/><mass value="1"/>
        <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
        <origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>
        <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
        <link name="lower"><inertial><origin xyz="0 0 -0.15"/><mass value="1"/>
        <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="wrist" type="revolute"><parent link="lower"/><child link="hand"/>
        <origin xyz="0 0 -0.3"/><axis xyz="0 0 1"/>
        <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
        <link name="hand"><inertial><origin xyz="0 0 -0.02"/><mass value="0.1"/>
        <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;

    #[test]
    fn a_shoulder_weighs_most_an_elbow_less_and_a_wrist_that_only_turns_nothing() {
        let model = RobotModel::new(ARM, &["shoulder", "elbow", "wrist"]).unwrap();
        let foot = |y: f64| Isometry3::translation(0.0, y, 0.0);
        let limits = JointLimits {
            lower_rad: -3.0,
            upper_rad: 3.0,
            velocity_rad_s: 9.0,
            acceleration_rad_s2: 99.0,
        };
        let weights = ZmpWeights {
            model: &model,
            root: Isometry3::identity(),
            rest: &[0.0; 3],
            limits: &[limits; 3],
            is_arm_or_head: &[true; 3],
            is_leg: &[false; 4],
            support: &SupportPolygon::new(&[foot(0.1), foot(-0.1)], [0.2, 0.1]),
        }
        .by_joint();
        assert_eq!(weights[0], 1.0);
        assert!((0.05..0.4).contains(&weights[1]), "{weights:?}");
        assert!(weights[2] < 1e-9, "{weights:?}");
    }
}
