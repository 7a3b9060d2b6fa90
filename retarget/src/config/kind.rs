//! Kinds of body: what a robot is, and with it how it shows a dance.

use serde::{Deserialize, Serialize};

/// What kind of body a robot has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyKind {
    /// Arms and legs: each limb shows the dancer's.
    #[default]
    Humanoid,
    /// Arms on a stand, a table or wheels.
    UpperBody,
    /// Legs without arms.
    Biped,
    /// A head on a neck, or a camera that pans and tilts.
    Head,
    /// One arm on its base: it stands, leans and reaches as the dancer's whole body does.
    Arm,
    /// Four legs that stand: the trunk bows, sways and turns over them.
    Quadruped,
    /// Wheels that turn the base, and nothing else that moves.
    Wheeled,
}

servodance_types::named!(BodyKind, "kind of body" {
    Humanoid "humanoid",
    UpperBody "upper_body",
    Biped "biped",
    Head "head",
    Arm "arm",
    Quadruped "quadruped",
    Wheeled "wheeled",
});

impl BodyKind {
    /// Whether its limbs are compared with the dancer's.
    pub fn is_human_like(self) -> bool {
        !matches!(self, Self::Arm | Self::Quadruped | Self::Wheeled)
    }
}
