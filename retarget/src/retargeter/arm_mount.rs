//! How a lone arm is mounted and how far it bends, from its model and limits.

use crate::dancer::ArmMount;
use crate::kinematics::{ArmLinks, RobotModel};
use k::nalgebra::{Isometry3, Vector3};
use servodance_types::JointLimits;

/// Directions of upper arm and forearm (or hand) in the world, root being at `upright`.
fn segments(
    model: &RobotModel,
    arm: &ArmLinks,
    upright: &Isometry3<f64>,
    positions: &[f64],
) -> Option<[Vector3<f64>; 2]> {
    let mut poses = vec![Isometry3::identity(); model.links.len()];
    model.place(upright, positions, &mut poses);
    let at = |link: usize| poses[link].translation.vector;
    let (shoulder, elbow, hand) = (at(arm.shoulder?), at(arm.elbow?), at(arm.hand?));
    Some([elbow - shoulder, hand - elbow])
}

/// What the arm's joints allow: seen with all of them at zero, or as near as they come.
pub(super) fn arm_mount(
    model: &RobotModel,
    arm: &ArmLinks,
    upright: &Isometry3<f64>,
    limits: &[JointLimits],
) -> ArmMount {
    let zero: Vec<f64> = limits.iter().map(|limits| limits.clamp_rad(0.0)).collect();
    let seen = |positions: &[f64]| segments(model, arm, upright, positions);
    let (Some(shoulder), Some(elbow)) = (arm.shoulder, arm.elbow) else {
        return ArmMount::default();
    };
    let (mut lowest, mut highest, mut most_bend_rad) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
    let mut look = |positions: &[f64]| {
        let Some([upper, lower]) = seen(positions) else { return };
        let along = upper.normalize().z;
        (lowest, highest) = (lowest.min(along), highest.max(along));
        most_bend_rad = most_bend_rad.max(upper.angle(&lower));
    };
    for link in model.ancestors(elbow) {
        let Some(drive) = model.links[link].drive else { continue };
        let (low, high) = (limits[drive.joint].lower_rad, limits[drive.joint].upper_rad);
        for step in 0..=8 {
            let mut positions = zero.clone();
            positions[drive.joint] = low + (high - low) * f64::from(step) / 8.0;
            look(&positions);
        }
    }
    debug_assert!(model.is_below(elbow, shoulder));
    ArmMount { upside_down: highest < -lowest - 1e-6, most_bend_rad }
}
