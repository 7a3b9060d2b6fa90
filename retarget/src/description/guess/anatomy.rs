//! What was guessed of one robot, by names of links.

use k::nalgebra::Point3;

use super::axes::BodyAxes;
use super::kind::KindGuess;
use super::limb::{FoundLimb, LimbKind, limb_lengths};
use super::link_tree::LinkTree;
use super::sole::{Sole, soles};
use super::wheels::DrivenWheel;
use super::words::SIDES;
use crate::config::Tip;
use crate::kinematics::RobotModel;

/// A sole so far from the origin of its link has a point of its own, metres.
const OFF_M: f64 = 0.005;
/// The same of a link that was described as the sole: makers put some below the ankle.
const FRAME_OFF_M: f64 = 0.02;

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
    pub wheels: Vec<DrivenWheel>,
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
            wheels: Vec::new(),
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
        if leg == LimbKind::Leg {
            for (side, sole) in soles(body, legs, &self.axes).into_iter().enumerate() {
                if let Some((link, sole)) = legs[side].sole.zip(sole) {
                    self.name_sole(body, link, &sole, side);
                }
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
        // A limb of one segment shows the upper half of the dancer's.
        if limb.middle.is_none() && kind != LimbKind::Paw {
            limb.middle = limb.end.take();
        }
        limb
    }

    fn name_sole(&mut self, body: &LinkTree, link: usize, sole: &Sole, side: usize) {
        if let Some([length_m, width_m]) = sole.size_m {
            let size_m = [length_m, width_m];
            let least = |old: [f64; 2]| [old[0].min(length_m), old[1].min(width_m)];
            self.sole_m = Some(self.sole_m.map_or(size_m, least));
        }
        let away_m = (sole.at - body.at(link)).norm();
        if away_m > if sole.is_frame { FRAME_OFF_M } else { OFF_M } {
            let at = body.poses[link].inverse() * sole.at;
            self.legs[side].sole =
                Some(self.tip(body, link, at, format!("{}_sole_tip", SIDES[side])));
        }
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
