//! What every reader of a description asks of a joint.

pub(crate) fn is_driven(joint: &urdf_rs::Joint) -> bool {
    use urdf_rs::JointType::*;
    matches!(joint.joint_type, Revolute | Continuous | Prismatic)
}

/// Where a joint that nothing drives stays: zero, or the nearest limit.
pub(crate) fn held_position(joint: &urdf_rs::Joint) -> f64 {
    let limit = &joint.limit;
    let turns = joint.joint_type == urdf_rs::JointType::Continuous;
    match limit.lower < limit.upper && !turns {
        true => 0.0_f64.clamp(limit.lower, limit.upper),
        false => 0.0,
    }
}

pub(super) fn mimic_numbers(mimic: &urdf_rs::Mimic) -> (f64, f64) {
    (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0))
}

/// Whether a joint is called passive: others move it (the rods of a platform, say), or the ground
/// does by the wheels of a rover.
pub(super) fn is_passive(joint: &urdf_rs::Joint) -> bool {
    const PASSIVE: [&str; 5] = ["passive", "suspension", "rocker", "bogie", "spring"];
    let name = joint.name.to_lowercase();
    PASSIVE.iter().any(|word| name.contains(word))
}
