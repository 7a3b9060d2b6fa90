//! Which link of the robot is which part of the body.
//!
//! Named in the configuration, or guessed from the names of links and joints
//! and from the tree: the chest is what both shoulders hang from, the pelvis
//! what both hips hang from. A part that is not there is left out, and with it
//! the movement that only it could show.

use crate::config::{BodyLinks, Limb, RetargetConfig};
use crate::error::choices;
use crate::guess::anatomy;
use crate::guess::words::SIDES;
use crate::{RetargetError, RobotModel};

/// Shoulder, elbow and hand of one arm; link indices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Arm {
    pub shoulder: Option<usize>,
    pub elbow: Option<usize>,
    pub hand: Option<usize>,
}

/// Hip, knee, ankle and sole of one leg; link indices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Leg {
    pub hip: Option<usize>,
    pub knee: Option<usize>,
    pub ankle: Option<usize>,
    pub sole: Option<usize>,
}

/// The parts that this robot has; `[left, right]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct BodyMap {
    pub pelvis: usize,
    pub chest: usize,
    pub head: Option<usize>,
    pub arms: [Arm; 2],
    pub legs: [Leg; 2],
}

impl BodyMap {
    /// The parts named in `config`, the others guessed.
    pub fn new(model: &RobotModel, config: &RetargetConfig) -> Result<Self, RetargetError> {
        let named = &config.body;
        let guess = anatomy(model, &vec![0.0; model.joint_names().len()]);
        let find = |part: &str, name: &Option<String>| named_link(model, part, name);
        let or = |guessed: &Option<String>| model.link(guessed.as_deref()?);
        let arm = |side: usize, shoulder, elbow, hand| -> Result<Arm, RetargetError> {
            let key = |part: &str| format!("{}_{part}", SIDES[side]);
            let guessed = &guess.arms[side];
            Ok(Arm {
                shoulder: find(&key("shoulder"), shoulder)?.or_else(|| or(&guessed.top)),
                elbow: find(&key("elbow"), elbow)?.or_else(|| or(&guessed.middle)),
                hand: find(&key("hand"), hand)?.or_else(|| or(&guessed.end)),
            })
        };
        let leg = |side: usize, hip, knee, ankle, sole| -> Result<Leg, RetargetError> {
            let key = |part: &str| format!("{}_{part}", SIDES[side]);
            let guessed = &guess.legs[side];
            Ok(Leg {
                hip: find(&key("hip"), hip)?.or_else(|| or(&guessed.top)),
                knee: find(&key("knee"), knee)?.or_else(|| or(&guessed.middle)),
                ankle: find(&key("ankle"), ankle)?.or_else(|| or(&guessed.end)),
                sole: find(&key("sole"), sole)?.or_else(|| or(&guessed.sole)),
            })
        };
        let n: &BodyLinks = named;
        let mut map = Self {
            pelvis: 0,
            chest: 0,
            head: find("head", &n.head)?.or(guess.head),
            arms: [
                arm(0, &n.left_shoulder, &n.left_elbow, &n.left_hand)?,
                arm(1, &n.right_shoulder, &n.right_elbow, &n.right_hand)?,
            ],
            legs: [
                leg(0, &n.left_hip, &n.left_knee, &n.left_ankle, &n.left_sole)?,
                leg(
                    1,
                    &n.right_hip,
                    &n.right_knee,
                    &n.right_ankle,
                    &n.right_sole,
                )?,
            ],
        };
        let shoulders = [map.arms[0].shoulder, map.arms[1].shoulder];
        let hips = [map.legs[0].hip, map.legs[1].hip];
        map.chest = find("chest", &n.chest)?.unwrap_or_else(|| join(model, shoulders));
        map.pelvis = find("pelvis", &n.pelvis)?.unwrap_or_else(|| join(model, hips));
        Ok(map)
    }

    /// Which joints move any part of the body.
    pub fn shows(&self, model: &RobotModel) -> Vec<bool> {
        let mut shows = vec![false; model.joint_names().len()];
        let arms = self
            .arms
            .iter()
            .flat_map(|arm| [arm.shoulder, arm.elbow, arm.hand]);
        let legs = self
            .legs
            .iter()
            .flat_map(|leg| [leg.hip, leg.knee, leg.ankle, leg.sole]);
        let parts = arms.chain(legs).chain([self.head, Some(self.chest)]);
        for link in parts.flatten() {
            for lever in &model.levers[link] {
                shows[lever.joint] = true;
            }
        }
        shows
    }

    /// Which limb each joint moves.
    pub fn limbs(&self, model: &RobotModel) -> Vec<Limb> {
        let mut limbs = vec![Limb::Torso; model.joint_names().len()];
        let mut mark = |end: Option<usize>, stop: usize, limb: Limb| {
            for lever in end.map_or(&[][..], |end| &model.levers[end]) {
                if !model.is_below(stop, lever.link) {
                    limbs[lever.joint] = limb;
                }
            }
        };
        let [left_arm, right_arm] = self.arms;
        let [left_leg, right_leg] = self.legs;
        mark(left_arm.hand.or(left_arm.elbow), self.chest, Limb::LeftArm);
        mark(
            right_arm.hand.or(right_arm.elbow),
            self.chest,
            Limb::RightArm,
        );
        mark(left_leg.sole.or(left_leg.ankle), self.pelvis, Limb::LeftLeg);
        mark(
            right_leg.sole.or(right_leg.ankle),
            self.pelvis,
            Limb::RightLeg,
        );
        mark(self.head, self.chest, Limb::Head);
        limbs
    }
}

/// The deepest link above both; with one of them the link two above it.
fn join(model: &RobotModel, pair: [Option<usize>; 2]) -> usize {
    match pair {
        [Some(left), Some(right)] => model.common_ancestor(left, right),
        _ => 0,
    }
}

fn named_link(
    model: &RobotModel,
    part: &str,
    name: &Option<String>,
) -> Result<Option<usize>, RetargetError> {
    let Some(name) = name else {
        return Ok(None);
    };
    match model.link(name) {
        Some(index) => Ok(Some(index)),
        None => Err(RetargetError::NoSuchLink {
            part: part.into(),
            name: name.clone(),
            choices: choices(model.link_names().iter().map(String::as_str)),
        }),
    }
}
