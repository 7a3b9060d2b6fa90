//! Balance of a robot on its feet: its legs go ahead of what their servos will give, and
//! the readings of its motion sensor correct them. A sensor that falls silent costs
//! amplitude. A robot that somebody has lifted is left alone until it stands again.

use super::robot_buses::RobotBuses;
use crate::physics::ServoLoop;
use crate::robot::Robot;
use servodance_retarget::{BalanceFeedback, LegServo, Retargeter};

/// Share of the dance that is kept without the sensor or in somebody's hands, and the time to get there.
const BLIND_SHARE: f64 = 0.6;
const EASE_S: f64 = 0.5;
const LIFTED: &str = "the feet carry nothing: the robot is held, its balance rests";
const STANDS_AGAIN: &str = "the feet carry the robot again: its balance comes back";
/// A sensor that was never heard is lost after this, seconds.
const SILENT_S: f64 = 0.5;

/// What corrects the commands of one robot.
pub struct Balance {
    feedback: BalanceFeedback,
    commands_rad: Vec<f64>,
    period_s: f64,
    silent_s: f64,
    caution: f64,
    has_sensor: bool,
    was_lifted: bool,
    /// How often the sensor fell silent.
    pub losses: u64,
}

impl Balance {
    /// `None` for a robot that does not stand, or whose servos carry no weight.
    pub fn new(robot: &Robot, retargeter: &Retargeter, servos: &RobotBuses) -> Option<Self> {
        if !servos.carries_weight() {
            return None;
        }
        let loops = ServoLoop::of_robot(robot, retargeter, &Default::default(), false);
        let legs: Vec<LegServo> = loops.iter().map(ServoLoop::leg_servo).collect();
        let limits: Vec<_> = robot.servos.iter().map(|servo| servo.limits).collect();
        Some(Self {
            feedback: BalanceFeedback::new(retargeter, &legs, &limits)?,
            commands_rad: vec![0.0; robot.servos.len()],
            period_s: robot.period_s(),
            silent_s: 0.0,
            caution: 1.0,
            has_sensor: servos.senses_motion(),
            was_lifted: false,
            losses: 0,
        })
    }

    /// Whether the sensor says that the robot is falling.
    pub fn is_falling(&self) -> bool {
        self.has_sensor && self.feedback.is_falling()
    }

    /// The commands of a cycle: the plan, corrected. `retargeter` dances less while the
    /// sensor is silent.
    pub fn correct(
        &mut self,
        plan_rad: &[f64],
        retargeter: &mut Retargeter,
        servos: &mut RobotBuses,
    ) -> &[f64] {
        let reading = servos.imu();
        self.commands_rad.copy_from_slice(plan_rad);
        self.feedback.feel(retargeter, servos.states());
        self.tell_lift(servos);
        self.feedback.correct(retargeter, reading.as_ref(), &mut self.commands_rad);
        retargeter.set_steady(self.feedback.is_steady());
        let before_s = self.silent_s;
        self.silent_s = if reading.is_some() { 0.0 } else { before_s + self.period_s };
        let lost = self.has_sensor && self.silent_s > SILENT_S;
        self.losses += u64::from(lost && before_s <= SILENT_S);
        let wanted = if lost || self.was_lifted { BLIND_SHARE } else { 1.0 };
        self.caution += (wanted - self.caution) * self.period_s / EASE_S;
        retargeter.set_caution(self.caution);
        &self.commands_rad
    }

    /// Says once that the robot was lifted, and that it stands again.
    fn tell_lift(&mut self, servos: &mut RobotBuses) {
        let is_lifted = self.feedback.is_lifted();
        match (self.was_lifted, is_lifted) {
            (false, true) => servos.note(LIFTED),
            (true, false) => servos.note(STANDS_AGAIN),
            _ => {}
        }
        self.was_lifted = is_lifted;
    }
}
