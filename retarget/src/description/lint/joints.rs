//! Limits, kinds and mirror partners of single joints.

use std::f64::consts::PI;

use crate::description::diagnostic::{DiagnosticCode, Diagnostics};
use crate::description::guess::words::NameWords;
use crate::description::joints::mimic_numbers;

pub(super) const PLACEHOLDER_RAD_S: f64 = 50.0;
/// A joint that is slower than this is late on every beat, radians a second.
const SLOW_RAD_S: f64 = 1.0;
const PLACEHOLDER_NM: f64 = 1000.0;
/// Ranges wider than this are suspicious for a servo, radians.
const WIDE_RAD: f64 = 315.0 * PI / 180.0;

pub(super) fn lint_joint(
    joint: &urdf_rs::Joint,
    robot: &urdf_rs::Robot,
    diagnostics: &mut Diagnostics,
) {
    lint_kind(joint, diagnostics);
    lint_limit(joint, diagnostics);
    lint_mirror(joint, robot, diagnostics);
}

fn lint_kind(joint: &urdf_rs::Joint, diagnostics: &mut Diagnostics) {
    let name = &joint.name;
    match joint.joint_type {
        urdf_rs::JointType::Continuous => {
            let message = "turns without end; the servo map's limits hold, counted through";
            diagnostics.add(DiagnosticCode::JointContinuous, name, message);
        }
        urdf_rs::JointType::Prismatic => {
            let message = "slides; held at rest unless the servo map has it";
            diagnostics.add(DiagnosticCode::JointPrismatic, name, message);
        }
        _ => {}
    }
    if let Some(mimic) = &joint.mimic {
        let (multiplier, offset) = mimic_numbers(mimic);
        let message =
            format!("follows `{}`: {multiplier} times its position plus {offset}", mimic.joint);
        diagnostics.add(DiagnosticCode::JointMimic, name, message);
    }
}

fn lint_limit(joint: &urdf_rs::Joint, diagnostics: &mut Diagnostics) {
    let limit = &joint.limit;
    let mut say = |code, message: String| diagnostics.add(code, &joint.name, message);
    if joint.mimic.is_none() {
        if limit.velocity.is_nan() || limit.velocity <= 0.0 {
            let message =
                format!("velocity limit {} means unset; the servo map's is used", limit.velocity);
            say(DiagnosticCode::VelocityUnset, message);
        } else if limit.velocity > PLACEHOLDER_RAD_S {
            let message = format!(
                "velocity limit {} rad/s is a placeholder; the servo map's is used",
                limit.velocity
            );
            say(DiagnosticCode::VelocityPlaceholder, message);
        } else if limit.velocity < SLOW_RAD_S && joint.joint_type != urdf_rs::JointType::Prismatic {
            let message = format!(
                "velocity limit {} rad/s is slow: the dance is small and late; if the servo is \
                 faster, say so in the description",
                limit.velocity
            );
            say(DiagnosticCode::VelocitySlow, message);
        }
        if limit.effort.is_nan() || limit.effort <= 0.0 {
            let message = format!("effort limit {} means unset", limit.effort);
            say(DiagnosticCode::EffortUnset, message);
        } else if limit.effort >= PLACEHOLDER_NM {
            let message = format!("effort limit {} is a placeholder", limit.effort);
            say(DiagnosticCode::EffortPlaceholder, message);
        }
    }
    if joint.joint_type == urdf_rs::JointType::Continuous {
        return;
    }
    let (lower, upper) = (limit.lower, limit.upper);
    if lower == upper {
        let message = format!("both position limits are {lower}; the servo map's are used");
        say(DiagnosticCode::RangeUnset, message);
    } else if !(lower..=upper).contains(&0.0) {
        let message =
            format!("zero is outside {lower} to {upper}; the nearest limit stands for it");
        say(DiagnosticCode::ZeroOutside, message);
    }
    if joint.joint_type != urdf_rs::JointType::Revolute {
        return;
    }
    let share = upper / PI;
    let round = [0.9, 1.0, 2.0].iter().any(|known| (share - known).abs() < 2e-3);
    if (round && (lower + upper).abs() < 0.01) || upper - lower > 20.0 {
        let message = format!("{lower} to {upper} ({share:.2} pi both ways) is a placeholder");
        say(DiagnosticCode::RangePlaceholder, message);
    } else if upper - lower > WIDE_RAD {
        let degrees = (upper - lower).to_degrees();
        let message = format!("range of {degrees:.0} degrees: a servo may not turn so far");
        say(DiagnosticCode::RangeWide, message);
    }
}

/// Left and right should allow the same, counted either way round.
fn lint_mirror(joint: &urdf_rs::Joint, robot: &urdf_rs::Robot, diagnostics: &mut Diagnostics) {
    let Some(other_name) = right_of(&joint.name) else {
        return;
    };
    // A joint between two links of one side may say it twice.
    let all_right = joint.name.replace("left", "right").replace("Left", "Right");
    let named = |name: &str| robot.joints.iter().find(|other| other.name == *name);
    let other = named(&other_name).or_else(|| named(&all_right));
    let Some(other) = other.filter(|other| other.name != joint.name) else {
        let message = format!("there is no `{other_name}`");
        diagnostics.add(DiagnosticCode::SideMissing, &joint.name, message);
        return;
    };
    // Axes of one arm that are called L and R have nothing to do with sides.
    if hangs_below(joint, other, robot) || hangs_below(other, joint, robot) {
        return;
    }
    let (a, b) = (&joint.limit, &other.limit);
    let near = |x: f64, y: f64| (x - y).abs() < 0.02;
    let same = near(a.lower, b.lower) && near(a.upper, b.upper);
    let opposite = near(a.lower, -b.upper) && near(a.upper, -b.lower);
    if !same && !opposite {
        let message = format!(
            "{} to {}, but `{}` {} to {}: is a sign wrong?",
            a.lower, a.upper, other.name, b.lower, b.upper
        );
        diagnostics.add(DiagnosticCode::SidesDiffer, &joint.name, message);
    }
}

/// Whether one joint is below another in the tree.
fn hangs_below(one: &urdf_rs::Joint, other: &urdf_rs::Joint, robot: &urdf_rs::Robot) -> bool {
    let above = |at: &&urdf_rs::Joint| {
        let link = &at.parent.link;
        robot.joints.iter().find(|joint| joint.child.link == *link)
    };
    let up = std::iter::successors(Some(one), above).skip(1);
    up.take(robot.joints.len()).any(|joint| joint.name == other.name)
}

/// The name of the same joint on the right side.
fn right_of(name: &str) -> Option<String> {
    for (left, right) in [("left", "right"), ("Left", "Right")] {
        if name.contains(left) {
            return Some(name.replacen(left, right, 1));
        }
    }
    // In `FL_l` the last letter counts: the side is in the corner before it.
    let is_side = |rest: &&str| NameWords::of_names(&[rest]).side().is_none();
    match name.strip_prefix("l_") {
        Some(rest) => is_side(&rest).then(|| format!("r_{rest}")),
        None => name.strip_suffix("_l").filter(is_side).map(|rest| format!("{rest}_r")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_letter_behind_a_corner_is_no_side() {
        let right = |name| right_of(name);
        assert_eq!(right("hip_l").as_deref(), Some("hip_r"));
        assert_eq!(right("l_hip").as_deref(), Some("r_hip"));
        assert_eq!((right("FL_l"), right("RR_l"), right("head")), (None, None, None));
    }
}
