//! Reads a URDF and refuses what would panic or mislead further on.
//!
//! `clean` makes the text readable, `urdf-rs` parses it, this module checks,
//! `k` builds the tree. Everything that is refused or repaired is a finding
//! that names joint or link and value; nothing here panics on any text.

mod clean;

use std::collections::{HashMap, HashSet};

use k::nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::RetargetError;
use crate::config::Couple;
use crate::finding::{Code, Findings};

pub(crate) use clean::Rates;

/// A checked URDF and its tree.
pub(crate) struct Description {
    /// What `urdf-rs` read, repaired.
    pub robot: urdf_rs::Robot,
    /// The tree; one node a link, named by the joint above it.
    pub chain: k::Chain<f64>,
    /// Acceleration and jerk limits by joint, where the file gives them.
    pub rates: HashMap<String, Rates>,
}

/// Far enough for any robot; keeps squares finite.
const LARGEST_M: f64 = 1e4;
/// More links than any robot has; keeps hostile files cheap.
const MOST_LINKS: usize = 512;

/// Parses and checks `xml`.
pub(crate) fn read(xml: &str) -> Result<Description, RetargetError> {
    let (description, findings) = read_all(xml);
    match (description, findings.usable()) {
        (_, Err(error)) => Err(error),
        (Some(description), Ok(_)) => Ok(description),
        (None, Ok(_)) => Err(RetargetError::Xml("nothing in it".into())),
    }
}

/// Parses and checks `xml`; all that was found, and the tree if nothing of it
/// was refused.
pub(crate) fn read_all(xml: &str) -> (Option<Description>, Findings) {
    let mut findings = Findings::default();
    let description = parse(xml, &mut findings);
    (description, findings)
}

fn parse(xml: &str, findings: &mut Findings) -> Option<Description> {
    if let Err(error) = check_depth(xml) {
        findings.refuse(Code::Xml, error);
        return None;
    }
    let cleaned = clean::clean(xml, findings)?;
    if findings.refusal.is_some() {
        return None;
    }
    let mut robot = match urdf_rs::read_from_string(&cleaned.xml) {
        Ok(robot) => robot,
        Err(error) => {
            findings.refuse(Code::Xml, RetargetError::Xml(one_line(&error)));
            return None;
        }
    };
    check_tree(&robot, findings);
    for link in &robot.links {
        check_link(link, findings);
    }
    for joint in &mut robot.joints {
        check_joint(joint, findings);
    }
    check_mimics(&mut robot, findings);
    if findings.refusal.is_some() {
        return None;
    }
    let chain = k::Chain::from(&robot);
    Some(Description {
        robot,
        chain,
        rates: cleaned.rates,
    })
}

/// The XML parsers call themselves for each level: a hostile file could
/// otherwise use up the stack.
pub(crate) fn check_depth(xml: &str) -> Result<(), RetargetError> {
    const DEEPEST: usize = 64;
    let mut depth = 0_usize;
    for tag in xml.split('<').skip(1) {
        let tag_text = tag.split('>').next().unwrap_or_default();
        if tag.starts_with('/') {
            depth = depth.saturating_sub(1);
        } else if !tag.starts_with(['!', '?']) && !tag_text.ends_with('/') {
            depth += 1;
        }
        if depth > DEEPEST {
            return Err(RetargetError::Xml(format!(
                "elements are nested more than {DEEPEST} deep"
            )));
        }
    }
    Ok(())
}

fn one_line(error: &impl std::fmt::Display) -> String {
    error
        .to_string()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

fn check_tree(robot: &urdf_rs::Robot, findings: &mut Findings) {
    if robot.links.is_empty() {
        findings.refuse_tree(Code::LinksNone, "there is no link");
    }
    if robot.links.len() > MOST_LINKS {
        let reason = format!("{} links, at most {MOST_LINKS}", robot.links.len());
        findings.refuse_tree(Code::LinksMany, reason);
        return;
    }
    let mut links = HashSet::new();
    for link in &robot.links {
        if !links.insert(link.name.as_str()) {
            let reason = format!("link `{}` is there twice", link.name);
            findings.refuse_tree(Code::LinkTwice, reason);
        }
    }
    let mut joints = HashSet::new();
    let mut above: HashMap<&str, &urdf_rs::Joint> = HashMap::new();
    for joint in &robot.joints {
        if !joints.insert(joint.name.as_str()) {
            let reason = format!("joint `{}` is there twice", joint.name);
            findings.refuse_tree(Code::JointTwice, reason);
        }
        for name in [&joint.parent.link, &joint.child.link] {
            if !links.contains(name.as_str()) {
                findings.refuse_joint(Code::LinkUnknown, &joint.name, format!("no link `{name}`"));
            }
        }
        if let Some(other) = above.insert(joint.child.link.as_str(), joint) {
            let reason = format!(
                "link `{}` has two parents, by joints `{}` and `{}`: cut the loop at one of \
                 them and let its joint follow (mimic, or [[retarget.couple]])",
                joint.child.link, other.name, joint.name
            );
            findings.refuse_tree(Code::ParentsTwo, reason);
        }
    }
    check_roots(robot, &above, findings);
}

fn check_roots(
    robot: &urdf_rs::Robot,
    above: &HashMap<&str, &urdf_rs::Joint>,
    findings: &mut Findings,
) {
    let names = || robot.links.iter().map(|link| link.name.as_str());
    let roots: Vec<&str> = names().filter(|name| !above.contains_key(name)).collect();
    if roots.len() > 1 {
        let reason = format!("several roots: {}", roots.join(", "));
        findings.refuse_tree(Code::RootsMany, reason);
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
            findings.refuse_tree(Code::Loop, format!("link `{link}` hangs in a loop"));
        }
    }
}

fn all_usable(values: &[f64]) -> bool {
    values.iter().all(|v| v.is_finite() && v.abs() <= LARGEST_M)
}

fn check_link(link: &urdf_rs::Link, findings: &mut Findings) {
    let inertial = &link.inertial;
    let mass = inertial.mass.value;
    if !(0.0..=LARGEST_M).contains(&mass) {
        let reason = format!("mass {mass} kg is not usable");
        findings.refuse_link(Code::MassUnusable, &link.name, reason);
    }
    let poses = std::iter::once(("inertial", &inertial.origin))
        .chain(link.visual.iter().map(|visual| ("visual", &visual.origin)))
        .chain(
            link.collision
                .iter()
                .map(|shape| ("collision", &shape.origin)),
        );
    for (what, pose) in poses {
        if !all_usable(&*pose.xyz) || !all_usable(&*pose.rpy) {
            let reason = format!(
                "{what} origin {:?} {:?} is not usable",
                *pose.xyz, *pose.rpy
            );
            findings.refuse_link(Code::NumberUnusable, &link.name, reason);
        }
    }
}

fn check_joint(joint: &mut urdf_rs::Joint, findings: &mut Findings) {
    let name = joint.name.clone();
    let (xyz, rpy) = (*joint.origin.xyz, *joint.origin.rpy);
    if !all_usable(&xyz) || !all_usable(&rpy) {
        let reason = format!("origin {xyz:?} {rpy:?} is not usable");
        findings.refuse_joint(Code::NumberUnusable, &name, reason);
    }
    if !is_driven(joint) {
        return;
    }
    let axis = *joint.axis.xyz;
    let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !length.is_finite() || length < 1e-6 {
        let reason = format!("axis {} {} {} has no direction", axis[0], axis[1], axis[2]);
        findings.refuse_joint(Code::AxisZero, &name, reason);
    }
    let limit = &mut joint.limit;
    for (key, value) in [("lower", limit.lower), ("upper", limit.upper)] {
        if !value.is_finite() {
            let reason = format!("{key} limit {value} is not a finite number");
            findings.refuse_joint(Code::NumberUnusable, &name, reason);
        }
    }
    // `k` asserts this order.
    if limit.lower > limit.upper {
        let said = format!(
            "lower limit {} is above upper limit {}",
            limit.lower, limit.upper
        );
        if limit.upper <= 0.0 && 0.0 <= limit.lower {
            std::mem::swap(&mut limit.lower, &mut limit.upper);
            findings.add(Code::RangeInverted, &name, format!("{said}; exchanged"));
        } else {
            let reason = format!("{said}, and zero is on neither way's inside: is a sign wrong?");
            findings.refuse_joint(Code::RangeUnusable, &name, reason);
        }
    }
}

/// Followers of joints that cannot move become fixed where those leave them;
/// unknown names and circles are refused.
fn check_mimics(robot: &mut urdf_rs::Robot, findings: &mut Findings) {
    while let Some((index, offset)) = follower_of_fixed(robot) {
        let joint = &mut robot.joints[index];
        let message = format!(
            "follows `{}`, which does not move; held at {offset}",
            joint.mimic.as_ref().map_or("", |mimic| &mimic.joint)
        );
        findings.add(Code::MimicOfFixed, &joint.name, message);
        hold(joint, offset);
    }
    for joint in &robot.joints {
        let Some(mimic) = &joint.mimic else {
            continue;
        };
        let (multiplier, offset) = mimic_numbers(mimic);
        if !all_usable(&[multiplier, offset]) {
            let reason = format!("mimic multiplier {multiplier} or offset {offset} is not usable");
            findings.refuse_joint(Code::NumberUnusable, &joint.name, reason);
        }
        if !robot.joints.iter().any(|other| other.name == mimic.joint) {
            let reason = format!("mimics `{}`, which does not exist", mimic.joint);
            findings.refuse_joint(Code::MimicUnknown, &joint.name, reason);
        }
    }
    for joint in robot.joints.iter().filter(|joint| is_driven(joint)) {
        let follows = |at: &urdf_rs::Joint| {
            let followed = &at.mimic.as_ref()?.joint;
            robot.joints.iter().find(|other| other.name == *followed)
        };
        let chain = std::iter::successors(Some(joint), |at| follows(at));
        if chain.take(robot.joints.len() + 2).count() > robot.joints.len() + 1 {
            findings.refuse_joint(Code::MimicCircle, &joint.name, "mimics itself in a circle");
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

/// Multiplier and offset.
fn mimic_numbers(mimic: &urdf_rs::Mimic) -> (f64, f64) {
    (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0))
}

/// Fixes a joint at a position.
fn hold(joint: &mut urdf_rs::Joint, position: f64) {
    let [roll, pitch, yaw] = *joint.origin.rpy;
    let origin = Isometry3::from_parts(
        Translation3::from(Vector3::from(*joint.origin.xyz)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    );
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

/// Lets a joint follow another, as a robot file says.
pub(crate) fn couple(robot: &mut urdf_rs::Robot, couple: &Couple) -> Result<(), RetargetError> {
    let refused = |reason: String| RetargetError::Joint {
        joint: couple.joint.clone(),
        reason,
    };
    for name in [&couple.joint, &couple.follows] {
        let joint = robot.joints.iter().find(|joint| joint.name == *name);
        if !joint.is_some_and(is_driven) {
            return Err(refused(format!("couple: no moving joint `{name}`")));
        }
    }
    if couple.joint == couple.follows {
        return Err(refused("couple: a joint cannot follow itself".into()));
    }
    for joint in robot.joints.iter_mut().filter(|j| j.name == couple.joint) {
        joint.mimic = Some(urdf_rs::Mimic {
            joint: couple.follows.clone(),
            multiplier: Some(couple.multiplier),
            offset: Some(couple.offset_deg.to_radians()),
        });
    }
    Ok(())
}

/// Whether a joint of this kind has one position.
pub(crate) fn is_driven(joint: &urdf_rs::Joint) -> bool {
    use urdf_rs::JointType::*;
    matches!(joint.joint_type, Revolute | Continuous | Prismatic)
}
