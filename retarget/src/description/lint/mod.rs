//! Looks a robot description over before a robot is built on it.
//!
//! Refusals and repairs come from reading (`urdf`); what is usable but
//! suspicious is found here. See [`DiagnosticCode`] for all there is.

mod joints;
mod links;

use k::nalgebra::{UnitQuaternion, Vector3};
use servodance_types::JointLimits;

use crate::description::diagnostic::{Diagnostic, DiagnosticCode, Diagnostics};
use crate::description::guess::{BodyAxes, anatomy, no_meshes};
use crate::description::{self, Description, is_driven};
use crate::kinematics::RobotModel;
use joints::PLACEHOLDER_RAD_S;

/// Joints of a robot lie no farther apart, and no nearer to each other, metres.
const LARGEST_M: f64 = 10.0;
const SMALLEST_M: f64 = 0.02;
/// Cosine of the tilt from which an axis counts as tilted, about 8 degrees.
const STRAIGHT: f64 = 0.99;

/// Everything found in a URDF or an MJCF model: refusals, repairs, joints first.
pub fn lint(text: &str) -> Vec<Diagnostic> {
    let (description, mut diagnostics) = description::read_any(text);
    let Some(description) = description else {
        return diagnostics.list;
    };
    let robot = &description.robot;
    if !robot.joints.iter().any(is_driven) {
        diagnostics.add(DiagnosticCode::JointsNone, &robot.name, "no joint moves");
        return diagnostics.list;
    }
    for joint in robot.joints.iter().filter(|joint| is_driven(joint)) {
        joints::lint_joint(joint, robot, &mut diagnostics);
    }
    lint_body(&description, &mut diagnostics);
    links::lint_masses(robot, &mut diagnostics);
    diagnostics.list
}

/// What only the whole body shows: tilted axes, parts, forward, tips.
fn lint_body(description: &Description, diagnostics: &mut Diagnostics) {
    let robot = &description.robot;
    let names: Vec<&str> = description.drives().map(|j| j.name.as_str()).collect();
    let Ok(model) = RobotModel::of_description(description, &names) else {
        return;
    };
    let positions = description.zero_positions(model.joint_names());
    lint_axes(robot, &model, &positions, diagnostics);
    lint_size(robot, &model, &positions, diagnostics);
    let body = anatomy(&model, &positions, None, &no_meshes);
    if body.kind.is_none() {
        let message = "no arm, leg, head or driven wheels were found, by names or by shape: nothing of it can \
                       show a dance; if one is there, name it in a robot file ([retarget.body])";
        diagnostics.add(DiagnosticCode::PartsNone, &robot.name, message);
    }
    let axes = &body.axes;
    let (forward, up) = (BodyAxes::name(&axes.forward), BodyAxes::name(&axes.up));
    if !axes.seen {
        let message = "no pair of limbs shows it: x forward, z up are assumed";
        diagnostics.add(DiagnosticCode::ForwardAssumed, &robot.name, message);
    } else if !axes.is_usual() {
        let message = format!("forward is {forward} and up is {up} of the root link");
        diagnostics.add(DiagnosticCode::ForwardUnusual, &robot.name, message);
    }
    for tip in &body.tips {
        let [x, y, z] = tip.at_m;
        let message = format!("no link ends the limb; its end is taken at {x:.3} {y:.3} {z:.3} m");
        diagnostics.add(DiagnosticCode::TipMissing, &tip.link, message);
    }
}

/// A size that speaks for lengths in millimetres, or in anything else than metres.
fn lint_size(
    robot: &urdf_rs::Robot,
    model: &RobotModel,
    positions: &[f64],
    diagnostics: &mut Diagnostics,
) {
    let places: Vec<_> = model.link_poses(positions).iter().map(|p| p.translation.vector).collect();
    let span = |axis: usize| {
        let along = places.iter().map(|place| place[axis]);
        along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
    };
    let size_m = (0..3).map(span).fold(0.0, f64::max);
    let guess = match size_m {
        size if size > LARGEST_M => "in millimetres?",
        size if size > 0.0 && size < SMALLEST_M => "are its lengths in metres?",
        _ => return,
    };
    let message = format!("its joints lie {size_m:.3} m apart: {guess}");
    diagnostics.add(DiagnosticCode::SizeAbsurd, &robot.name, message);
}

/// Axes that lie along none of the root link's axes at zero.
fn lint_axes(
    robot: &urdf_rs::Robot,
    model: &RobotModel,
    positions: &[f64],
    diagnostics: &mut Diagnostics,
) {
    let poses = model.link_poses(positions);
    for joint in robot.joints.iter().filter(|joint| is_driven(joint)) {
        let Some(link) = model.link(&joint.child.link) else {
            continue;
        };
        let rotation: UnitQuaternion<f64> = poses[link].rotation;
        let axis = rotation * Vector3::from(*joint.axis.xyz).normalize();
        if axis.amax() < STRAIGHT {
            let tilt = axis.amax().clamp(-1.0, 1.0).acos().to_degrees();
            let message = format!(
                "axis {:.2} {:.2} {:.2} in the root's frame: tilted by {tilt:.0} degrees",
                axis.x, axis.y, axis.z
            );
            diagnostics.add(DiagnosticCode::AxisTilted, &joint.name, message);
        }
    }
}

/// Whether a servo map's limits agree with the description's: a wider or
/// faster map is a finding, as is a joint that it leaves out.
pub fn lint_limits(urdf_xml: &str, joints: &[(String, JointLimits)]) -> Vec<Diagnostic> {
    let Ok(description) = Description::from_urdf(urdf_xml) else {
        return Vec::new();
    };
    let mut diagnostics = Diagnostics::default();
    for joint in description.drives() {
        let name = &joint.name;
        let Some((_, limits)) = joints.iter().find(|(mapped, _)| mapped == name) else {
            let message = "no [[joint]] of this name; held at rest";
            diagnostics.add(DiagnosticCode::JointUnmapped, name, message);
            continue;
        };
        let limit = &joint.limit;
        let known = limit.lower < limit.upper;
        let wider = limits.lower_rad < limit.lower - 1e-3 || limits.upper_rad > limit.upper + 1e-3;
        let turns = joint.joint_type != urdf_rs::JointType::Continuous;
        if known && turns && wider {
            let message = format!(
                "the servo map allows {:.3} to {:.3} rad, the description {:.3} to {:.3}",
                limits.lower_rad, limits.upper_rad, limit.lower, limit.upper
            );
            diagnostics.add(DiagnosticCode::MapWider, name, message);
        }
        let given = limit.velocity > 0.0 && limit.velocity <= PLACEHOLDER_RAD_S;
        if given && limits.velocity_rad_s > limit.velocity * 1.01 {
            let message = format!(
                "the servo map allows {:.2} rad/s, the description {:.2}",
                limits.velocity_rad_s, limit.velocity
            );
            diagnostics.add(DiagnosticCode::MapFaster, name, message);
        }
    }
    diagnostics.list
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(joint: &str) -> Vec<&'static str> {
        let urdf = format!(
            r#"<robot name="r"><link name="a"><inertial><mass value="1"/>
            <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
            <link name="b"/><joint name="turn" type="revolute"><parent link="a"/>
            <child link="b"/><axis xyz="0 0 1"/>{joint}</joint></robot>"#
        );
        let found = lint(&urdf);
        let of_joint = found.iter().filter(|f| f.subject == "turn");
        of_joint.map(|f| f.code.as_str()).collect()
    }

    #[test]
    fn suspicious_limits_have_codes() {
        let limit = |lower: &str, upper: &str, velocity: &str| {
            format!(r#"<limit lower="{lower}" upper="{upper}" effort="1" velocity="{velocity}"/>"#)
        };
        assert!(codes(&limit("-1", "1", "3")).is_empty());
        assert_eq!(codes(&limit("-1", "1", "0")), ["velocity-unset"]);
        assert_eq!(codes(&limit("-1", "1", "100")), ["velocity-placeholder"]);
        assert_eq!(codes(&limit("0", "0", "3")), ["range-unset"]);
        assert_eq!(codes(&limit("0.5", "1", "3")), ["zero-outside"]);
        assert_eq!(codes(&limit("-3", "3", "3")), ["range-wide"]);
    }

    #[test]
    fn a_knee_that_bends_the_wrong_way_is_found() {
        let op3 = include_str!("../../../../configs/op3.urdf");
        assert_eq!(lint(op3), []);
        let limits = r#"lower="-0.31416" upper="2.19911""#;
        assert_eq!(op3.matches(limits).count(), 1);
        let wrong = op3.replace(limits, r#"lower="-1.0" upper="2.19911""#);
        let diagnostics = lint(&wrong);
        assert_eq!(diagnostics.len(), 1);
        assert_eq!(
            (diagnostics[0].code, diagnostics[0].subject.as_str()),
            (DiagnosticCode::SidesDiffer, "l_knee")
        );
    }

    #[test]
    fn built_in_maps_stay_inside_their_descriptions() {
        let limits = |lower_rad, upper_rad| JointLimits {
            lower_rad,
            upper_rad,
            velocity_rad_s: 1.0,
            acceleration_rad_s2: 1.0,
        };
        let op3 = include_str!("../../../../configs/op3.urdf");
        let has_wider = |upper| {
            let map = [("l_el".to_string(), limits(-1.0, upper))];
            let found = lint_limits(op3, &map);
            found.iter().any(|f| f.code == DiagnosticCode::MapWider)
        };
        assert!(!has_wider(1.0) && has_wider(2.0));
    }
}
