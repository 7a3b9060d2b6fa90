//! Reads a URDF and refuses what would panic or mislead further on.
//!
//! `urdf-rs` parses, this module checks, `k` builds the tree. Numbers that are
//! not finite, inverted limits, zero-length axes, joints without links, loops,
//! two roots and broken mimics are named; nothing here panics on any text.

use std::collections::{HashMap, HashSet};

use crate::RetargetError;

/// A checked URDF and its tree.
pub(crate) struct Description {
    /// What `urdf-rs` read.
    pub robot: urdf_rs::Robot,
    /// The tree; one node a link, named by the joint above it.
    pub chain: k::Chain<f64>,
}

/// Far enough for any robot; keeps squares finite.
const LARGEST_M: f64 = 1e4;
/// More links than any robot has; keeps hostile files cheap.
const MOST_LINKS: usize = 512;

/// Parses and checks `xml`.
pub(crate) fn read(xml: &str) -> Result<Description, RetargetError> {
    if xml.contains("<xacro:") || xml.contains("${") {
        return Err(RetargetError::Xacro);
    }
    check_depth(xml)?;
    let mut robot =
        urdf_rs::read_from_string(xml).map_err(|error| RetargetError::Xml(one_line(&error)))?;
    // A mimic of a joint that cannot move says nothing, and `k` would follow it.
    for joint in &mut robot.joints {
        if !is_driven(joint) {
            joint.mimic = None;
        }
    }
    check_tree(&robot)?;
    for link in &robot.links {
        check_link(link)?;
    }
    for joint in &robot.joints {
        check_joint(joint, &robot)?;
    }
    let chain = k::Chain::from(&robot);
    Ok(Description { robot, chain })
}

/// The XML parsers call themselves for each level: a hostile file could
/// otherwise use up the stack.
fn check_depth(xml: &str) -> Result<(), RetargetError> {
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

fn joint_error(joint: &urdf_rs::Joint, reason: impl Into<String>) -> RetargetError {
    RetargetError::Joint {
        joint: joint.name.clone(),
        reason: reason.into(),
    }
}

fn check_tree(robot: &urdf_rs::Robot) -> Result<(), RetargetError> {
    let tree = |reason: String| Err(RetargetError::Tree(reason));
    if robot.links.is_empty() {
        return tree("there is no link".into());
    }
    if robot.links.len() > MOST_LINKS {
        return tree(format!("{} links, at most {MOST_LINKS}", robot.links.len()));
    }
    let mut links = HashSet::new();
    for link in &robot.links {
        if !links.insert(link.name.as_str()) {
            return tree(format!("link `{}` is there twice", link.name));
        }
    }
    let mut joints = HashSet::new();
    let mut parent_of = HashMap::new();
    for joint in &robot.joints {
        if !joints.insert(joint.name.as_str()) {
            return tree(format!("joint `{}` is there twice", joint.name));
        }
        for name in [&joint.parent.link, &joint.child.link] {
            if !links.contains(name.as_str()) {
                return Err(joint_error(joint, format!("no link `{name}`")));
            }
        }
        let known = parent_of.insert(joint.child.link.as_str(), joint.parent.link.as_str());
        if known.is_some() {
            return tree(format!("link `{}` has two parents", joint.child.link));
        }
    }
    let roots: Vec<&str> = robot
        .links
        .iter()
        .map(|link| link.name.as_str())
        .filter(|name| !parent_of.contains_key(name))
        .collect();
    if roots.len() > 1 {
        return tree(format!("several roots: {}", roots.join(", ")));
    }
    // One root and one parent a link leave only loops apart from the tree.
    for link in &robot.links {
        let mut at = link.name.as_str();
        for _ in 0..=robot.links.len() {
            match parent_of.get(at) {
                Some(parent) => at = parent,
                None => break,
            }
        }
        if parent_of.contains_key(at) {
            return tree(format!("link `{}` hangs in a loop", link.name));
        }
    }
    Ok(())
}

fn all_usable(values: &[f64]) -> bool {
    values.iter().all(|v| v.is_finite() && v.abs() <= LARGEST_M)
}

fn check_link(link: &urdf_rs::Link) -> Result<(), RetargetError> {
    let error = |reason: String| RetargetError::Link {
        link: link.name.clone(),
        reason,
    };
    let inertial = &link.inertial;
    let mass = inertial.mass.value;
    if !mass.is_finite() || !(0.0..=LARGEST_M).contains(&mass) {
        return Err(error(format!("mass {mass} kg is not usable")));
    }
    if !all_usable(&*inertial.origin.xyz) || !all_usable(&*inertial.origin.rpy) {
        return Err(error("inertial origin is not usable".into()));
    }
    for visual in &link.visual {
        if !all_usable(&*visual.origin.xyz) || !all_usable(&*visual.origin.rpy) {
            return Err(error("visual origin is not usable".into()));
        }
    }
    Ok(())
}

fn check_joint(joint: &urdf_rs::Joint, robot: &urdf_rs::Robot) -> Result<(), RetargetError> {
    use urdf_rs::JointType::*;
    if !all_usable(&*joint.origin.xyz) || !all_usable(&*joint.origin.rpy) {
        return Err(joint_error(joint, "origin is not usable"));
    }
    let limit = &joint.limit;
    let movable = matches!(joint.joint_type, Revolute | Continuous | Prismatic);
    if movable {
        let axis = *joint.axis.xyz;
        let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt();
        if !length.is_finite() || length < 1e-6 {
            return Err(joint_error(
                joint,
                format!("axis {} {} {} has no direction", axis[0], axis[1], axis[2]),
            ));
        }
    }
    if !limit.lower.is_finite() || !limit.upper.is_finite() {
        return Err(joint_error(joint, "a limit is not a finite number"));
    }
    // `k` asserts this order for every kind of joint.
    if limit.lower > limit.upper {
        return Err(joint_error(
            joint,
            format!(
                "lower limit {} is above upper limit {}",
                limit.lower, limit.upper
            ),
        ));
    }
    if movable {
        check_mimic(joint, robot)?;
    }
    Ok(())
}

fn check_mimic(joint: &urdf_rs::Joint, robot: &urdf_rs::Robot) -> Result<(), RetargetError> {
    let mut at = joint;
    for _ in 0..=robot.joints.len() {
        let Some(mimic) = &at.mimic else {
            return Ok(());
        };
        let numbers = [mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0)];
        if !all_usable(&numbers) {
            return Err(joint_error(at, "mimic multiplier or offset is not usable"));
        }
        let Some(next) = robot.joints.iter().find(|other| other.name == mimic.joint) else {
            return Err(joint_error(
                at,
                format!("mimics `{}`, which does not exist", mimic.joint),
            ));
        };
        if !is_driven(next) {
            return Err(joint_error(
                at,
                format!("mimics `{}`, which does not move", mimic.joint),
            ));
        }
        at = next;
    }
    Err(joint_error(joint, "mimics itself in a circle"))
}

/// Whether a joint of this kind has one position.
pub(crate) fn is_driven(joint: &urdf_rs::Joint) -> bool {
    use urdf_rs::JointType::*;
    matches!(joint.joint_type, Revolute | Continuous | Prismatic)
}
