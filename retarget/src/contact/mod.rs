//! What touches what: feet on the floor, arms on the body.

mod balance;
pub(crate) mod capsules;
mod four_feet;
mod pelvis;
mod planted_stance;
mod stepping;

pub(crate) use balance::{SupportPolygon, sole_corners};
pub(crate) use capsules::CapsulePair;
pub(crate) use four_feet::FourFeet;
pub(crate) use pelvis::PelvisTrajectory;
pub(crate) use planted_stance::PlantedStance;
pub(crate) use stepping::{FootStepper, StepContext};
