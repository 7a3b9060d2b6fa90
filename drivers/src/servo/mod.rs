//! One servo of the robot, checked: joint radians to its own units and back.
//!
//! `servo = zero + direction * joint`, where `zero` is the servo's own angle at
//! which the joint reads zero. A serial servo takes that in encoder ticks of a
//! single turn (centre half a turn), and every limit lies within the turn. A CAN
//! motor takes radians and has its [`MotorSettings`].

pub(crate) mod catalogue;
pub(crate) mod config;
pub(crate) mod model;

use servodance_types::{JointLimits, JointState};

use crate::bus::kind::BusKind;
use crate::can::MotorSettings;
use crate::error::{BusError, BusResult, ServoId};
use crate::servo::model::ServoModel;

/// A checked servo. Made by [`crate::servos`].
#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Debug, PartialEq)]
pub struct Servo {
    pub name: String,
    pub id: u8,
    pub model: &'static ServoModel,
    /// The firmware that it must have; any if `None`.
    pub firmware: Option<u8>,
    /// +1 or -1: the servo's direction against the joint axis.
    pub direction: f64,
    /// The servo's angle where the joint reads zero, radians.
    pub zero_rad: f64,
    pub limits: JointLimits,
    /// What only a CAN motor has; `None` for a serial servo.
    pub motor: Option<MotorSettings>,
    pub settings: SerialSettings,
}

/// Settings in the memory of a serial servo that the robot file may name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SerialSettings {
    /// What the servo adds to its angle, ticks; another offset is refused before torque.
    pub homing_offset: Option<i32>,
    /// Position gains P, I and D, in the servo's units; the factory's if left out.
    pub gains: Option<[u16; 3]>,
}

/// A joint may stand this far outside its limits when arming; its first target is
/// then the limit itself. Backlash and sag leave a joint there.
const REST_TOLERANCE_RAD: f64 = 0.05;

impl Servo {
    /// The joint position that keeps a joint where it stands; refused far outside its limits.
    pub(crate) fn holding_rad(&self, position_rad: f64) -> BusResult<f64> {
        let limits = self.limits;
        let outside = (limits.lower_rad - position_rad).max(position_rad - limits.upper_rad);
        // Not a number counts as outside.
        if outside <= REST_TOLERANCE_RAD {
            return Ok(limits.clamp_rad(position_rad));
        }
        Err(BusError::Unfit {
            servo: ServoId::of(self),
            what: "position",
            actual: format!("{:.1} degrees", position_rad.to_degrees()),
            wanted: format!(
                "{:.1} to {:.1} degrees: move the joint there by hand",
                limits.lower_rad.to_degrees(),
                limits.upper_rad.to_degrees()
            ),
        })
    }

    /// The servo's own angle, after its gear, for a joint position.
    pub fn motor_rad(&self, joint_rad: f64) -> f64 {
        self.zero_rad + self.direction * joint_rad
    }

    /// The joint position for the servo's own angle.
    pub fn joint_rad(&self, motor_rad: f64) -> f64 {
        (motor_rad - self.zero_rad) * self.direction
    }

    /// The unrounded servo position for a joint position, ticks.
    pub fn exact_ticks(&self, joint_rad: f64) -> f64 {
        self.motor_rad(joint_rad) / self.model.rad_per_tick
    }

    /// The lowest and highest goal, ticks, that lie inside the joint's limits
    /// (rounded inwards: a goal never passes a limit, not even by half a tick).
    pub fn goal_range_ticks(&self) -> (i32, i32) {
        let a = self.exact_ticks(self.limits.lower_rad);
        let b = self.exact_ticks(self.limits.upper_rad);
        // A limit that is a whole number of ticks must survive its own rounding error.
        let lowest = (a.min(b) - 1e-6).ceil() as i32;
        let highest = (a.max(b) + 1e-6).floor() as i32;
        (lowest, highest)
    }

    /// The goal for a finite joint position: the nearest tick inside the limits.
    pub fn goal_ticks(&self, joint_rad: f64) -> i32 {
        let (lowest, highest) = self.goal_range_ticks();
        (self.exact_ticks(joint_rad).round() as i32).clamp(lowest, highest)
    }

    /// The joint position for a servo position.
    pub fn position_rad(&self, ticks: i32) -> f64 {
        self.joint_rad(f64::from(ticks) * self.model.rad_per_tick)
    }

    /// The joint's state from the servo's raw registers (signed, in its units).
    /// Current is 0 for a model that does not measure it.
    pub fn state(&self, ticks: i32, velocity: i32, current: i16) -> JointState {
        let current_a_per_unit = self.model.current_a_per_unit.unwrap_or(0.0);
        JointState {
            position_rad: self.position_rad(ticks),
            velocity_rad_s: self.direction
                * f64::from(velocity)
                * self.model.velocity_rad_s_per_unit,
            current_a: self.direction * f64::from(current) * current_a_per_unit,
        }
    }
}

impl ServoId {
    /// The joint and id of a servo.
    pub fn of(servo: &Servo) -> Self {
        Self { joint: servo.name.clone(), id: servo.id }
    }
}

pub(crate) fn check_models(
    servos: &[Servo],
    speaks: impl Fn(&Servo) -> bool,
) -> Result<(), String> {
    match servos.iter().find(|servo| !speaks(servo)) {
        None => Ok(()),
        Some(servo) => Err(format!(
            "joint {}: model {} does not speak the bus's protocol",
            servo.name, servo.model.name
        )),
    }
}

pub(crate) fn check_kind(servos: &[Servo], kind: BusKind) -> Result<(), String> {
    check_models(servos, |servo| servo.model.kind == kind)
}

/// What every cycle checks before anything is sent: a finite target and a
/// place for the state of each servo.
pub(crate) fn check_cycle(servos: &[Servo], targets_rad: &[f64], states: usize) -> BusResult<()> {
    for (actual, what) in [(targets_rad.len(), "targets"), (states, "states")] {
        if actual != servos.len() {
            return Err(BusError::Length { servos: servos.len(), actual, what });
        }
    }
    let mut targets = servos.iter().zip(targets_rad);
    match targets.find(|(_, target)| !target.is_finite()) {
        Some((servo, &target)) => Err(BusError::NotFinite { servo: ServoId::of(servo), target }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn servo(direction: f64) -> Servo {
        Servo {
            name: "elbow".into(),
            id: 5,
            model: ServoModel::from_name("XM430-W350").unwrap(),
            firmware: None,
            direction,
            zero_rad: std::f64::consts::PI,
            limits: JointLimits {
                lower_rad: -1.0,
                upper_rad: 0.5,
                velocity_rad_s: 4.0,
                acceleration_rad_s2: 40.0,
            },
            motor: None,
            settings: SerialSettings::default(),
        }
    }

    #[test]
    fn centre_is_2048_and_direction_mirrors() {
        assert_eq!(servo(1.0).goal_ticks(0.0), 2048);
        assert_eq!(servo(1.0).goal_ticks(0.1), 2113);
        assert_eq!(servo(-1.0).goal_ticks(0.1), 1983);
        assert!((servo(-1.0).position_rad(1983) - 0.1).abs() < 1e-3);
    }

    #[test]
    fn no_goal_passes_a_limit() {
        for direction in [1.0, -1.0] {
            let servo = servo(direction);
            for target in [-9.0, -1.0, 0.5, 9.0] {
                let position = servo.position_rad(servo.goal_ticks(target));
                assert!((-1.0 - 1e-9..=0.5 + 1e-9).contains(&position), "{position}");
            }
        }
    }

    #[test]
    fn current_and_velocity_follow_the_joint_axis() {
        let state = servo(-1.0).state(2048, 100, 100);
        assert!((state.velocity_rad_s + 2.398).abs() < 1e-3);
        assert!((state.current_a + 0.269).abs() < 1e-9);
    }
}
