//! What touches what: feet on the floor, arms on the body.

pub(crate) mod balance;
pub(crate) mod capsules;
pub(crate) mod pelvis;
pub(crate) mod planted_stance;
pub(crate) mod stepping;
