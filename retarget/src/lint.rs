//! Looks a robot description over before a robot is built on it.
//!
//! Refusals and repairs come from reading (`urdf`); what is usable but
//! suspicious is found here. See [`Code`] for all there is.

use std::f64::consts::PI;

use k::nalgebra::{UnitQuaternion, Vector3};
use servodance_types::JointLimits;

use crate::RobotModel;
use crate::finding::{Code, Finding, Findings};
use crate::guess::{Axes, anatomy, zero};
use crate::mjcf::{is_mjcf, urdf_from_mjcf};
use crate::urdf::{self, is_driven};

/// Faster than servos turn, rad/s: a placeholder.
const PLACEHOLDER_RAD_S: f64 = 50.0;
/// More than joints give, N m: a placeholder.
const PLACEHOLDER_NM: f64 = 1000.0;
/// Ranges wider than this are suspicious for a servo, radians.
const WIDE_RAD: f64 = 315.0 * PI / 180.0;
/// A link heavier than this share of the robot, when there are many.
const HEAVY_SHARE: f64 = 0.8;
/// Heavier than lead, kg/m^3.
const DENSEST: f64 = 12_000.0;
/// Cosine of the tilt from which an axis counts as tilted, about 8 degrees.
const STRAIGHT: f64 = 0.99;

/// Everything found in a URDF or an MJCF model: refusals, repairs, joints first.
pub fn lint(text: &str) -> Vec<Finding> {
    if !is_mjcf(text) {
        return lint_urdf(text);
    }
    match urdf_from_mjcf(text) {
        Ok((urdf_xml, mut findings)) => {
            findings.extend(lint_urdf(&urdf_xml));
            findings
        }
        Err(error) => vec![Finding::new(Code::Mjcf, "robot", error.to_string())],
    }
}

fn lint_urdf(urdf_xml: &str) -> Vec<Finding> {
    let (description, mut findings) = urdf::read_all(urdf_xml);
    let Some(description) = description else {
        return findings.list;
    };
    let robot = &description.robot;
    if !robot.joints.iter().any(is_driven) {
        findings.refuse_tree(Code::JointsNone, "no joint moves");
        return findings.list;
    }
    for joint in robot.joints.iter().filter(|joint| is_driven(joint)) {
        lint_kind(joint, &mut findings);
        lint_limit(joint, &mut findings);
        lint_mirror(joint, robot, &mut findings);
    }
    lint_body(robot, urdf_xml, &mut findings);
    lint_masses(robot, &mut findings);
    findings.list
}

fn lint_kind(joint: &urdf_rs::Joint, findings: &mut Findings) {
    let name = &joint.name;
    match joint.joint_type {
        urdf_rs::JointType::Continuous => {
            let message = "turns without end; the servo map's limits hold, counted through";
            findings.add(Code::JointContinuous, name, message);
        }
        urdf_rs::JointType::Prismatic => {
            let message = "slides; held at rest unless the servo map has it";
            findings.add(Code::JointPrismatic, name, message);
        }
        _ => {}
    }
    if let Some(mimic) = &joint.mimic {
        let message = format!(
            "follows `{}`: {} times its position plus {}",
            mimic.joint,
            mimic.multiplier.unwrap_or(1.0),
            mimic.offset.unwrap_or(0.0)
        );
        findings.add(Code::JointMimic, name, message);
    }
}

fn lint_limit(joint: &urdf_rs::Joint, findings: &mut Findings) {
    let limit = &joint.limit;
    let mut say = |code, message: String| findings.add(code, &joint.name, message);
    if joint.mimic.is_none() {
        if limit.velocity.is_nan() || limit.velocity <= 0.0 {
            let message = format!(
                "velocity limit {} means unset; the servo map's is used",
                limit.velocity
            );
            say(Code::VelocityUnset, message);
        } else if limit.velocity > PLACEHOLDER_RAD_S {
            let message = format!(
                "velocity limit {} rad/s is a placeholder; the servo map's is used",
                limit.velocity
            );
            say(Code::VelocityPlaceholder, message);
        }
        if limit.effort.is_nan() || limit.effort <= 0.0 {
            let message = format!("effort limit {} means unset", limit.effort);
            say(Code::EffortUnset, message);
        } else if limit.effort >= PLACEHOLDER_NM {
            let message = format!("effort limit {} is a placeholder", limit.effort);
            say(Code::EffortPlaceholder, message);
        }
    }
    if joint.joint_type == urdf_rs::JointType::Continuous {
        return;
    }
    let (lower, upper) = (limit.lower, limit.upper);
    if lower == upper {
        let message = format!("both position limits are {lower}; the servo map's are used");
        say(Code::RangeUnset, message);
    } else if !(lower..=upper).contains(&0.0) {
        let message =
            format!("zero is outside {lower} to {upper}; the nearest limit stands for it");
        say(Code::ZeroOutside, message);
    }
    if joint.joint_type != urdf_rs::JointType::Revolute {
        return;
    }
    let share = upper / PI;
    let round = [0.9, 1.0, 2.0]
        .iter()
        .any(|known| (share - known).abs() < 2e-3);
    if (round && (lower + upper).abs() < 0.01) || upper - lower > 20.0 {
        let message = format!("{lower} to {upper} ({share:.2} pi both ways) is a placeholder");
        say(Code::RangePlaceholder, message);
    } else if upper - lower > WIDE_RAD {
        let degrees = (upper - lower).to_degrees();
        let message = format!("range of {degrees:.0} degrees: a servo may not turn so far");
        say(Code::RangeWide, message);
    }
}

/// What only the whole body shows: tilted axes, parts, forward, tips.
fn lint_body(robot: &urdf_rs::Robot, urdf_xml: &str, findings: &mut Findings) {
    let drives = |joint: &&urdf_rs::Joint| is_driven(joint) && joint.mimic.is_none();
    let driven = robot.joints.iter().filter(drives);
    let names: Vec<&str> = driven.map(|joint| joint.name.as_str()).collect();
    let Ok(model) = RobotModel::new(urdf_xml, &names) else {
        return;
    };
    let positions = zero(&model, robot);
    lint_axes(robot, &model, &positions, findings);
    let body = anatomy(&model, &positions);
    let limbs = || body.arms.iter().chain(&body.legs);
    if body.head.is_none() && !limbs().any(|limb| limb.is_there()) {
        let message = "no arm, leg or head was found, by names or by shape";
        findings.add(Code::PartsNone, &robot.name, message);
    }
    let axes = &body.axes;
    let (forward, up) = (Axes::name(&axes.forward), Axes::name(&axes.up));
    if !axes.seen {
        let message = "no pair of limbs shows it: x forward, z up are assumed";
        findings.add(Code::ForwardAssumed, &robot.name, message);
    } else if !axes.is_usual() {
        let message = format!("forward is {forward} and up is {up} of the root link");
        findings.add(Code::ForwardUnusual, &robot.name, message);
    }
    for tip in &body.tips {
        let [x, y, z] = tip.at_m;
        let message = format!("no link ends the limb; its end is taken at {x:.3} {y:.3} {z:.3} m");
        findings.add(Code::TipMissing, &tip.link, message);
    }
}

/// Axes that lie along none of the root link's axes at zero.
fn lint_axes(
    robot: &urdf_rs::Robot,
    model: &RobotModel,
    positions: &[f64],
    findings: &mut Findings,
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
            findings.add(Code::AxisTilted, &joint.name, message);
        }
    }
}

/// Left and right should allow the same, counted either way round.
fn lint_mirror(joint: &urdf_rs::Joint, robot: &urdf_rs::Robot, findings: &mut Findings) {
    let Some(other_name) = right_of(&joint.name) else {
        return;
    };
    let Some(other) = robot.joints.iter().find(|other| other.name == other_name) else {
        let message = format!("there is no `{other_name}`");
        findings.add(Code::SideMissing, &joint.name, message);
        return;
    };
    let (a, b) = (&joint.limit, &other.limit);
    let near = |x: f64, y: f64| (x - y).abs() < 0.02;
    let same = near(a.lower, b.lower) && near(a.upper, b.upper);
    let opposite = near(a.lower, -b.upper) && near(a.upper, -b.lower);
    if !same && !opposite {
        let message = format!(
            "{} to {}, but `{other_name}` {} to {}: is a sign wrong?",
            a.lower, a.upper, b.lower, b.upper
        );
        findings.add(Code::SidesDiffer, &joint.name, message);
    }
}

/// The name of the same joint on the right side.
fn right_of(name: &str) -> Option<String> {
    for (left, right) in [("left", "right"), ("Left", "Right")] {
        if name.contains(left) {
            return Some(name.replacen(left, right, 1));
        }
    }
    match name.strip_prefix("l_") {
        Some(rest) => Some(format!("r_{rest}")),
        None => name.strip_suffix("_l").map(|rest| format!("{rest}_r")),
    }
}

fn lint_masses(robot: &urdf_rs::Robot, findings: &mut Findings) {
    let total: f64 = robot.links.iter().map(|l| l.inertial.mass.value).sum();
    if total <= 0.0 {
        let message = "no link weighs anything: balance cannot be kept";
        findings.add(Code::MassMissing, &robot.name, message);
        return;
    }
    for link in &robot.links {
        let mass = link.inertial.mass.value;
        let shapes = link.collision.iter().map(|collision| &collision.geometry);
        let visuals = link.visual.iter().map(|visual| &visual.geometry);
        let volume: f64 = shapes.chain(visuals).map(volume_m3).fold(0.0, f64::max);
        let density = mass / volume;
        if robot.links.len() > 4 && mass > HEAVY_SHARE * total {
            let message = format!("{mass} kg of {total} kg in all");
            findings.add(Code::MassAbsurd, &link.name, message);
        } else if volume > 0.0 && mass > 0.01 && density > DENSEST {
            let message = format!("{mass} kg in {:.1} cm3: heavier than lead", volume * 1e6);
            findings.add(Code::MassAbsurd, &link.name, message);
        }
        lint_inertia(link, findings);
    }
}

/// Volume of a simple shape; 0 for meshes and shapes without size.
fn volume_m3(geometry: &urdf_rs::Geometry) -> f64 {
    use urdf_rs::Geometry::*;
    let volume = match geometry {
        Box { size } => size.iter().product(),
        Cylinder { radius, length } | Capsule { radius, length } => PI * radius * radius * length,
        Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
        Mesh { .. } => 0.0,
    };
    if volume.is_finite() { volume } else { 0.0 }
}

/// No two moments of a body are less than the third together.
fn lint_inertia(link: &urdf_rs::Link, findings: &mut Findings) {
    let inertia = &link.inertial.inertia;
    let moments = [inertia.ixx, inertia.iyy, inertia.izz];
    let sum: f64 = moments.iter().sum();
    let bad = moments
        .iter()
        .any(|&moment| !moment.is_finite() || moment < 0.0 || 2.0 * moment > sum * 1.02 + 1e-9);
    if bad {
        let message = format!(
            "moments {} {} {} belong to no body",
            moments[0], moments[1], moments[2]
        );
        findings.add(Code::InertiaAbsurd, &link.name, message);
    }
}

/// Whether a servo map's limits agree with the description's: a wider or
/// faster map is a finding, as is a joint that it leaves out.
pub fn lint_limits(urdf_xml: &str, joints: &[(String, JointLimits)]) -> Vec<Finding> {
    let (Some(description), _) = urdf::read_all(urdf_xml) else {
        return Vec::new();
    };
    let mut findings = Findings::default();
    let drives = |joint: &&urdf_rs::Joint| is_driven(joint) && joint.mimic.is_none();
    for joint in description.robot.joints.iter().filter(drives) {
        let name = &joint.name;
        let Some((_, limits)) = joints.iter().find(|(mapped, _)| mapped == name) else {
            let message = "no [[joint]] of this name; held at rest";
            findings.add(Code::JointUnmapped, name, message);
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
            findings.add(Code::MapWider, name, message);
        }
        let given = limit.velocity > 0.0 && limit.velocity <= PLACEHOLDER_RAD_S;
        if given && limits.velocity_rad_s > limit.velocity * 1.01 {
            let message = format!(
                "the servo map allows {:.2} rad/s, the description {:.2}",
                limits.velocity_rad_s, limit.velocity
            );
            findings.add(Code::MapFaster, name, message);
        }
    }
    findings.list
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
        let op3 = include_str!("../../configs/op3.urdf");
        assert_eq!(lint(op3), []);
        let limits = r#"lower="-0.31416" upper="2.19911""#;
        assert_eq!(op3.matches(limits).count(), 1);
        let wrong = op3.replace(limits, r#"lower="-1.0" upper="2.19911""#);
        let findings = lint(&wrong);
        assert_eq!(findings.len(), 1);
        assert_eq!(
            (findings[0].code, findings[0].subject.as_str()),
            (Code::SidesDiffer, "l_knee")
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
        let op3 = include_str!("../../configs/op3.urdf");
        let has_wider = |upper| {
            let map = [("l_el".to_string(), limits(-1.0, upper))];
            let found = lint_limits(op3, &map);
            found.iter().any(|f| f.code == Code::MapWider)
        };
        assert!(!has_wider(1.0) && has_wider(2.0));
    }
}
