//! What can be wrong with a robot description or a call.

use thiserror::Error;

/// Why a robot cannot be used, or a call cannot be answered.
///
/// All variants but [`RetargetError::Length`] come from building; they mean:
/// correct the file and build again.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs)] // the messages name the fields
pub enum RetargetError {
    #[error("the robot description is not a readable URDF: {0}")]
    Xml(String),
    /// The text is an MJCF model that cannot be converted.
    #[error("the MJCF model cannot be converted: {0}")]
    Mjcf(String),
    #[error("the robot description is an unexpanded xacro: run `xacro FILE > robot.urdf` first")]
    Xacro,
    #[error("the links do not make one tree: {0}")]
    Tree(String),
    /// The body lacks what a dance, or what was asked for, needs.
    #[error("{0}")]
    Body(String),
    #[error("joint `{joint}`: {reason}")]
    Joint { joint: String, reason: String },
    #[error("link `{link}`: {reason}")]
    Link { link: String, reason: String },
    /// The servo map names a joint that the description lacks.
    #[error("no joint `{name}` in the URDF; it has: {choices}")]
    NoSuchJoint { name: String, choices: String },
    #[error("no link `{name}` in the URDF (asked for as `{part}`); it has: {choices}")]
    NoSuchLink { part: String, name: String, choices: String },
    #[error("[retarget] {key} = {value}: {expected}")]
    Config { key: String, value: String, expected: String },
    #[error("{actual} joint positions given, the robot has {expected} joints")]
    Length { expected: usize, actual: usize },
    #[error("joint `{joint}`: present position is not a finite number")]
    NotFinite { joint: String },
}

pub(crate) fn choices<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut list: Vec<&str> = names.into_iter().collect();
    list.sort_unstable();
    list.join(", ")
}
