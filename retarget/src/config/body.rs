//! Parts of the body: the keys of `[retarget.gain]` and `[retarget.body]`.

use serde::{Deserialize, Serialize};

/// A part of the body whose movement can be scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // the names say it
pub enum Limb {
    LeftArm,
    RightArm,
    /// Only when hung: a leg that stands follows the pelvis.
    LeftLeg,
    RightLeg,
    Head,
    Torso,
}

impl Limb {
    /// Neither the trunk nor a leg.
    pub fn is_arm_or_head(self) -> bool {
        matches!(self, Self::LeftArm | Self::RightArm | Self::Head)
    }
}

/// All of them, in the order of their numbers.
pub(crate) const EVERY_LIMB: [Limb; 6] =
    [Limb::LeftArm, Limb::RightArm, Limb::LeftLeg, Limb::RightLeg, Limb::Head, Limb::Torso];

/// How much of the human's movement each limb shows: 1 is all of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // the names say it
pub struct Gains {
    pub left_arm: f64,
    pub right_arm: f64,
    pub left_leg: f64,
    pub right_leg: f64,
    pub head: f64,
    pub torso: f64,
}

impl Default for Gains {
    fn default() -> Self {
        Self { left_arm: 1.0, right_arm: 1.0, left_leg: 1.0, right_leg: 1.0, head: 1.0, torso: 1.0 }
    }
}

impl Gains {
    pub(crate) fn of(&self, limb: Limb) -> f64 {
        match limb {
            Limb::LeftArm => self.left_arm,
            Limb::RightArm => self.right_arm,
            Limb::LeftLeg => self.left_leg,
            Limb::RightLeg => self.right_leg,
            Limb::Head => self.head,
            Limb::Torso => self.torso,
        }
    }
}

/// Names of the URDF links whose frame origin is the named point of the body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // the names say it
pub struct BodyLinks {
    pub pelvis: Option<String>,
    pub chest: Option<String>,
    pub head: Option<String>,
    pub left_shoulder: Option<String>,
    pub left_elbow: Option<String>,
    pub left_hand: Option<String>,
    pub right_shoulder: Option<String>,
    pub right_elbow: Option<String>,
    pub right_hand: Option<String>,
    pub left_hip: Option<String>,
    pub left_knee: Option<String>,
    pub left_ankle: Option<String>,
    pub left_sole: Option<String>,
    pub right_hip: Option<String>,
    pub right_knee: Option<String>,
    pub right_ankle: Option<String>,
    pub right_sole: Option<String>,
}
