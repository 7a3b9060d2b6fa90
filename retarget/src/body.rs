//! Which link of the robot is which part of the body.
//!
//! Named in the configuration, or guessed from the names of links and joints
//! and from the tree: the chest is what both shoulders hang from, the pelvis
//! what both hips hang from. A part that is not there is left out, and with it
//! the movement that only it could show.

use crate::config::{BodyLinks, Limb, RetargetConfig};
use crate::error::choices;
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

const ELBOW: &[&str] = &["elbow", "el", "forearm", "lowerarm"];
const SHOULDER: &[&str] = &["shoulder", "sho", "arm", "upperarm"];
const HAND: &[&str] = &["hand", "wrist", "palm", "gripper", "tip", "fist", "ee"];
const KNEE: &[&str] = &["knee", "shank", "calf", "shin", "tibia"];
const HIP: &[&str] = &["hip", "thigh", "femur", "leg", "upperleg"];
const ANKLE: &[&str] = &["ankle", "ank", "foot"];
const SOLE: &[&str] = &["sole", "foot", "toe"];
const HEAD: &[&str] = &["head", "neck", "skull"];

impl BodyMap {
    /// The parts named in `config`, the others guessed.
    pub fn new(model: &RobotModel, config: &RetargetConfig) -> Result<Self, RetargetError> {
        let named = &config.body;
        let words: Vec<Vec<String>> = (0..model.links.len()).map(|i| words(model, i)).collect();
        let guess = Guess {
            model,
            words: &words,
        };
        let find = |part: &str, name: &Option<String>| named_link(model, part, name);
        let arm = |side: &str, shoulder, elbow, hand| -> Result<Arm, RetargetError> {
            let key = |part: &str| format!("{side}_{part}");
            let guessed = guess.arm(side);
            Ok(Arm {
                shoulder: find(&key("shoulder"), shoulder)?.or(guessed.shoulder),
                elbow: find(&key("elbow"), elbow)?.or(guessed.elbow),
                hand: find(&key("hand"), hand)?.or(guessed.hand),
            })
        };
        let leg = |side: &str, hip, knee, ankle, sole| -> Result<Leg, RetargetError> {
            let key = |part: &str| format!("{side}_{part}");
            let guessed = guess.leg(side);
            Ok(Leg {
                hip: find(&key("hip"), hip)?.or(guessed.hip),
                knee: find(&key("knee"), knee)?.or(guessed.knee),
                ankle: find(&key("ankle"), ankle)?.or(guessed.ankle),
                sole: find(&key("sole"), sole)?.or(guessed.sole),
            })
        };
        let n: &BodyLinks = named;
        let mut map = Self {
            pelvis: 0,
            chest: 0,
            head: find("head", &n.head)?.or_else(|| guess.last(HEAD)),
            arms: [
                arm("left", &n.left_shoulder, &n.left_elbow, &n.left_hand)?,
                arm("right", &n.right_shoulder, &n.right_elbow, &n.right_hand)?,
            ],
            legs: [
                leg(
                    "left",
                    &n.left_hip,
                    &n.left_knee,
                    &n.left_ankle,
                    &n.left_sole,
                )?,
                leg(
                    "right",
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

/// Lower-case words of a link's name and of the joint above it; `left` and
/// `right` written out.
fn words(model: &RobotModel, link: usize) -> Vec<String> {
    let mut out = Vec::new();
    for name in [&model.link_names()[link], &model.parent_joints[link]] {
        let mut word = String::new();
        let mut before = ' ';
        for letter in name.chars() {
            if letter.is_uppercase() && before.is_lowercase() {
                out.push(std::mem::take(&mut word));
            }
            before = letter;
            match letter.is_alphabetic() {
                true => word.extend(letter.to_lowercase()),
                false => out.push(std::mem::take(&mut word)),
            }
        }
        out.push(word);
    }
    out.retain(|word| !word.is_empty());
    for word in &mut out {
        match word.as_str() {
            "l" => *word = "left".into(),
            "r" => *word = "right".into(),
            _ => {}
        }
    }
    out
}

struct Guess<'a> {
    model: &'a RobotModel,
    words: &'a [Vec<String>],
}

impl Guess<'_> {
    fn has(&self, link: usize, any: &[&str]) -> bool {
        self.words[link]
            .iter()
            .any(|word| any.contains(&word.as_str()))
    }

    fn first(&self, side: &str, any: &[&str]) -> Option<usize> {
        (0..self.words.len()).find(|&i| self.has(i, &[side]) && self.has(i, any))
    }

    fn last(&self, any: &[&str]) -> Option<usize> {
        let moves = |i: usize| !self.model.levers[i].is_empty();
        (0..self.words.len())
            .rev()
            .find(|&i| moves(i) && self.has(i, any))
    }

    /// The last link with such a name above `below`.
    fn above(&self, below: usize, side: &str, any: &[&str]) -> Option<usize> {
        self.model
            .ancestors(below)
            .skip(1)
            .find(|&i| self.has(i, &[side]) && self.has(i, any))
    }

    /// The link below `top` with such a name; the deepest, if `deepest`.
    fn below(&self, top: usize, any: &[&str], deepest: bool) -> Option<usize> {
        let mut found = (top + 1..self.words.len())
            .filter(|&i| self.model.is_below(i, top) && self.has(i, any));
        match deepest {
            true => found.next_back(),
            false => found.next(),
        }
    }

    fn arm(&self, side: &str) -> Arm {
        let Some(elbow) = self.first(side, ELBOW) else {
            return Arm::default();
        };
        Arm {
            shoulder: self.above(elbow, side, SHOULDER),
            elbow: Some(elbow),
            hand: self.below(elbow, HAND, true),
        }
    }

    fn leg(&self, side: &str) -> Leg {
        let Some(knee) = self.first(side, KNEE) else {
            return Leg::default();
        };
        let ankle = self.below(knee, ANKLE, false);
        Leg {
            hip: self.above(knee, side, HIP),
            knee: Some(knee),
            ankle,
            sole: ankle.map(|ankle| self.below(ankle, SOLE, true).unwrap_or(ankle)),
        }
    }
}
