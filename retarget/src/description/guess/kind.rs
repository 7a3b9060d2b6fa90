//! Which kind of body a robot has: by the names of its limbs, else by how many chains
//! move and where they begin and end.

use super::limb::{FoundLimb, LimbKind};
use super::link_tree::LinkTree;
use crate::config::BodyKind;
use crate::kinematics::JointMotion;
use k::nalgebra::Vector3;

/// Joints of a chain that is an arm without a name that says so.
const ARM_JOINTS: usize = 4;
/// Six legs end level within this share of one: parts that their makers drew apart differ a bit.
const SIX_LEVEL: f64 = 0.05;
/// Cosine of axes that lie side by side.
const PARALLEL: f64 = 0.99;
/// Least share of a chain's length between two of its bends.
const SEGMENT_SHARE: f64 = 0.3;
/// Chains alike from one link that are fingers, not limbs.
pub(super) const FINGERS: usize = 3;

/// How sure a guess is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Confidence {
    /// Names and shape agree.
    High,
    /// One of them says so.
    Medium,
    /// Nothing speaks against it.
    Low,
}

servodance_types::named!(Confidence, "confidence" { High "high", Medium "medium", Low "low" });

/// A kind of body and what speaks for it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct KindGuess {
    pub kind: BodyKind,
    pub confidence: Confidence,
    pub reason: String,
}

/// Legs that begin ahead, behind and at the sides are seen from so much beside: the one ahead
/// is the front right then.
const ASKEW: f64 = 1e-3;

/// The first links of four legs: front left, front right, hind left, hind right.
/// `up` is found with them.
pub(super) struct FourLegs {
    pub starts: [usize; 4],
    pub forward: Vector3<f64>,
    pub named: bool,
}

/// Four chains from one link that begin at the corners of a rectangle and end alike.
pub(super) fn four_legs(body: &LinkTree) -> Option<FourLegs> {
    (0..body.model.links.len()).find_map(|carrier| {
        let starts: Vec<usize> = (1..body.model.links.len())
            .filter(|&link| body.is_moved(link) && body.carrier(link) == carrier)
            .filter(|&link| !body.words[link].is_wheel() && !body.is_head(link))
            .filter(|&link| body.turning(&body.path(link, LimbKind::Paw)) >= 2)
            .filter(|&link| !body.is_finger(link))
            .collect();
        rectangle(body, &lowest_four(body, starts))
    })
}

/// Of more chains than four those that end lowest (an arm on the back does not); of six legs
/// alike the first and last pairs.
fn lowest_four(body: &LinkTree, mut starts: Vec<usize>) -> Vec<usize> {
    starts.sort_by(|&a, &b| body.end(a).z.total_cmp(&body.end(b).z));
    let length_m = |link: usize| (body.end(link) - body.at(link)).norm();
    let level =
        |a: usize, b: usize| (body.end(a).z - body.end(b).z).abs() < SIX_LEVEL * length_m(a);
    let joints = |link: usize| body.turning(&body.path(link, LimbKind::Paw));
    let alike = starts.iter().all(|&start| joints(start) == joints(starts[0]));
    if starts.len() == 6 && alike && level(starts[0], starts[5]) {
        // Along the body the middle pair begins between the others.
        for axis in 0..2 {
            let along = |link: usize| body.at(link)[axis];
            starts.sort_by(|&a, &b| along(a).total_cmp(&along(b)));
            let apart = |a: usize, b: usize| along(starts[b]) - along(starts[a]);
            if apart(2, 3) < 0.1 * apart(0, 5) {
                starts.drain(2..4);
                break;
            }
        }
    }
    starts.truncate(4);
    starts
}

fn rectangle(body: &LinkTree, starts: &[usize]) -> Option<FourLegs> {
    let starts: [usize; 4] = starts.try_into().ok()?;
    let begins = starts.map(|link| body.at(link));
    let ends = starts.map(|link| body.end(link));
    let paths = starts.map(|link| body.path(link, LimbKind::Paw));
    let alike = paths.iter().all(|path| body.turning(path) == body.turning(&paths[0]));
    let length = (0..4).map(|leg| (ends[leg] - begins[leg]).norm()).fold(0.0, f64::max);
    let span = |points: &[k::nalgebra::Point3<f64>; 4], axis: usize| {
        let along = points.map(|point| point[axis]);
        along.iter().fold(f64::MIN, |a, b| a.max(*b))
            - along.iter().fold(f64::MAX, |a, b| a.min(*b))
    };
    let level = span(&begins, 2) < 0.25 * length && span(&ends, 2) < 0.25 * length;
    let corners = (0..2).all(|axis| span(&begins, axis) > 0.2 * length);
    let word = |link: usize, any: &[&str]| body.words[link].has(any);
    let front = |link: usize| word(link, &["front", "fore"]);
    let hind = |link: usize| word(link, &["hind", "rear", "back"]);
    let is_leg = |link: usize| body.words[link].is_leg();
    // Zero may be no pose to stand in: names of legs and corners tell, too.
    let by_names = starts.iter().all(|&link| is_leg(link) && (front(link) != hind(link)));
    // Arms begin above legs, not before them; fingers lie in one row.
    if !alike || !(level || by_names) || !corners || length < 1e-3 {
        return None;
    }
    let mean = |pick: &dyn Fn(usize) -> bool| {
        let picked = (0..4).filter(|&leg| pick(starts[leg])).map(|leg| begins[leg].coords);
        let picked: Vec<Vector3<f64>> = picked.collect();
        (picked.len() == 2).then(|| (picked[0] + picked[1]) * 0.5)
    };
    let middle = begins.iter().map(|at| at.coords).sum::<Vector3<f64>>() / 4.0;
    let (ahead, behind) = (mean(&front), mean(&hind));
    let seen = (ahead.is_some() || behind.is_some())
        .then(|| ahead.unwrap_or(middle) - behind.unwrap_or(middle));
    let forward = match seen {
        Some(way) if way.x.abs() >= way.y.abs() => Vector3::x() * way.x.signum(),
        Some(way) => Vector3::y() * way.y.signum(),
        None => Vector3::x(),
    };
    let left = Vector3::z().cross(&forward);
    let (ahead_of, left_of) = (forward + left * ASKEW, left - forward * ASKEW);
    let corner = |ahead: f64, side: f64| {
        let best = (0..4).max_by(|&a, &b| {
            let place = |leg: usize| {
                let at = begins[leg].coords - middle;
                ahead * at.dot(&ahead_of) + side * at.dot(&left_of)
            };
            place(a).total_cmp(&place(b))
        });
        best.map(|leg| starts[leg])
    };
    let distinct = |found: &[usize; 4]| (0..4).all(|a| (0..a).all(|b| found[a] != found[b]));
    let by_place = [corner(1.0, 1.0)?, corner(1.0, -1.0)?, corner(-1.0, 1.0)?, corner(-1.0, -1.0)?];
    // A leg may be drawn elsewhere than at the corner that it is named for.
    let of_name = |ahead: bool, side: usize| {
        let mut legs = starts.iter().copied();
        legs.find(|&l| front(l) == ahead && hind(l) != ahead && body.words[l].side() == Some(side))
    };
    let found = match distinct(&by_place) {
        true => by_place,
        false if by_names => {
            [of_name(true, 0)?, of_name(true, 1)?, of_name(false, 0)?, of_name(false, 1)?]
        }
        false => return None,
    };
    let named = starts.iter().all(|&link| is_leg(link) || front(link) || hind(link));
    distinct(&found).then_some(FourLegs { starts: found, forward, named })
}

/// The moving links of a lone arm, base first; `None` where chains are too short, or
/// several alike (fingers).
pub(super) fn lone_chain(body: &LinkTree) -> Option<Vec<usize>> {
    let links = 0..body.model.links.len();
    let starts = links.filter(|&link| {
        let first = body.is_moved(link) && body.carrier(link) == 0;
        first && !body.words[link].is_wheel() && !body.is_head(link)
    });
    let paths: Vec<Vec<usize>> = starts.map(|link| body.path(link, LimbKind::Lone)).collect();
    let longest = paths.iter().max_by_key(|path| body.turning(path))?;
    let joints = body.turning(longest);
    let alike = paths.iter().filter(|path| body.turning(path) == joints).count();
    let named = longest.iter().any(|&link| body.words[link].is_arm());
    let head = longest.iter().any(|&link| body.is_head(link));
    let enough = joints >= ARM_JOINTS || (named && joints >= 2) || reaches(body, longest);
    let enough = enough && !body.is_telescope(longest);
    (enough && alike < FINGERS && !head).then(|| longest.clone())
}

/// Whether a chain of three turning joints has an upper arm and a forearm: it bends twice, about
/// axes side by side. A neck pans and tilts.
fn reaches(body: &LinkTree, path: &[usize]) -> bool {
    let turns = |link: usize| match body.model.links[link].motion {
        JointMotion::Revolute(axis) if body.is_moved(link) => {
            Some((body.at(link), body.poses[link] * axis.into_inner()))
        }
        _ => None,
    };
    let joints: Vec<_> = path.iter().filter_map(|&link| turns(link)).collect();
    let whole_m = match path {
        [first, .., last] => body.way_m(*last) - body.way_m(*first),
        _ => 0.0,
    };
    joints.len() + 1 == ARM_JOINTS
        && joints.windows(2).any(|pair| {
            let [(at, axis), (next, along)] = [pair[0], pair[1]];
            let apart_m = (next - at).cross(&axis).norm();
            axis.dot(&along).abs() > PARALLEL && apart_m > SEGMENT_SHARE * whole_m
        })
}

/// The kind that the limbs that were found make.
pub(super) fn of_limbs(
    arms: &[FoundLimb; 2],
    legs: &[FoundLimb; 2],
    head: Option<usize>,
    named: bool,
) -> Option<KindGuess> {
    let count = |limbs: &[FoundLimb; 2]| limbs.iter().filter(|limb| limb.is_there()).count();
    let (arms, legs) = (count(arms), count(legs));
    let kind = match (arms, legs, head) {
        (1.., 1.., _) => BodyKind::Humanoid,
        (0, 1.., _) => BodyKind::Biped,
        (1.., 0, _) => BodyKind::UpperBody,
        (_, _, Some(_)) => BodyKind::Head,
        _ => return None,
    };
    let whole = |count: usize| count != 1;
    let confidence = match (named, whole(arms) && whole(legs)) {
        (true, true) => Confidence::High,
        (false, false) => Confidence::Low,
        _ => Confidence::Medium,
    };
    let by = if named { "names" } else { "shape" };
    let neck = if head.is_some() { "a head" } else { "no head" };
    Some(KindGuess {
        kind,
        confidence,
        reason: format!("{arms} arms, {legs} legs, {neck} by {by}"),
    })
}
