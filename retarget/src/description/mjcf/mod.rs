//! An MJCF model becomes the same robot in memory as a URDF: bodies, joints,
//! simple shapes, masses.
//!
//! Read: `compiler` (angle, eulerseq, autolimits), nested `default` classes,
//! `childclass`, `frame`, several joints a body, joint anchors, all orientations,
//! `inertial` or masses from shapes, `fromto`, joint equalities (as mimics) and
//! the strength of motors, `include` of files in the model's folder. Held at rest, and
//! reported: joints without a motor, and those of a loop that `connect` or `weld` closes.
//! Meshes go by their files' names. Left out, and reported: tendons, `attach`, `replicate`, objects around the robot, ball joints as such
//! (three hinges stand for one). Refused: global coordinates.
//! Metres, kilograms, radians.

mod attributes;
mod bodies;
mod geoms;
mod include;
mod meshes;
mod undriven;
mod urdf_text;

use roxmltree::Node;

use crate::config::RetargetError;
use crate::description::diagnostic::{Diagnostic, DiagnosticCode, Diagnostics};
use crate::description::xml::{check_depth, parse, read_loosely};
use attributes::{MjcfAttributes, MjcfElement};
use bodies::MjcfBodies;
pub use include::with_includes;

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
/// Fails, with the reason, where the text cannot be converted.
pub fn urdf_from_mjcf(text: &str) -> Result<(String, Vec<Diagnostic>), RetargetError> {
    let mut diagnostics = Diagnostics::default();
    let robot = read(text, &mut diagnostics)?;
    Ok((urdf_text::urdf_text(&robot), diagnostics.list))
}

pub(super) fn read(
    text: &str,
    diagnostics: &mut Diagnostics,
) -> Result<urdf_rs::Robot, RetargetError> {
    let text = &*read_loosely(text, diagnostics);
    check_depth(text)?;
    let document = parse(text).map_err(|error| RetargetError::Mjcf(error.to_string()))?;
    let root = document.root_element();
    if root.tag_name().name() != "mujoco" {
        let name = root.tag_name().name();
        return Err(RetargetError::Mjcf(format!("the root element is <{name}>")));
    }
    if root.descendants().any(|node| node.has_tag_name("include")) {
        let reason = "it includes other files, which are read from a file's folder only";
        return Err(RetargetError::Mjcf(reason.into()));
    }
    let mut attributes = MjcfAttributes::new(root)?;
    attributes.meshes = meshes::read(root, &attributes)?;
    let mut bodies = MjcfBodies::read(root, &attributes, diagnostics)?;
    let model = MjcfElement::new(root, "main", &attributes);
    bodies.add_mimics(model);
    bodies.add_effort_limits(model);
    let mut robot = bodies.robot(root.attribute("model").unwrap_or("robot"));
    undriven::hold_passive(root, &mut robot.joints, diagnostics);
    undriven::hold_loops(root, &mut robot.joints, diagnostics);
    report_left_out(root, diagnostics);
    Ok(robot)
}

fn report_left_out(root: Node, diagnostics: &mut Diagnostics) {
    for (element, what) in [
        ("tendon", "not converted: let joints follow by [[retarget.couple]]"),
        ("flex", "not converted"),
        ("composite", "not converted"),
        ("attach", "not converted: put the other model's bodies here"),
        ("replicate", "not converted: write its copies out"),
    ] {
        let found = root.descendants().filter(|n| n.has_tag_name(element));
        let count = found.count();
        if count > 0 {
            let message = format!("{count} times in the file; {what}");
            diagnostics.add(DiagnosticCode::MjcfLeftOut, element, message);
        }
    }
}
