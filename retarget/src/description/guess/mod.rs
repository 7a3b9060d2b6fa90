//! Which link is which part of the body, where up and forward are, and how
//! thick the limbs are: from names where they tell, from geometry where they
//! do not. Used for what a robot file leaves out, and to write new ones.

mod anatomy;
mod axes;
mod capsules;
mod kind;
mod limb;
mod link_tree;
mod mirrored_chains;
mod shape;
mod sole;
mod wheels;
pub(crate) mod words;

use std::cmp::Ordering;

use crate::config::BodyKind;
use crate::kinematics::RobotModel;
pub use link_tree::{MeshReader, no_meshes};

use limb::{FoundLimb, LimbKind};
use link_tree::LinkTree;
use words::NameWords;

pub(crate) use anatomy::Anatomy;
pub(crate) use axes::BodyAxes;
pub(crate) use capsules::capsules;
pub(crate) use kind::{Confidence, KindGuess};
pub(crate) use sole::is_sole_frame;
pub(crate) use wheels::DrivenWheel;

/// Looks at a robot that stands at zero (or the nearest its limits allow). `kind` is
/// guessed where it is not given; of a quadruped the front legs are `arms`.
pub(crate) fn anatomy(
    model: &RobotModel,
    positions: &[f64],
    kind: Option<BodyKind>,
    meshes: &MeshReader,
) -> Anatomy {
    let poses = model.link_poses(positions);
    let words: Vec<NameWords> = (0..model.links.len()).map(|i| NameWords::of(model, i)).collect();
    let mut children = vec![Vec::new(); model.links.len()];
    for (index, link) in model.links.iter().enumerate() {
        if let Some(parent) = link.parent {
            children[parent].push(index);
        }
    }
    let body = LinkTree { model, words: &words, poses: &poses, children: &children, meshes };
    let mut found = match kind {
        Some(BodyKind::Quadruped) => quadruped(&body).unwrap_or_else(Anatomy::of_root),
        Some(BodyKind::Arm) => lone_arm(&body).unwrap_or_else(Anatomy::of_root),
        Some(BodyKind::Wheeled) => Anatomy::of_root(),
        Some(_) => human_like(&body),
        None => quadruped(&body).unwrap_or_else(|| human_like_or_arm(&body)),
    };
    found.wheels = wheels::driven_wheels(&body, &found.axes.up);
    if kind.is_none_or(|kind| kind == BodyKind::Wheeled) {
        found.kind = found.kind.or_else(|| wheels::wheeled(&found.wheels));
    }
    found
}

fn human_like_or_arm(body: &LinkTree) -> Anatomy {
    let human = human_like(body);
    let arms = human.arms.iter().filter(|arm| arm.is_there()).count();
    let legs = human.legs.iter().any(|leg| leg.is_there());
    let alone = arms == 0 || (arms == 1 && human.head.is_none());
    match lone_arm(body) {
        Some(arm) if alone && !legs => arm,
        _ => human,
    }
}

fn quadruped(body: &LinkTree) -> Option<Anatomy> {
    let four = kind::four_legs(body)?;
    let mut anatomy = Anatomy::of_root();
    anatomy.axes = BodyAxes { forward: four.forward, seen: four.named, ..anatomy.axes };
    let [left, right, hind_left, hind_right] = four.starts.map(|start| {
        let path = body.path(start, LimbKind::Paw);
        body.limb(path, LimbKind::Paw)
    });
    anatomy.name_limbs(body, [&left, &right], [&hind_left, &hind_right], [LimbKind::Paw; 2]);
    anatomy.kind = Some(KindGuess {
        kind: BodyKind::Quadruped,
        confidence: if four.named { Confidence::High } else { Confidence::Medium },
        reason: "four chains alike that begin at the corners of a rectangle and end level".into(),
    });
    Some(anatomy)
}

fn lone_arm(body: &LinkTree) -> Option<Anatomy> {
    let path = kind::lone_chain(body)?;
    let named = path.iter().any(|&link| body.words[link].is_arm());
    let joints = body.turning(&path);
    let found = body.limb(path, LimbKind::Lone);
    if !found.is_there() {
        return None;
    }
    let mut anatomy = Anatomy::of_root();
    let none = FoundLimb::default();
    anatomy.name_limbs(body, [&found, &none], [&none, &none], [LimbKind::Lone; 2]);
    anatomy.kind = Some(KindGuess {
        kind: BodyKind::Arm,
        confidence: if named { Confidence::High } else { Confidence::Medium },
        reason: format!("one chain of {joints} turning joints, no second arm and no leg"),
    });
    Some(anatomy)
}

fn human_like(body: &LinkTree) -> Anatomy {
    let model = body.model;
    let mut reasons = Vec::new();
    let mut starts = named_starts(body);
    one_limb_each(body, &mut starts);
    let unnamed = starts.map(|pair| pair.iter().all(Option::is_none));
    // Fingers of a gripper, or the sections of a telescope, have names of arms too.
    let [arms, _] = &mut starts;
    let turning = arms.map(|arm| arm.map_or(0, |arm| body.turning(&body.path(arm, LimbKind::Arm))));
    let is_hand = |arm: &Option<usize>| arm.is_some_and(|arm| !body.words[arm].is_upper_arm());
    let alone = arms.iter().flatten().count() == 1;
    let telescope =
        arms.iter().flatten().any(|&arm| body.is_telescope(&body.path(arm, LimbKind::Arm)));
    let stub = turning.iter().all(|joints| *joints < 2);
    let is_finger = |arm: &usize| !body.words[*arm].is_upper_arm() && body.is_finger(*arm);
    let fingers = arms.iter().flatten().all(is_finger);
    if fingers || (stub && (alone || arms.iter().any(is_hand))) || (alone && telescope) {
        *arms = [None; 2];
    }
    // Only a head shows arms by its antennas.
    let limbless = starts.iter().flatten().all(Option::is_none);
    let antennas = limbless.then(|| antenna_starts(body));
    let antennas = antennas.filter(|pair| pair.iter().all(Option::is_some));
    if let Some(pair) = antennas {
        starts[0] = pair;
        reasons.push("antennas show where the dancer's arms are".into());
    }
    let named = starts.iter().flatten().any(Option::is_some);
    if !named {
        starts = mirrored_chains::mirrored_starts(body);
        if starts.iter().flatten().any(Option::is_some) {
            reasons.push(
                "names say nothing of arms and legs: chains that mirror each other are taken, \
                 the lower pair as legs"
                    .into(),
            );
        }
    }
    let by_shape = named && add_by_shape(body, &mut starts, unnamed);
    if by_shape {
        reasons.push(
            "names tell of arms or of legs only: the others are chains that mirror each other"
                .into(),
        );
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
        (Some(one), None) | (None, Some(one)) => above_limb(body, one, &arms, &legs),
        (None, None) => 0,
    };
    let carrier = join(tops(&arms));
    // Antennas stand on the head itself.
    let crown = antennas
        .and_then(|_| model.ancestors(carrier).find(|&link| link > 0 && body.is_head(link)));
    let chest = crown.and_then(|link| model.links[link].parent).unwrap_or(carrier);
    let pelvis = match tops(&legs) {
        (None, None) => 0,
        pair => join(pair),
    };
    let in_limb = |link: usize| {
        let limbs = arms.iter().chain(&legs);
        limbs.clone().any(|limb| limb.path.first().is_some_and(|&top| model.is_below(link, top)))
    };
    let head = crown.or_else(|| find_head(body, chest, &in_limb));
    let axes = axes::find(body, &arms, &legs, head, chest, &mut reasons);
    let kind = kind::of_limbs(&arms, &legs, head, named && !by_shape).map(|guess| match antennas {
        Some(_) if guess.kind == BodyKind::UpperBody => {
            KindGuess { kind: BodyKind::Head, reason: "two antennas by names".into(), ..guess }
        }
        _ => guess,
    });
    let mut anatomy = Anatomy { kind, head, chest, pelvis, axes, reasons, ..Anatomy::of_root() };
    let ([left, right], [left_leg, right_leg]) = (&arms, &legs);
    let kinds = [LimbKind::Arm, LimbKind::Leg];
    anatomy.name_limbs(body, [left, right], [left_leg, right_leg], kinds);
    anatomy
}

/// First moving links of `[arms, legs]`, each `[left, right]`, by their names.
fn named_starts(body: &LinkTree) -> [[Option<usize>; 2]; 2] {
    [LimbKind::Arm, LimbKind::Leg].map(|kind| {
        let pair = [0, 1].map(|side| {
            let belongs = |link: usize| {
                let words = &body.words[link];
                let fits = match kind {
                    LimbKind::Arm => words.is_arm(),
                    _ => words.is_leg(),
                };
                fits && words.side() == Some(side) && !words.is_finger() && !words.is_wheel()
            };
            let starts: Vec<usize> = (0..body.model.links.len())
                .filter(|&link| body.is_moved(link) && belongs(link))
                .filter(|&link| {
                    let mut above = body.model.ancestors(link).skip(1);
                    !above.any(|up| body.is_moved(up) && belongs(up))
                })
                .collect();
            let most = starts.iter().copied().max_by_key(|&link| body.moved_below(link));
            // Two legs of one joint on one side are wheels that a maker counts as legs.
            let rolls = |&link: &usize| body.moved_below(link) == 0 && wheels::is_axle(body, link);
            let wheels = kind == LimbKind::Leg && starts.len() > 1 && starts.iter().all(rolls);
            most.filter(|_| !wheels).map(|link| first_of_side(body, link, side))
        });
        match pair {
            [Some(left), None] => [Some(left), partner(body, left, 0, kind)],
            [None, Some(right)] => [partner(body, right, 1, kind), Some(right)],
            pair => pair,
        }
    })
}

/// A chain that has words of an arm and of a leg is what most of its links are called, and a leg
/// where that is undecided and it hangs: one limb is not both.
fn one_limb_each(body: &LinkTree, starts: &mut [[Option<usize>; 2]; 2]) {
    let [arms, legs] = starts;
    for (side, (arm_start, leg_start)) in arms.iter_mut().zip(legs).enumerate() {
        let (Some(arm), Some(leg)) = (*arm_start, *leg_start) else { continue };
        let upper = match (body.model.is_below(leg, arm), body.model.is_below(arm, leg)) {
            (true, _) => arm,
            (_, true) => leg,
            _ => continue,
        };
        // A robot whose root is a foot carries its trunk, and so the other side, on that leg.
        let mut below = (upper..body.model.links.len()).filter(|&l| body.model.is_below(l, upper));
        if below.any(|l| body.is_moved(l) && body.words[l].side() == Some(1 - side)) {
            continue;
        }
        let path = body.path(upper, LimbKind::Arm);
        let count = |is: fn(&NameWords) -> bool| {
            path.iter().filter(|&&l| body.is_moved(l) && is(&body.words[l])).count()
        };
        let is_leg = match count(NameWords::is_leg).cmp(&count(NameWords::is_arm)) {
            Ordering::Equal => body.hangs(upper),
            more => more == Ordering::Greater,
        };
        let upper = Some(upper);
        (*arm_start, *leg_start) = if is_leg { (None, upper) } else { (upper, None) };
    }
}

/// Where names tell of arms only, or of legs only, the other pair by its shape. Whether there is
/// one.
fn add_by_shape(body: &LinkTree, starts: &mut [[Option<usize>; 2]; 2], unnamed: [bool; 2]) -> bool {
    let known: Vec<usize> = starts.iter().flatten().flatten().copied().collect();
    let (pair, found) = match unnamed {
        [true, false] => (0, mirrored_chains::mirrored_arms(body, &known)),
        [false, true] => (1, mirrored_chains::mirrored_legs(body, &known)),
        _ => return false,
    };
    let is_other = |link: usize| {
        let words = &body.words[link];
        words.is_wheel() || words.is_antenna() || words.is_on_head() || body.is_head(link)
    };
    if found.iter().flatten().next().is_none() || found.iter().flatten().any(|&l| is_other(l)) {
        return false;
    }
    starts[pair] = found;
    true
}

/// The limb beside one whose name says its side: by its name, else the chain that mirrors it
/// and is called nothing else.
fn partner(body: &LinkTree, limb: usize, side: usize, kind: LimbKind) -> Option<usize> {
    let may_be = |link: usize| {
        let words = &body.words[link];
        let is_other = match kind {
            LimbKind::Leg => words.is_arm(),
            _ => words.is_leg(),
        };
        words.side() != Some(side) && !is_other && !words.is_wheel() && !body.is_head(link)
    };
    let by_shape = || mirrored_chains::mirror_partner(body, limb, may_be);
    without_side(body, limb).or_else(by_shape)
}

/// The limb beside one with a side in its name: of the same name, but for that.
fn without_side(body: &LinkTree, limb: usize) -> Option<usize> {
    let name = body.words[limb].without_side();
    (1..body.model.links.len()).find(|&link| {
        let beside = body.is_moved(link) && body.carrier(link) == body.carrier(limb);
        let same = body.words[link].side().is_none() && body.words[link].without_side() == name;
        beside && same && body.moved_below(link) == body.moved_below(limb)
    })
}

/// The first moving link of the limb that goes through `link`: a shoulder whose name says only
/// its side belongs to the arm below it.
fn first_of_side(body: &LinkTree, link: usize, side: usize) -> usize {
    let side_of = |link: usize| body.words[link].side();
    // The R of WAIST_R means roll: both arms are below.
    let is_shared = |link: usize| {
        let mut below = (link..body.model.links.len()).filter(|&l| body.model.is_below(l, link));
        // A frame at a hand's right corner says nothing of the arm's side.
        below.any(|l| body.is_moved(l) && side_of(l).is_some_and(|other| other != side))
    };
    let moved = body.model.ancestors(link).filter(|&up| body.is_moved(up));
    moved.take_while(|&up| side_of(up) == Some(side) && !is_shared(up)).last().unwrap_or(link)
}

/// The moving links of a pair of antennas, left and right.
fn antenna_starts(body: &LinkTree) -> [Option<usize>; 2] {
    [0, 1].map(|side| {
        let mut links = 1..body.model.links.len();
        links.find(|&link| {
            let words = &body.words[link];
            body.is_moved(link) && words.is_antenna() && words.side() == Some(side)
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
    let named = moving().filter(|&l| body.is_head(l)).max_by_key(|&link| {
        let skull = body.words[link].has(&["head", "skull"]);
        (skull, body.model.drives_above(link))
    });
    // A head that is fixed to what turns it.
    let fixed = || {
        let links = 1..body.model.links.len();
        links
            .filter(|&link| !in_limb(link) && body.is_head(link))
            .find(|&link| body.model.drives_above(link) > body.model.drives_above(chest))
    };
    named.or_else(fixed).or_else(|| {
        let mut short: Vec<usize> = moving()
            .filter(|&l| body.model.is_below(l, chest) && l != chest)
            .filter(|&l| body.words[l].side().is_none() && !body.words[l].is_wheel())
            .filter(|&l| !body.words[l].is_trunk() && body.moved_below(l) == 0)
            .filter(|&l| !body.words[l].is_leg())
            .filter(|&l| body.model.drives_above(l) - body.model.drives_above(chest) <= 3)
            .filter(|&l| !body.follows(l))
            .collect();
        wheels::leave_out_pairs(body, &mut short);
        // Several of one joint each on one link are wheels without a name that says so.
        let carried = short.clone();
        let carrier = |link: usize| body.carrier(link);
        let alike = |l: usize| carried.iter().filter(|&&o| carrier(o) == carrier(l)).count();
        short.retain(|&link| alike(link) < kind::FINGERS);
        // Many short chains and no limb are fingers.
        let limbs = (1..body.model.links.len()).any(in_limb);
        short.first().copied().filter(|_| limbs || short.len() < kind::FINGERS)
    })
}
