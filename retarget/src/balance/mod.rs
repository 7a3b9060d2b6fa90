//! Staying on two feet: a plan that can be stood, and its correction by a sensor.

mod feedback;
mod zmp_governor;

pub use feedback::{BalanceFeedback, LegServo};
pub(crate) use zmp_governor::{GovernorInput, ZmpGovernor};
