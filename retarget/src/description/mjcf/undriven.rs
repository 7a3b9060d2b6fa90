//! Joints of an MJCF model that no servo can move by itself: those without a motor, and
//! those of a closed loop. They are held where the model has them at rest, and named.

use std::collections::HashSet;

use roxmltree::Node;
use urdf_rs::JointType;

use crate::description::diagnostic::{DiagnosticCode, Diagnostics};

/// A joint with less room than this is play, radians.
const PLAY_RAD: f64 = 0.06;

/// Holds the joints that have no motor while others have one, follow no other and have
/// no range of their own: rods and play. Models that list some motors only give the
/// others a range.
pub(super) fn hold_passive(
    root: Node,
    joints: &mut [urdf_rs::Joint],
    diagnostics: &mut Diagnostics,
) {
    let elements = |section: &'static str| {
        let sections = root.children().filter(move |node| node.has_tag_name(section));
        sections.flat_map(|node| node.children()).filter(Node::is_element)
    };
    let mut driven: HashSet<&str> = HashSet::new();
    for motor in elements("actuator") {
        let names = ["joint", "jointinparent"].into_iter();
        driven.extend(names.filter_map(|key| motor.attribute(key)));
        let tendon = motor.attribute("tendon");
        for pulled in
            elements("tendon").filter(|t| tendon.is_some() && t.attribute("name") == tendon)
        {
            driven.extend(pulled.children().filter_map(|part| part.attribute("joint")));
        }
    }
    if driven.is_empty() {
        return;
    }
    for joint in joints.iter_mut().filter(|joint| joint.joint_type != JointType::Fixed) {
        let free = joint.limit.upper - joint.limit.lower < PLAY_RAD;
        if free && joint.mimic.is_none() && !driven.contains(joint.name.as_str()) {
            joint.joint_type = JointType::Fixed;
            let message = "no motor of the model drives it: it rests";
            diagnostics.add(DiagnosticCode::MjcfLeftOut, &joint.name, message);
        }
    }
}

/// Holds the joints of every loop that a `connect` or `weld` closes.
pub(super) fn hold_loops(root: Node, joints: &mut [urdf_rs::Joint], diagnostics: &mut Diagnostics) {
    let ties = root
        .children()
        .filter(|node| node.has_tag_name("equality"))
        .flat_map(|node| node.children())
        .filter(|node| node.has_tag_name("connect") || node.has_tag_name("weld"))
        .filter(|node| node.attribute("active") != Some("false"));
    for tie in ties {
        let ends = ["1", "2"].map(|end| body_of(root, tie, end));
        let [Some(one), Some(other)] = ends else { continue };
        let paths = [&one, &other].map(|body| joints_above(joints, body));
        let [first, second] = &paths;
        let mut held: Vec<usize> = first.symmetric_difference(second).copied().collect();
        held.sort_unstable();
        let moving = held.iter().filter(|&&joint| joints[joint].joint_type != JointType::Fixed);
        let names: Vec<String> = moving.map(|&joint| joints[joint].name.clone()).collect();
        for joint in held {
            joints[joint].joint_type = JointType::Fixed;
            joints[joint].mimic = None;
        }
        if !names.is_empty() {
            let message = format!(
                "a closed loop ({one} with {other}) that is not driven: these joints rest: {}",
                names.join(", ")
            );
            diagnostics.add(DiagnosticCode::MjcfLoop, &one, message);
        }
    }
}

/// The body at one end of a tie, which may be named by a site on it.
fn body_of(root: Node, tie: Node, end: &str) -> Option<String> {
    if let Some(body) = tie.attribute(format!("body{end}").as_str()) {
        return Some(body.to_owned());
    }
    let site = tie.attribute(format!("site{end}").as_str())?;
    let mut sites = root.descendants().filter(|node| node.has_tag_name("site"));
    let site = sites.find(|node| node.attribute("name") == Some(site))?;
    let body = site.ancestors().find(|node| node.has_tag_name("body"))?;
    body.attribute("name").map(str::to_owned)
}

/// Joints between a link and the root.
fn joints_above(joints: &[urdf_rs::Joint], link: &str) -> HashSet<usize> {
    let mut above = HashSet::new();
    let mut at = link.to_owned();
    while let Some(index) = joints.iter().position(|joint| joint.child.link == at) {
        if !above.insert(index) {
            break;
        }
        at.clone_from(&joints[index].parent.link);
    }
    above
}
