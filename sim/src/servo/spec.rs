//! One simulated servo: its model, mounting, load and limits.

use servodance_drivers::can::MotorSettings;
use servodance_drivers::{BusKind, Servo, ServoModel};
use servodance_types::JointLimits;

use crate::error::SimError;
use crate::servo::motor::Motor;
use crate::world::JointMechanics;

/// One simulated servo: what the driver knows of it, and what it does not.
#[derive(Clone, Debug, PartialEq)]
pub struct SimServoSpec {
    /// The joint's name, for messages.
    pub name: String,
    /// The id on its bus.
    pub id: u8,
    /// What the servo is. The number of a [`ServoModel`].
    pub model_number: u16,
    /// Firmware version; Fast Sync Read came with 45 (46 in the smallest models).
    pub firmware: u8,
    /// +1 or -1: the servo's direction against the joint axis.
    pub direction: f64,
    /// The servo's angle where the joint reads zero, radians.
    pub zero_rad: f64,
    /// What the joint is judged against.
    pub limits: JointLimits,
    /// Where the joint stands at the start, radians.
    pub initial_rad: f64,
    /// What the joint carries besides the gear: kilogram square metres.
    pub load_inertia_kg_m2: f64,
    /// Torque that gravity puts on the joint at 90 degrees, newton metres.
    pub gravity_nm: f64,
    /// Play of its gear, radians.
    pub backlash_rad: f64,
    /// How many times as strong its motor is as its model's, at least 1: for placeholders.
    pub strength: f64,
    /// The protocol it speaks.
    pub kind: BusKind,
    /// What only a CAN motor has.
    pub motor: Option<MotorSettings>,
}

impl SimServoSpec {
    pub(crate) fn checked(&self) -> Result<&'static ServoModel, SimError> {
        let model = ServoModel::from_number(self.model_number)
            .ok_or_else(|| self.refused(format!("unknown model number {}", self.model_number)))?;
        self.limits.checked().map_err(|reason| self.refused(reason))?;
        let finite = [self.initial_rad, self.zero_rad, self.gravity_nm]
            .iter()
            .all(|value| value.is_finite());
        let sizes = [self.load_inertia_kg_m2, self.backlash_rad, self.strength];
        if !finite || sizes.iter().any(|size| size.is_nan() || *size < 0.0) {
            let reason = "a figure is not a finite number, or an inertia or play below zero";
            return Err(self.refused(reason.into()));
        }
        Ok(model)
    }

    /// What the servo adds to its joint in a world: inertia of its rotor and of what it
    /// carries besides, dry friction, play.
    pub fn mechanics(&self) -> Result<JointMechanics, SimError> {
        let motor = match &self.motor {
            Some(settings) => Motor::of_can(settings, 1.0, self.load_inertia_kg_m2),
            None => self.servo_motor(self.checked()?),
        };
        Ok(JointMechanics {
            armature_kg_m2: motor.inertia_kg_m2,
            friction_nm: motor.friction_nm,
            play_rad: self.backlash_rad,
        })
    }

    pub(crate) fn servo_motor(&self, model: &ServoModel) -> Motor {
        Motor::new(&model.sheet, self.load_inertia_kg_m2).times(self.strength)
    }

    pub(crate) fn refused(&self, reason: String) -> SimError {
        SimError::Servo { joint: self.name.clone(), id: self.id, reason }
    }

    /// The same with the play that the vendor states for its model's gear.
    pub fn with_stated_backlash(self) -> Self {
        let model = ServoModel::from_number(self.model_number);
        Self {
            backlash_rad: model
                .map_or(0.0, |model| (model.sheet.backlash_arcmin / 60.0).to_radians()),
            ..self
        }
    }
}

impl From<&Servo> for SimServoSpec {
    /// The servo as the robot file describes it, at rest at zero (or the nearest
    /// position inside its limits), unloaded, its gear without play.
    fn from(servo: &Servo) -> Self {
        Self {
            name: servo.name.clone(),
            id: servo.id,
            model_number: servo.model.number,
            firmware: 48,
            direction: servo.direction,
            zero_rad: servo.zero_rad,
            limits: servo.limits,
            initial_rad: servo.limits.clamp_rad(0.0),
            load_inertia_kg_m2: 0.0,
            gravity_nm: 0.0,
            backlash_rad: 0.0,
            strength: 1.0,
            kind: servo.model.kind,
            motor: servo.motor.clone(),
        }
    }
}
