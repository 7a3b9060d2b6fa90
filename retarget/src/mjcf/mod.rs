//! An MJCF model becomes a URDF: bodies, joints, simple shapes, masses.
//!
//! Read: `compiler` (angle, eulerseq, autolimits), nested `default` classes,
//! `childclass`, several joints a body, joint anchors, all orientations,
//! `inertial` or masses from shapes, `fromto`, joint equalities (as mimics) and
//! the strength of motors. Left out, and said: meshes, tendons, `connect` and
//! `weld` equalities, objects around the robot, ball joints as such (three
//! hinges stand for one). Refused: `include`, global coordinates.
//! Metres, kilograms, radians.

mod attributes;
mod bodies;
mod urdf_text;

use roxmltree::{Document, Node, ParsingOptions};

use crate::RetargetError;
use crate::finding::{Code, Finding, Findings};
use attributes::Attributes;
use bodies::Bodies;

/// More elements than any model has; keeps hostile files cheap.
const MOST_NODES: u32 = 500_000;

/// Whether a text is an MJCF model, by its root element.
pub fn is_mjcf(text: &str) -> bool {
    let mut rest = text;
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        match rest.strip_prefix("!--") {
            Some(comment) => rest = comment.split_once("-->").map_or("", |(_, after)| after),
            None if rest.starts_with(['?', '!']) => {}
            None => return rest.starts_with("mujoco"),
        }
    }
    false
}

/// The URDF of an MJCF model, and what was left out or approximated.
///
/// # Errors
/// A text that cannot be converted; says why.
pub fn urdf_from_mjcf(text: &str) -> Result<(String, Vec<Finding>), RetargetError> {
    crate::urdf::check_depth(text)?;
    let options = ParsingOptions {
        nodes_limit: MOST_NODES,
        ..Default::default()
    };
    let document = Document::parse_with_options(text, options)
        .map_err(|error| RetargetError::Mjcf(error.to_string()))?;
    let root = document.root_element();
    if root.tag_name().name() != "mujoco" {
        let name = root.tag_name().name();
        return Err(RetargetError::Mjcf(format!("the root element is <{name}>")));
    }
    if root.descendants().any(|node| node.has_tag_name("include")) {
        let reason = "it includes other files: save it as one file first";
        return Err(RetargetError::Mjcf(reason.into()));
    }
    let attributes = Attributes::new(root)?;
    let mut findings = Findings::default();
    let mut bodies = Bodies::read(root, &attributes, &mut findings)?;
    bodies.couple(root, &attributes, &mut findings);
    bodies.strengthen(root, &attributes);
    say_what_is_left_out(root, &mut findings);
    let name = root.attribute("model").unwrap_or("robot");
    Ok((urdf_text::urdf_text(name, &bodies), findings.list))
}

fn say_what_is_left_out(root: Node, findings: &mut Findings) {
    for (element, what) in [
        (
            "connect",
            "closes a loop: let a joint follow by [[retarget.couple]]",
        ),
        ("weld", "ties two bodies: not converted"),
        (
            "tendon",
            "not converted: let joints follow by [[retarget.couple]]",
        ),
        ("flex", "not converted"),
        ("composite", "not converted"),
    ] {
        let count = root
            .descendants()
            .filter(|node| node.has_tag_name(element))
            .count();
        if count > 0 {
            let message = format!("{count} times in the file; {what}");
            findings.add(Code::MjcfLeftOut, element, message);
        }
    }
}
