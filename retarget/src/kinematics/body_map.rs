//! Which link of the robot is which part of the body.
//!
//! Named in the configuration, or guessed from the names of links and joints
//! and from the tree: the chest is what both shoulders hang from, the pelvis
//! what both hips hang from. A part that is not there is left out, and with it
//! the movement that only it could show.

use crate::config::{BodyLinks, Limb, RetargetConfig, RetargetError};
use crate::description::guess::{anatomy, no_meshes, words::SIDES};
use crate::kinematics::RobotModel;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ArmLinks {
    pub shoulder: Option<usize>,
    pub elbow: Option<usize>,
    pub hand: Option<usize>,
}

/// Hip, knee, ankle and sole of one leg; link indices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LegLinks {
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
    pub arms: [ArmLinks; 2],
    pub legs: [LegLinks; 2],
}

impl BodyMap {
    /// The parts named in `config`, the others guessed.
    pub fn new(model: &RobotModel, config: &RetargetConfig) -> Result<Self, RetargetError> {
        let n: &BodyLinks = &config.body;
        let guess =
            anatomy(model, &vec![0.0; model.joint_names().len()], Some(config.kind), &no_meshes);
        let find = |part: &str, name: &Option<String>| match name {
            Some(name) => model.named(name, part).map(Some),
            None => Ok(None),
        };
        type Found = Result<Option<usize>, RetargetError>;
        let find_on =
            |side: usize, part: &str, name: &Option<String>, guessed: &Option<String>| -> Found {
                let found = find(&format!("{}_{part}", SIDES[side]), name)?;
                Ok(found.or_else(|| model.link(guessed.as_deref()?)))
            };
        let arm = |side: usize, [shoulder, elbow, hand]: [&Option<String>; 3]| {
            let guessed = &guess.arms[side];
            Ok::<_, RetargetError>(ArmLinks {
                shoulder: find_on(side, "shoulder", shoulder, &guessed.top)?,
                elbow: find_on(side, "elbow", elbow, &guessed.middle)?,
                hand: find_on(side, "hand", hand, &guessed.end)?,
            })
        };
        let leg = |side: usize, [hip, knee, ankle, sole]: [&Option<String>; 4]| {
            let guessed = &guess.legs[side];
            Ok::<_, RetargetError>(LegLinks {
                hip: find_on(side, "hip", hip, &guessed.top)?,
                knee: find_on(side, "knee", knee, &guessed.middle)?,
                ankle: find_on(side, "ankle", ankle, &guessed.end)?,
                sole: find_on(side, "sole", sole, &guessed.sole)?,
            })
        };
        let head = find("head", &n.head)?.or(guess.head);
        let arms = [
            arm(0, [&n.left_shoulder, &n.left_elbow, &n.left_hand])?,
            arm(1, [&n.right_shoulder, &n.right_elbow, &n.right_hand])?,
        ];
        let legs = [
            leg(0, [&n.left_hip, &n.left_knee, &n.left_ankle, &n.left_sole])?,
            leg(1, [&n.right_hip, &n.right_knee, &n.right_ankle, &n.right_sole])?,
        ];
        let between = |pair: [Option<usize>; 2]| match pair {
            [Some(left), Some(right)] => model.common_ancestor(left, right),
            _ => 0,
        };
        Ok(Self {
            chest: find("chest", &n.chest)?.unwrap_or_else(|| between(arms.map(|a| a.shoulder))),
            pelvis: find("pelvis", &n.pelvis)?.unwrap_or_else(|| between(legs.map(|l| l.hip))),
            head,
            arms,
            legs,
        })
    }

    pub fn shows(&self, model: &RobotModel) -> Vec<bool> {
        let mut shows = vec![false; model.joint_names().len()];
        let (arms, legs) = (self.arms.iter(), self.legs.iter());
        let arms = arms.flat_map(|arm| [arm.shoulder, arm.elbow, arm.hand]);
        let legs = legs.flat_map(|leg| [leg.hip, leg.knee, leg.ankle, leg.sole]);
        let parts = arms.chain(legs).chain([self.head, Some(self.chest)]);
        for link in parts.flatten() {
            for ancestor in &model.driven_ancestors[link] {
                shows[ancestor.joint] = true;
            }
        }
        shows
    }

    pub fn limbs(&self, model: &RobotModel) -> Vec<Limb> {
        let mut limbs = vec![Limb::Torso; model.joint_names().len()];
        let mut mark = |end: Option<usize>, stop: usize, limb: Limb| {
            for ancestor in end.map_or(&[][..], |end| &model.driven_ancestors[end]) {
                if !model.is_below(stop, ancestor.link) {
                    limbs[ancestor.joint] = limb;
                }
            }
        };
        for (arm, limb) in self.arms.iter().zip([Limb::LeftArm, Limb::RightArm]) {
            mark(arm.hand.or(arm.elbow), self.chest, limb);
        }
        for (leg, limb) in self.legs.iter().zip([Limb::LeftLeg, Limb::RightLeg]) {
            mark(leg.sole.or(leg.ankle), self.pelvis, limb);
        }
        mark(self.head, self.chest, Limb::Head);
        limbs
    }
}
