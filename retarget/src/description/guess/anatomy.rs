//! What was guessed of one robot, by names of links.

use k::nalgebra::Point3;

use super::axes::{self, BodyAxes};
use super::kind::KindGuess;
use super::limb::{FoundLimb, LimbKind, limb_lengths};
use super::link_tree::LinkTree;
use super::words::SIDES;
use crate::config::Tip;
use crate::kinematics::RobotModel;

/// Everything guessed of one robot. Pairs are `[left, right]`.
#[derive(Clone, Debug)]
pub(crate) struct Anatomy {
    /// `None`: nothing was found that can show a dance.
    pub kind: Option<KindGuess>,
    pub arms: [GuessedLimb; 2],
    pub legs: [GuessedLimb; 2],
    pub head: Option<usize>,
    pub chest: usize,
    pub pelvis: usize,
    pub axes: BodyAxes,
    pub tips: Vec<Tip>,
    /// Length and width of the soles, metres, if a foot has a shape.
    pub sole_m: Option<[f64; 2]>,
    pub reasons: Vec<String>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GuessedLimb {
    pub top: Option<String>,
    pub middle: Option<String>,
    pub end: Option<String>,
    pub sole: Option<String>,
    /// Top to middle and middle to end, metres.
    pub lengths_m: [f64; 2],
    pub path: Vec<usize>,
}

impl GuessedLimb {
    pub fn is_there(&self) -> bool {
        self.top.is_some() && (self.middle.is_some() || self.end.is_some())
    }
}

impl Anatomy {
    pub fn can_stand(&self, model: &RobotModel) -> bool {
        self.legs.iter().all(|leg| {
            let end = leg.path.last().map_or(0, |&link| model.drives_above(link));
            let joints = end.saturating_sub(model.drives_above(self.pelvis));
            leg.middle.is_some() && leg.end.is_some() && leg.sole.is_some() && joints >= 5
        })
    }

    /// Nothing found yet: all is the root.
    pub(super) fn of_root() -> Self {
        Self {
            kind: None,
            arms: Default::default(),
            legs: Default::default(),
            head: None,
            chest: 0,
            pelvis: 0,
            axes: BodyAxes::usual(),
            tips: Vec::new(),
            sole_m: None,
            reasons: Vec::new(),
        }
    }

    /// Takes the limbs over, arms and legs of these kinds.
    pub(super) fn name_limbs(
        &mut self,
        body: &LinkTree,
        arms: [&FoundLimb; 2],
        legs: [&FoundLimb; 2],
        [arm, leg]: [LimbKind; 2],
    ) {
        for side in 0..2 {
            self.arms[side] = self.name(body, arms[side], arm, side, "hand");
            self.legs[side] = self.name(body, legs[side], leg, side, "foot");
            if leg == LimbKind::Paw {
                self.legs[side].sole.clone_from(&self.legs[side].end);
            }
        }
    }

    fn name(
        &mut self,
        body: &LinkTree,
        found: &FoundLimb,
        kind: LimbKind,
        side: usize,
        end: &str,
    ) -> GuessedLimb {
        let link = |index: Option<usize>| index.map(|i| body.model.link_names()[i].clone());
        let mut limb = GuessedLimb {
            top: link(found.top),
            middle: link(found.middle),
            end: link(found.end),
            sole: link(found.sole),
            lengths_m: limb_lengths(body, found),
            path: found.path.clone(),
        };
        if let Some((on, at)) = found.tip {
            limb.end = Some(self.tip(body, on, at, format!("{}_{end}_tip", SIDES[side])));
        }
        if kind == LimbKind::Leg
            && let Some(sole) = found.sole
            && let Some((at, size_m)) = axes::sole(body, sole, &self.axes)
        {
            self.sole_m = Some(
                self.sole_m.map_or(size_m, |old| [old[0].min(size_m[0]), old[1].min(size_m[1])]),
            );
            let away = (body.poses[sole] * at - body.at(sole)).norm();
            // A link that is made to be the sole knows better.
            let made = !body.is_moved(sole) && body.words[sole].has(&["sole"]);
            if away > 0.005 && !made {
                limb.sole = Some(self.tip(body, sole, at, format!("{}_sole_tip", SIDES[side])));
            }
        }
        // A limb of one segment shows the upper half of the dancer's.
        if limb.middle.is_none() && kind != LimbKind::Paw {
            limb.middle = limb.end.take();
        }
        limb
    }

    fn tip(&mut self, body: &LinkTree, link: usize, at: Point3<f64>, name: String) -> String {
        let round = |v: f64| (v * 1e5).round() / 1e5;
        self.tips.push(Tip {
            name: name.clone(),
            link: body.model.link_names()[link].clone(),
            at_m: [round(at.x), round(at.y), round(at.z)],
        });
        name
    }
}
