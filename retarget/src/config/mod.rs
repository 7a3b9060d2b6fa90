//! The `[retarget]` table of a robot file: which link is which body part, and
//! how the robot shall move.
//!
//! Everything has a default; links that are not named are guessed from the
//! names in the URDF. Degrees appear here alone (keys end in `_deg`).

mod body;
mod error;
mod kind;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub(crate) use body::EVERY_LIMB;
pub use body::{BodyLinks, Gains, Limb};
pub use error::RetargetError;
pub(crate) use error::choices;
pub use kind::BodyKind;

/// What the robot stands on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stance {
    /// Both feet stay where they are; the pelvis moves over them.
    Planted,
    /// The feet step where the dancer's do, on the spot, as balance allows.
    Stepping,
    /// The root link is fixed to a stand (or a table); legs swing freely.
    #[default]
    Hung,
}

impl Stance {
    /// Whether the robot stands on its own feet.
    pub fn stands(self) -> bool {
        self != Stance::Hung
    }
}

/// A point fixed to a link that no link's origin is: the end of a limb, say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)] // the names of the others say it
pub struct Tip {
    pub name: String,
    pub link: String,
    /// Where, in the link's frame, metres.
    pub at_m: [f64; 3],
}

/// A collision capsule: a thick line fixed to a link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)] // the names of the others say it
pub struct CapsuleConfig {
    pub link: String,
    /// One end in the link's frame, metres.
    pub from_m: [f64; 3],
    pub to_m: [f64; 3],
    /// Half its thickness, metres.
    pub radius_m: f64,
}

/// A joint that follows another by a rod, gear or closed loop which the
/// description does not show: `multiplier` times its position plus `offset_deg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename = "Couple")] // as messages about the file name it
#[allow(missing_docs)] // the names of the others say it
pub struct JointCoupling {
    pub joint: String,
    pub follows: String,
    #[serde(default = "once")]
    pub multiplier: f64,
    /// Where it is when the other is at zero, degrees.
    #[serde(default)]
    pub offset_deg: f64,
}

/// A rod of a Stewart platform, from a servo's crank to the plate: six of them carry a link
/// that the description fixes to its parent. Its length is that between both points where
/// all joints are zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename = "Rod")] // as messages about the file name it
#[allow(missing_docs)] // the names of the others say it
pub struct RodConfig {
    /// The link that the servo turns.
    pub crank: String,
    /// Where the rod meets the crank, in the crank's frame, metres.
    pub pin_m: [f64; 3],
    /// The link that the rods carry.
    pub plate: String,
    pub socket_m: [f64; 3],
}

/// A driven wheel of the base, which turns on the spot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename = "Wheel")] // as messages about the file name it
pub struct WheelConfig {
    /// The link that the servo turns about its axle.
    pub link: String,
    /// Metres.
    pub radius_m: f64,
}

fn once() -> f64 {
    1.0
}

/// How strongly each aim pulls in the least-squares problem.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename = "Weights")] // as messages name it
pub struct TaskWeights {
    /// Direction of upper arms and thighs.
    pub upper_limb: f64,
    /// Direction of forearms and shanks.
    pub lower_limb: f64,
    /// Where the hands and feet are, scaled to the robot's limb length.
    pub tip: f64,
    /// Orientation of chest and pelvis.
    pub torso: f64,
    /// Direction of the face.
    pub head: f64,
    /// Pull towards the rest pose.
    pub posture: f64,
    /// Reluctance to move at all: what decides near singular poses.
    pub damping: f64,
}

impl Default for TaskWeights {
    fn default() -> Self {
        Self {
            upper_limb: 1.0,
            lower_limb: 0.5,
            tip: 0.8,
            torso: 2.0,
            head: 0.6,
            posture: 0.05,
            damping: 0.2,
        }
    }
}

/// What the motors can do: the `[retarget.torque]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TorqueConfig {
    /// Torque limits by joint name, newton metres (newtons where it slides); the
    /// effort limits of the URDF where left out.
    pub limit_nm: BTreeMap<String, f64>,
    /// Share of the limit that a motor can hold for ever.
    pub continuous_share: f64,
    /// Time constant of its warming up, seconds.
    pub warm_up_s: f64,
}

impl Default for TorqueConfig {
    fn default() -> Self {
        Self { limit_nm: BTreeMap::new(), continuous_share: 0.4, warm_up_s: 180.0 }
    }
}

/// The `[retarget]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // the names of the others say it
pub struct RetargetConfig {
    pub kind: BodyKind,
    pub stance: Stance,
    pub mirror: bool,
    /// Share of the movement around the rest pose, 0 to 1.
    pub amplitude: f64,
    /// Share of the velocity and acceleration limits that is used, above 0
    /// and up to 1. What is left covers rounding further down.
    pub margin: f64,
    /// Seconds in which a joint's acceleration may rise to its limit: sets the
    /// jerk limit where `jerk_deg_s3` does not.
    pub jerk_rise_s: f64,
    /// Jerk limits by joint name, degrees a second cubed.
    pub jerk_deg_s3: BTreeMap<String, f64>,
    /// How far ahead of the output the dancer is watched, seconds. More lets
    /// slow joints begin in time; less answers live music sooner.
    pub preview_s: f64,
    /// Axis of the root link that points forward: `x`, `-x`, `y`, …
    pub forward: String,
    pub up: String,
    /// How far the pelvis of a planted robot sinks at rest, as a share of the
    /// leg length: room to move up.
    pub crouch: f64,
    /// Length and width of a sole in metres (planted).
    pub sole_m: [f64; 2],
    /// How far swings of the arms may push the zero-moment point from the middle towards the
    /// edge of the soles before the arms give way (planted): 1 is the edge.
    pub arm_zmp_limit: f64,
    /// Which link is which body part; guessed from names where left out.
    pub body: BodyLinks,
    pub gain: Gains,
    pub weights: TaskWeights,
    pub torque: TorqueConfig,
    /// Rest positions by joint name, degrees; found by the solver where left out.
    pub rest_deg: BTreeMap<String, f64>,
    pub tip: Vec<Tip>,
    /// Collision capsules; from the shapes of the description if there are none.
    pub capsule: Vec<CapsuleConfig>,
    /// Joints that follow others, besides the description's mimics.
    pub couple: Vec<JointCoupling>,
    /// The rods of a Stewart platform.
    pub rod: Vec<RodConfig>,
    /// Driven wheels: with them the base turns on the spot as the dancer's body does.
    pub wheel: Vec<WheelConfig>,
}

impl Default for RetargetConfig {
    fn default() -> Self {
        Self {
            kind: BodyKind::Humanoid,
            stance: Stance::Hung,
            mirror: false,
            amplitude: 1.0,
            margin: 0.95,
            jerk_rise_s: 0.05,
            jerk_deg_s3: BTreeMap::new(),
            preview_s: 0.3,
            forward: "x".into(),
            up: "z".into(),
            crouch: 0.05,
            sole_m: [0.12, 0.07],
            arm_zmp_limit: 0.6,
            body: BodyLinks::default(),
            gain: Gains::default(),
            weights: TaskWeights::default(),
            torque: TorqueConfig::default(),
            rest_deg: BTreeMap::new(),
            tip: Vec::new(),
            capsule: Vec::new(),
            couple: Vec::new(),
            rod: Vec::new(),
            wheel: Vec::new(),
        }
    }
}

impl RetargetConfig {
    /// Refuses values outside their range.
    pub fn check(&self) -> Result<(), RetargetError> {
        in_range("amplitude", self.amplitude, 0.0, 1.0)?;
        in_range("margin", self.margin, 0.05, 1.0)?;
        in_range("crouch", self.crouch, 0.0, 0.4)?;
        for (index, value) in self.sole_m.into_iter().enumerate() {
            in_range(&format!("sole_m[{index}]"), value, 0.001, 5.0)?;
        }
        in_range("arm_zmp_limit", self.arm_zmp_limit, 0.0, 10.0)?;
        self.check_scales()?;
        in_range("jerk_rise_s", self.jerk_rise_s, 0.002, 1.0)?;
        in_range("preview_s", self.preview_s, 0.05, 0.6)?;
        all_in_range("jerk_deg_s3", &self.jerk_deg_s3, 1.0, 1e9)?;
        let torque = &self.torque;
        let share = torque.continuous_share;
        in_range("torque.continuous_share", share, 0.01, 1.0)?;
        in_range("torque.warm_up_s", torque.warm_up_s, 1.0, 1e5)?;
        all_in_range("torque.limit_nm", &torque.limit_nm, 1e-3, 1e5)?;
        in_range("weights.damping", self.weights.damping, 1e-4, 10.0)?;
        all_in_range("rest_deg", &self.rest_deg, -3600.0, 3600.0)?;
        self.check_geometry()
    }

    fn check_scales(&self) -> Result<(), RetargetError> {
        let gain = &self.gain;
        for (key, value) in [
            ("left_arm", gain.left_arm),
            ("right_arm", gain.right_arm),
            ("left_leg", gain.left_leg),
            ("right_leg", gain.right_leg),
            ("head", gain.head),
            ("torso", gain.torso),
        ] {
            in_range(&format!("gain.{key}"), value, 0.0, 2.0)?;
        }
        let weights = &self.weights;
        for (key, value) in [
            ("upper_limb", weights.upper_limb),
            ("lower_limb", weights.lower_limb),
            ("tip", weights.tip),
            ("torso", weights.torso),
            ("head", weights.head),
            ("posture", weights.posture),
        ] {
            in_range(&format!("weights.{key}"), value, 0.0, 100.0)?;
        }
        Ok(())
    }

    fn check_geometry(&self) -> Result<(), RetargetError> {
        for tip in &self.tip {
            for value in tip.at_m {
                in_range(&format!("tip.{}.at_m", tip.name), value, -100.0, 100.0)?;
            }
        }
        for capsule in &self.capsule {
            let key = |part: &str| format!("capsule.{}.{part}", capsule.link);
            for value in capsule.from_m.into_iter().chain(capsule.to_m) {
                in_range(&key("from_m or to_m"), value, -100.0, 100.0)?;
            }
            in_range(&key("radius_m"), capsule.radius_m, 1e-5, 10.0)?;
        }
        for wheel in &self.wheel {
            in_range(&format!("wheel.{}.radius_m", wheel.link), wheel.radius_m, 1e-3, 10.0)?;
        }
        for couple in &self.couple {
            let key = |part: &str| format!("couple.{}.{part}", couple.joint);
            in_range(&key("multiplier"), couple.multiplier, -1000.0, 1000.0)?;
            in_range(&key("offset_deg"), couple.offset_deg, -3600.0, 3600.0)?;
        }
        Ok(())
    }
}

fn all_in_range(
    key: &str,
    values: &BTreeMap<String, f64>,
    low: f64,
    high: f64,
) -> Result<(), RetargetError> {
    let mut all = values.iter();
    all.try_for_each(|(joint, value)| in_range(&format!("{key}.{joint}"), *value, low, high))
}

fn in_range(key: &str, value: f64, low: f64, high: f64) -> Result<(), RetargetError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(RetargetError::Config {
        key: key.into(),
        value: value.to_string(),
        expected: format!("expected a number from {low} to {high}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_table_is_enough() {
        let config: RetargetConfig = toml::from_str("").unwrap();
        assert_eq!(config, RetargetConfig::default());
        assert!(config.check().is_ok());
    }

    #[test]
    fn unknown_keys_are_refused() {
        assert!(toml::from_str::<RetargetConfig>("stanse = 'hung'").is_err());
        assert!(toml::from_str::<RetargetConfig>("[body]\nnose = 'x'").is_err());
    }

    #[test]
    fn values_out_of_range_are_named() {
        for (text, key) in [
            ("amplitude = 1.5", "amplitude"),
            ("margin = nan", "margin"),
            ("[gain]\nhead = -1", "gain.head"),
            ("[rest_deg]\nelbow = inf", "rest_deg.elbow"),
        ] {
            let config: RetargetConfig = toml::from_str(text).unwrap();
            let message = config.check().unwrap_err().to_string();
            assert!(message.contains(key), "{message}");
        }
    }
}
