//! What a description looks like, for people and scripts to check.

use serde::Serialize;

use super::draft::body_links;
use super::guess::{BodyAxes, MeshReader, anatomy};
use crate::config::{BodyKind, BodyLinks, Tip};
use crate::description::read_any;
use crate::kinematics::RobotModel;

/// The kind of body that a description looks like, and which link is taken as which part.
#[derive(Clone, Debug, Serialize)]
pub struct BodyGuess {
    /// What it is taken for.
    pub kind: BodyKind,
    /// How sure that is: `high` (names and shape agree), `medium` or `low`.
    pub confidence: &'static str,
    /// What speaks for it.
    pub reason: String,
    /// The axis of the root link that points forward.
    pub forward: &'static str,
    /// The axis of the root link that points up.
    pub up: &'static str,
    /// Links and points on links by part of the body.
    pub parts: BodyLinks,
    /// The points of `parts` that are no link's origin.
    pub tips: Vec<Tip>,
}

/// Guesses from the text of a URDF or an MJCF model; `None` where it is refused, or
/// nothing of it can show a dance.
pub fn guess_body(text: &str, meshes: &MeshReader) -> Option<BodyGuess> {
    let (description, _) = read_any(text);
    let description = description?;
    let names: Vec<&str> = description.drives().map(|joint| joint.name.as_str()).collect();
    let mut model = RobotModel::of_description(&description, &names).ok()?;
    let positions = description.zero_positions(model.joint_names());
    let body = anatomy(&model, &positions, None, meshes);
    model.add_tips(&body.tips).ok()?;
    let kind = body.kind.clone()?;
    Some(BodyGuess {
        kind: kind.kind,
        confidence: kind.confidence.name(),
        reason: kind.reason,
        forward: BodyAxes::name(&body.axes.forward),
        up: BodyAxes::name(&body.axes.up),
        parts: body_links(&model, &body),
        tips: body.tips,
    })
}
