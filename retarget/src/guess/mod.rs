//! Which link is which part of the body, where up and forward are, and how
//! thick the limbs are: from names where they say it, from geometry where they
//! do not. Used for what a robot file leaves out, and to write new ones.

mod axes;
mod capsules;
mod limb;
mod pairs;
mod shape;
pub(crate) mod words;

use k::nalgebra::{Isometry3, Point3};

use crate::RobotModel;
use crate::config::{CapsuleConfig, Tip};
use limb::{Body, Found, Kind};
use words::{SIDES, Words};

pub(crate) use axes::Axes;

/// Everything guessed of one robot. Pairs are `[left, right]`.
#[derive(Clone, Debug)]
pub(crate) struct Anatomy {
    pub arms: [Limb; 2],
    pub legs: [Limb; 2],
    pub head: Option<usize>,
    pub chest: usize,
    pub pelvis: usize,
    pub axes: Axes,
    /// Points that no link's origin is.
    pub tips: Vec<Tip>,
    /// Length and width of the soles, metres, if a foot has a shape.
    pub sole_m: Option<[f64; 2]>,
    /// How it was seen, a line each.
    pub reasons: Vec<String>,
}

/// One limb by names of links or tips.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Limb {
    pub top: Option<String>,
    pub middle: Option<String>,
    pub end: Option<String>,
    pub sole: Option<String>,
    /// Top to middle and middle to end, metres.
    pub lengths_m: [f64; 2],
    /// Links of the limb, first moving one first.
    pub path: Vec<usize>,
}

impl Limb {
    /// Whether anything of it can be shown.
    pub fn is_there(&self) -> bool {
        self.top.is_some() && (self.middle.is_some() || self.end.is_some())
    }
}

/// Looks at a robot that stands at zero (or the nearest its limits allow).
pub(crate) fn anatomy(model: &RobotModel, positions: &[f64]) -> Anatomy {
    let poses = model.link_poses(positions);
    let words: Vec<Words> = (0..model.links.len())
        .map(|i| Words::of(model, i))
        .collect();
    let mut children = vec![Vec::new(); model.links.len()];
    for (index, link) in model.links.iter().enumerate() {
        if let Some(parent) = link.parent {
            children[parent].push(index);
        }
    }
    let body = Body {
        model,
        words: &words,
        poses: &poses,
        children: &children,
    };
    let mut reasons = Vec::new();
    let mut starts = named_starts(&body);
    if starts.iter().flatten().all(Option::is_none) {
        starts = pairs::mirrored_starts(&body);
        if starts.iter().flatten().any(Option::is_some) {
            reasons.push(
                "names say nothing of arms and legs: chains that mirror each other are taken, \
                 the lower pair as legs"
                    .into(),
            );
        }
    }
    let find = |start: Option<usize>, kind| {
        start.map_or_else(Found::default, |start| {
            body.limb(body.path(start, kind), kind)
        })
    };
    let [arms, legs] = starts;
    let arms = arms.map(|start| find(start, Kind::Arm));
    let legs = legs.map(|start| find(start, Kind::Leg));
    let tops = |limbs: &[Found; 2]| {
        let [left, right] = limbs;
        (left.top, right.top)
    };
    let join = |pair: (Option<usize>, Option<usize>)| match pair {
        (Some(left), Some(right)) => model.common_ancestor(left, right),
        (Some(one), None) | (None, Some(one)) => above_limb(&body, one, &arms, &legs),
        (None, None) => 0,
    };
    let chest = join(tops(&arms));
    let pelvis = match tops(&legs) {
        (None, None) => 0,
        pair => join(pair),
    };
    let in_limb = |link: usize| {
        let limbs = arms.iter().chain(&legs);
        limbs.clone().any(|limb| {
            limb.path
                .first()
                .is_some_and(|&top| model.is_below(link, top))
        })
    };
    let head = find_head(&body, chest, &in_limb);
    let axes = axes::find(&body, &arms, &legs, head, chest, &mut reasons);
    let mut anatomy = Anatomy {
        arms: Default::default(),
        legs: Default::default(),
        head,
        chest,
        pelvis,
        axes,
        tips: Vec::new(),
        sole_m: None,
        reasons,
    };
    for side in 0..2 {
        anatomy.arms[side] = anatomy.name(&body, &arms[side], Kind::Arm, side);
        anatomy.legs[side] = anatomy.name(&body, &legs[side], Kind::Leg, side);
    }
    anatomy
}

impl Anatomy {
    /// Capsules around every link that has a shape or a length.
    pub fn capsules(&self, model: &RobotModel, positions: &[f64]) -> Vec<CapsuleConfig> {
        capsules::capsules(model, &model.link_poses(positions), self)
    }

    /// Whether both legs are complete enough to stand on.
    pub fn can_stand(&self, model: &RobotModel) -> bool {
        self.legs.iter().all(|leg| {
            let levers = |link: usize| model.levers[link].len();
            let end = leg.path.last().map_or(0, |&link| levers(link));
            let joints = end.saturating_sub(levers(self.pelvis));
            leg.middle.is_some() && leg.end.is_some() && leg.sole.is_some() && joints >= 5
        })
    }

    /// Names of a limb's points; new points become tips.
    fn name(&mut self, body: &Body, found: &Found, kind: Kind, side: usize) -> Limb {
        let link = |index: Option<usize>| index.map(|i| body.model.link_names()[i].clone());
        let mut limb = Limb {
            top: link(found.top),
            middle: link(found.middle),
            end: link(found.end),
            sole: link(found.sole),
            lengths_m: limb::lengths(body, found),
            path: found.path.clone(),
        };
        if let Some((on, at)) = found.tip {
            limb.end = Some(self.tip(body, on, at, format!("{}_hand_tip", SIDES[side])));
        }
        if kind == Kind::Leg
            && let Some(sole) = found.sole
            && let Some((at, size_m)) = axes::sole(body, sole, &self.axes)
        {
            self.sole_m = Some(
                self.sole_m
                    .map_or(size_m, |old| [old[0].min(size_m[0]), old[1].min(size_m[1])]),
            );
            let away = (body.poses[sole] * at - body.at(sole)).norm();
            // A link that is made to be the sole knows better.
            let made = !body.is_moved(sole) && body.words[sole].has(words::SOLE);
            if away > 0.005 && !made {
                limb.sole = Some(self.tip(body, sole, at, format!("{}_sole_tip", SIDES[side])));
            }
        }
        // A limb of one segment shows the upper half of the dancer's.
        if limb.middle.is_none() {
            limb.middle = limb.end.take();
        }
        limb
    }

    fn tip(&mut self, body: &Body, link: usize, at: Point3<f64>, name: String) -> String {
        let round = |v: f64| (v * 1e5).round() / 1e5;
        self.tips.push(Tip {
            name: name.clone(),
            link: body.model.link_names()[link].clone(),
            at_m: [round(at.x), round(at.y), round(at.z)],
        });
        name
    }
}

/// First moving links of `[arms, legs]`, each `[left, right]`, by their names.
fn named_starts(body: &Body) -> [[Option<usize>; 2]; 2] {
    [Kind::Arm, Kind::Leg].map(|kind| {
        [0, 1].map(|side| {
            let belongs = |link: usize| {
                let words = &body.words[link];
                let fits = match kind {
                    Kind::Arm => words.is_arm(),
                    Kind::Leg => words.is_leg(),
                };
                fits && words.side() == Some(side) && !words.is_finger() && !words.is_wheel()
            };
            (0..body.model.links.len())
                .filter(|&link| body.is_moved(link) && belongs(link))
                .filter(|&link| {
                    let mut above = body.model.ancestors(link).skip(1);
                    !above.any(|up| body.is_moved(up) && belongs(up))
                })
                .max_by_key(|&link| body.moved_below(link))
        })
    })
}

/// The trunk above a limb that has no partner.
fn above_limb(body: &Body, top: usize, arms: &[Found; 2], legs: &[Found; 2]) -> usize {
    let limbs = arms.iter().chain(legs);
    let first = limbs
        .filter_map(|limb| limb.path.first())
        .find(|&&first| body.model.is_below(top, first));
    first
        .and_then(|&first| body.model.links[first].parent)
        .unwrap_or(0)
}

/// The last moving link of the head: by name, else a short chain up from the
/// chest that is no limb.
fn find_head(body: &Body, chest: usize, in_limb: &impl Fn(usize) -> bool) -> Option<usize> {
    let moving =
        || (1..body.model.links.len()).filter(|&link| body.is_moved(link) && !in_limb(link));
    let named = moving()
        .filter(|&l| body.words[l].is_head())
        .max_by_key(|&link| {
            let skull = !body.words[link].has(&["neck"]);
            (skull, body.model.levers[link].len())
        });
    named.or_else(|| {
        moving()
            .filter(|&l| body.model.is_below(l, chest) && l != chest)
            .filter(|&l| body.words[l].side().is_none() && !body.words[l].is_wheel())
            .filter(|&l| body.moved_below(l) == 0)
            .find(|&l| body.model.levers[l].len() - body.model.levers[chest].len() <= 3)
    })
}

/// Positions at zero, or the nearest that the description allows.
pub(crate) fn zero(model: &RobotModel, robot: &urdf_rs::Robot) -> Vec<f64> {
    let held = |name: &String| {
        let joint = robot.joints.iter().find(|joint| joint.name == *name);
        joint.map_or(0.0, crate::model::held_position)
    };
    model.joint_names().iter().map(held).collect()
}

/// Origin of a link at these poses.
fn origin(poses: &[Isometry3<f64>], link: usize) -> Point3<f64> {
    Point3::from(poses[link].translation.vector)
}
