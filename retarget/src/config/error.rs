//! What can be wrong with a robot description or a call.

use thiserror::Error;

/// Why a robot cannot be used, or a call cannot be answered.
///
/// All variants but [`RetargetError::Length`] come from building; they mean:
/// correct the file and build again.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs)] // the messages name the fields
pub enum RetargetError {
    /// The text is not a URDF.
    #[error("the robot description is not a readable URDF: {0}")]
    Xml(String),
    /// The text is an MJCF model that cannot be converted.
    #[error("the MJCF model cannot be converted: {0}")]
    Mjcf(String),
    /// The description is still an unexpanded xacro.
    #[error("the robot description is an unexpanded xacro: run `xacro FILE > robot.urdf` first")]
    Xacro,
    /// The links and joints do not make one tree.
    #[error("the links do not make one tree: {0}")]
    Tree(String),
    /// One joint of the description cannot be used.
    #[error("joint `{joint}`: {reason}")]
    Joint { joint: String, reason: String },
    /// One link of the description cannot be used.
    #[error("link `{link}`: {reason}")]
    Link { link: String, reason: String },
    /// The servo map names a joint that the description lacks.
    #[error("no joint `{name}` in the URDF; it has: {choices}")]
    NoSuchJoint { name: String, choices: String },
    /// The configuration names a link that the description lacks.
    #[error("no link `{name}` in the URDF (asked for as `{part}`); it has: {choices}")]
    NoSuchLink {
        part: String,
        name: String,
        choices: String,
    },
    /// A value of the configuration is outside its range.
    #[error("[retarget] {key} = {value}: {expected}")]
    Config {
        key: String,
        value: String,
        expected: String,
    },
    /// A slice has not one value a joint.
    #[error("{actual} joint positions given, the robot has {expected} joints")]
    Length { expected: usize, actual: usize },
    /// A present position is not a finite number.
    #[error("joint `{joint}`: present position is not a finite number")]
    NotFinite { joint: String },
}

/// Names joined for an error message.
pub(crate) fn choices<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut list: Vec<&str> = names.into_iter().collect();
    list.sort_unstable();
    list.join(", ")
}
