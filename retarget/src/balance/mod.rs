//! Staying on two feet: a plan that can be stood, and its correction by a sensor.

mod arm_share;
mod carried_acceleration;
mod counterweight;
mod fall_detector;
mod feedback;
mod foot_load;
mod leg_servo;
mod servo_give;
mod zmp_governor;
mod zmp_weights;

pub(crate) use arm_share::ArmShare;
pub(crate) use carried_acceleration::CarriedAcceleration;
pub use feedback::BalanceFeedback;
pub use leg_servo::LegServo;
pub(crate) use zmp_governor::{GovernorInput, GovernorSettings, ZmpGovernor};
pub(crate) use zmp_weights::ZmpWeights;
