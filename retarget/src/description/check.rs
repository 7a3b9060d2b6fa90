//! What would panic or mislead further on is refused or repaired in memory.
//!
//! Each refusal and repair is a diagnostic that names joint or link and value.

use std::collections::{HashMap, HashSet};

use k::nalgebra::{Translation3, Unit, UnitQuaternion, Vector3};
use k::urdf::isometry_from;

use crate::description::diagnostic::{DiagnosticCode, Diagnostics};
use crate::description::joints::{is_driven, mimic_numbers};

const LARGEST_M: f64 = 1e4;
/// More links than any robot has; keeps hostile files cheap.
pub(super) const MOST_LINKS: usize = 512;

/// Checks tree, links, joints and mimics; repairs what has one reading.
pub(super) fn check(robot: &mut urdf_rs::Robot, diagnostics: &mut Diagnostics) {
    check_tree(robot, diagnostics);
    for link in &robot.links {
        check_link(link, diagnostics);
    }
    hold_ends_without_axis(robot, diagnostics);
    for joint in &mut robot.joints {
        check_joint(joint, diagnostics);
    }
    check_mimics(robot, diagnostics);
}

fn check_tree(robot: &urdf_rs::Robot, diagnostics: &mut Diagnostics) {
    if robot.links.is_empty() {
        diagnostics.refuse_tree(DiagnosticCode::LinksNone, "there is no link");
    }
    if robot.links.len() > MOST_LINKS {
        let reason = format!("{} links, at most {MOST_LINKS}", robot.links.len());
        diagnostics.refuse_tree(DiagnosticCode::LinksMany, reason);
        return;
    }
    let mut links = HashSet::new();
    for link in &robot.links {
        if !links.insert(link.name.as_str()) {
            let reason = format!("link `{}` is there twice", link.name);
            diagnostics.refuse_tree(DiagnosticCode::LinkTwice, reason);
        }
    }
    let mut joints = HashSet::new();
    let mut above: HashMap<&str, &urdf_rs::Joint> = HashMap::new();
    for joint in &robot.joints {
        if !joints.insert(joint.name.as_str()) {
            let reason = format!("joint `{}` is there twice", joint.name);
            diagnostics.refuse_tree(DiagnosticCode::JointTwice, reason);
        }
        for name in [&joint.parent.link, &joint.child.link] {
            if !links.contains(name.as_str()) {
                diagnostics.refuse_joint(
                    DiagnosticCode::LinkUnknown,
                    &joint.name,
                    format!("no link `{name}`"),
                );
            }
        }
        if let Some(other) = above.insert(joint.child.link.as_str(), joint) {
            let reason = format!(
                "link `{}` has two parents, by joints `{}` and `{}`: cut the loop at one of \
                 them and let its joint follow (mimic, or [[retarget.couple]])",
                joint.child.link, other.name, joint.name
            );
            diagnostics.refuse_tree(DiagnosticCode::ParentsTwo, reason);
        }
    }
    check_roots(robot, &above, diagnostics);
}

fn check_roots(
    robot: &urdf_rs::Robot,
    above: &HashMap<&str, &urdf_rs::Joint>,
    diagnostics: &mut Diagnostics,
) {
    let names = || robot.links.iter().map(|link| link.name.as_str());
    let roots: Vec<&str> = names().filter(|name| !above.contains_key(name)).collect();
    if roots.len() > 1 {
        let reason = format!("several roots: {}", roots.join(", "));
        diagnostics.refuse_tree(DiagnosticCode::RootsMany, reason);
    }
    // One root and one parent a link leave only loops apart from the tree.
    for link in names() {
        let mut at = link;
        for _ in 0..=robot.links.len() {
            match above.get(at) {
                Some(joint) => at = joint.parent.link.as_str(),
                None => break,
            }
        }
        if above.contains_key(at) {
            diagnostics.refuse_tree(DiagnosticCode::Loop, format!("link `{link}` hangs in a loop"));
        }
    }
}

fn all_usable(values: &[f64]) -> bool {
    values.iter().all(|v| v.is_finite() && v.abs() <= LARGEST_M)
}

fn check_link(link: &urdf_rs::Link, diagnostics: &mut Diagnostics) {
    let inertial = &link.inertial;
    let mass = inertial.mass.value;
    if !(0.0..=LARGEST_M).contains(&mass) {
        let reason = format!("mass {mass} kg is not usable");
        diagnostics.refuse_link(DiagnosticCode::MassUnusable, &link.name, reason);
    }
    let poses = std::iter::once(("inertial", &inertial.origin))
        .chain(link.visual.iter().map(|visual| ("visual", &visual.origin)))
        .chain(link.collision.iter().map(|shape| ("collision", &shape.origin)));
    for (what, pose) in poses {
        if !all_usable(&*pose.xyz) || !all_usable(&*pose.rpy) {
            let reason = format!("{what} origin {:?} {:?} is not usable", *pose.xyz, *pose.rpy);
            diagnostics.refuse_link(DiagnosticCode::NumberUnusable, &link.name, reason);
        }
    }
}

/// A camera's or a sensor's joint whose axis has no direction carries nothing that moves: the
/// robot can do without.
fn hold_ends_without_axis(robot: &mut urdf_rs::Robot, diagnostics: &mut Diagnostics) {
    let moving = robot.joints.iter().filter(|joint| is_driven(joint));
    let carriers: HashSet<String> = moving.map(|joint| joint.parent.link.clone()).collect();
    let carried = robot.joints.iter().map(|joint| (&joint.parent.link, &joint.child.link));
    let below: Vec<(String, String)> =
        carried.map(|(up, down)| (up.clone(), down.clone())).collect();
    let carries = |link: &str| {
        let mut links = vec![link];
        let mut at = 0;
        while let Some(&link) = links.get(at) {
            if carriers.contains(link) || links.len() > MOST_LINKS {
                return true;
            }
            links.extend(below.iter().filter(|(up, _)| up == link).map(|(_, down)| down.as_str()));
            at += 1;
        }
        false
    };
    let none = |joint: &urdf_rs::Joint| *joint.axis.xyz == [0.0; 3];
    if robot.joints.iter().filter(|joint| is_driven(joint)).all(none) {
        return;
    }
    for joint in robot.joints.iter_mut().filter(|joint| is_driven(joint)) {
        if none(joint) && !carries(&joint.child.link) {
            let message = "axis 0 0 0 has no direction, and nothing that moves hangs on it; held";
            diagnostics.add(DiagnosticCode::AxisZeroEnd, &joint.name, message);
            hold(joint, 0.0);
        }
    }
}

fn check_joint(joint: &mut urdf_rs::Joint, diagnostics: &mut Diagnostics) {
    let name = joint.name.clone();
    let (xyz, rpy) = (*joint.origin.xyz, *joint.origin.rpy);
    if !all_usable(&xyz) || !all_usable(&rpy) {
        let reason = format!("origin {xyz:?} {rpy:?} is not usable");
        diagnostics.refuse_joint(DiagnosticCode::NumberUnusable, &name, reason);
    }
    if !is_driven(joint) {
        return;
    }
    let axis = *joint.axis.xyz;
    let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !length.is_finite() || length < 1e-6 {
        let reason = format!("axis {} {} {} has no direction", axis[0], axis[1], axis[2]);
        diagnostics.refuse_joint(DiagnosticCode::AxisZero, &name, reason);
    }
    let limit = &mut joint.limit;
    for (key, value) in [("lower", limit.lower), ("upper", limit.upper)] {
        if !value.is_finite() {
            let reason = format!("{key} limit {value} is not a finite number");
            diagnostics.refuse_joint(DiagnosticCode::NumberUnusable, &name, reason);
        }
    }
    // `k` asserts this order.
    if limit.lower > limit.upper {
        let said = format!("lower limit {} is above upper limit {}", limit.lower, limit.upper);
        if limit.upper <= 0.0 && 0.0 <= limit.lower {
            std::mem::swap(&mut limit.lower, &mut limit.upper);
            diagnostics.add(DiagnosticCode::RangeInverted, &name, format!("{said}; exchanged"));
        } else {
            let reason = format!("{said}, and zero is on neither way's inside: is a sign wrong?");
            diagnostics.refuse_joint(DiagnosticCode::RangeUnusable, &name, reason);
        }
    }
}

/// Followers of joints that cannot move become fixed where those leave them;
/// unknown names and circles are refused.
fn check_mimics(robot: &mut urdf_rs::Robot, diagnostics: &mut Diagnostics) {
    while let Some((index, offset)) = follower_of_fixed(robot) {
        let joint = &mut robot.joints[index];
        let message = format!(
            "follows `{}`, which does not move; held at {offset}",
            joint.mimic.as_ref().map_or("", |mimic| &mimic.joint)
        );
        diagnostics.add(DiagnosticCode::MimicOfFixed, &joint.name, message);
        hold(joint, offset);
    }
    for joint in &robot.joints {
        let Some(mimic) = &joint.mimic else {
            continue;
        };
        let (multiplier, offset) = mimic_numbers(mimic);
        if !all_usable(&[multiplier, offset]) {
            let reason = format!("mimic multiplier {multiplier} or offset {offset} is not usable");
            diagnostics.refuse_joint(DiagnosticCode::NumberUnusable, &joint.name, reason);
        }
        if !robot.joints.iter().any(|other| other.name == mimic.joint) {
            let reason = format!("mimics `{}`, which does not exist", mimic.joint);
            diagnostics.refuse_joint(DiagnosticCode::MimicUnknown, &joint.name, reason);
        }
    }
    for joint in robot.joints.iter().filter(|joint| is_driven(joint)) {
        let follows = |at: &urdf_rs::Joint| {
            let followed = &at.mimic.as_ref()?.joint;
            robot.joints.iter().find(|other| other.name == *followed)
        };
        let chain = std::iter::successors(Some(joint), |at| follows(at));
        if chain.take(robot.joints.len() + 2).count() > robot.joints.len() + 1 {
            diagnostics.refuse_joint(
                DiagnosticCode::MimicCircle,
                &joint.name,
                "mimics itself in a circle",
            );
        }
    }
}

/// A joint that follows one that cannot move, and where that leaves it.
fn follower_of_fixed(robot: &urdf_rs::Robot) -> Option<(usize, f64)> {
    robot.joints.iter().enumerate().find_map(|(index, joint)| {
        let mimic = joint.mimic.as_ref()?;
        let followed = robot.joints.iter().find(|j| j.name == mimic.joint)?;
        let (_, offset) = mimic_numbers(mimic);
        (!is_driven(followed) && all_usable(&[offset])).then_some((index, offset))
    })
}

fn hold(joint: &mut urdf_rs::Joint, position: f64) {
    let origin = isometry_from::<f64>(&joint.origin);
    if let Some(axis) = Unit::try_new(Vector3::from(*joint.axis.xyz), 1e-6) {
        let moved = match joint.joint_type {
            urdf_rs::JointType::Prismatic => {
                origin * Translation3::from(axis.into_inner() * position)
            }
            _ => origin * UnitQuaternion::from_axis_angle(&axis, position),
        };
        let (roll, pitch, yaw) = moved.rotation.euler_angles();
        *joint.origin.xyz = moved.translation.vector.into();
        *joint.origin.rpy = [roll, pitch, yaw];
    }
    joint.joint_type = urdf_rs::JointType::Fixed;
    joint.mimic = None;
}
