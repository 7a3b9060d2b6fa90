//! Which link is which part of the body, where up and forward are, and how
//! thick the limbs are: from names where they tell, from geometry where they
//! do not. Used for what a robot file leaves out, and to write new ones.

mod anatomy;
mod axes;
mod capsules;
mod limb;
mod mirrored_chains;
mod shape;
pub(crate) mod words;

use crate::kinematics::RobotModel;
use limb::{FoundLimb, LimbKind, LinkTree};
use words::NameWords;

pub(crate) use anatomy::Anatomy;
pub(crate) use axes::BodyAxes;
pub(crate) use capsules::capsules;

/// Looks at a robot that stands at zero (or the nearest its limits allow).
pub(crate) fn anatomy(model: &RobotModel, positions: &[f64]) -> Anatomy {
    let poses = model.link_poses(positions);
    let words: Vec<NameWords> = (0..model.links.len()).map(|i| NameWords::of(model, i)).collect();
    let mut children = vec![Vec::new(); model.links.len()];
    for (index, link) in model.links.iter().enumerate() {
        if let Some(parent) = link.parent {
            children[parent].push(index);
        }
    }
    let body = LinkTree { model, words: &words, poses: &poses, children: &children };
    let mut reasons = Vec::new();
    let mut starts = named_starts(&body);
    if starts.iter().flatten().all(Option::is_none) {
        starts = mirrored_chains::mirrored_starts(&body);
        if starts.iter().flatten().any(Option::is_some) {
            reasons.push(
                "names say nothing of arms and legs: chains that mirror each other are taken, \
                 the lower pair as legs"
                    .into(),
            );
        }
    }
    let find = |start: Option<usize>, kind| {
        start.map_or_else(FoundLimb::default, |start| body.limb(body.path(start, kind), kind))
    };
    let [arms, legs] = starts;
    let arms = arms.map(|start| find(start, LimbKind::Arm));
    let legs = legs.map(|start| find(start, LimbKind::Leg));
    let tops = |limbs: &[FoundLimb; 2]| {
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
        limbs.clone().any(|limb| limb.path.first().is_some_and(|&top| model.is_below(link, top)))
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
        anatomy.arms[side] = anatomy.name(&body, &arms[side], LimbKind::Arm, side);
        anatomy.legs[side] = anatomy.name(&body, &legs[side], LimbKind::Leg, side);
    }
    anatomy
}

/// First moving links of `[arms, legs]`, each `[left, right]`, by their names.
fn named_starts(body: &LinkTree) -> [[Option<usize>; 2]; 2] {
    [LimbKind::Arm, LimbKind::Leg].map(|kind| {
        [0, 1].map(|side| {
            let belongs = |link: usize| {
                let words = &body.words[link];
                let fits = match kind {
                    LimbKind::Arm => words.is_arm(),
                    LimbKind::Leg => words.is_leg(),
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

fn above_limb(body: &LinkTree, top: usize, arms: &[FoundLimb; 2], legs: &[FoundLimb; 2]) -> usize {
    let limbs = arms.iter().chain(legs);
    let first =
        limbs.filter_map(|limb| limb.path.first()).find(|&&first| body.model.is_below(top, first));
    first.and_then(|&first| body.model.links[first].parent).unwrap_or(0)
}

/// The last moving link of the head: by name, else a short chain up from the
/// chest that is no limb.
fn find_head(body: &LinkTree, chest: usize, in_limb: &impl Fn(usize) -> bool) -> Option<usize> {
    let moving =
        || (1..body.model.links.len()).filter(|&link| body.is_moved(link) && !in_limb(link));
    let named = moving().filter(|&l| body.words[l].is_head()).max_by_key(|&link| {
        let skull = !body.words[link].has(&["neck"]);
        (skull, body.model.drives_above(link))
    });
    named.or_else(|| {
        moving()
            .filter(|&l| body.model.is_below(l, chest) && l != chest)
            .filter(|&l| body.words[l].side().is_none() && !body.words[l].is_wheel())
            .filter(|&l| body.moved_below(l) == 0)
            .find(|&l| body.model.drives_above(l) - body.model.drives_above(chest) <= 3)
    })
}
