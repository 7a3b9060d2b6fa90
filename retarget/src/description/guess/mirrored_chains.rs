//! Limbs without telling names: chains that mirror each other.

use k::nalgebra::{Point3, Vector3};

use super::limb::{ARM_JOINTS, HANGING, LimbKind};
use super::link_tree::LinkTree;
use super::shape::corners_of;

/// What ends within this share of a robot's height from its lowest point stands on the floor.
const LOWEST_SHARE: f64 = 0.05;

/// A pair of chains alike, `[left, right]`.
type Pair = [usize; 2];

/// Pairs of chains that mirror each other across one axis, the one that ends lowest first, and
/// which axis of the root is up.
struct MirroredPairs {
    pairs: Vec<Pair>,
    up: usize,
}

/// First moving links of `[arms, legs]`, each `[left, right]`, by geometry
/// alone; z is taken as up unless the chains lie across it.
pub(super) fn mirrored_starts(body: &LinkTree) -> [[Option<usize>; 2]; 2] {
    let Some(MirroredPairs { pairs, up }) = mirrored_pairs(body, &[]) else {
        return Default::default();
    };
    let both = |pair: &Pair| pair.map(Some);
    let none = [None, None];
    match &pairs[..] {
        [] => [none, none],
        [only] => match stand(body, only, up) && are_lowest(body, only, up) {
            true => [none, both(only)],
            false => [both(only), none],
        },
        [legs, .., arms] if stand(body, legs, up) => [both(arms), both(legs)],
        [.., arms] => [both(arms), none],
    }
}

/// The arms of a robot whose legs are known by their names: the pair that ends highest, if it
/// begins above them.
pub(super) fn mirrored_arms(body: &LinkTree, legs: &[usize]) -> [Option<usize>; 2] {
    let found = mirrored_pairs(body, legs);
    let arms = found.and_then(|MirroredPairs { pairs, up }| {
        let above = |link: usize| legs.iter().all(|&leg| body.at(link)[up] > body.at(leg)[up]);
        pairs.last().filter(|pair| pair.iter().all(|&arm| above(arm))).copied()
    });
    arms.map_or([None; 2], |pair| pair.map(Some))
}

/// The legs of a robot whose arms are known by their names.
pub(super) fn mirrored_legs(body: &LinkTree, arms: &[usize]) -> [Option<usize>; 2] {
    let found = mirrored_pairs(body, arms);
    let legs = found.and_then(|MirroredPairs { pairs, up }| {
        let first = pairs.first().copied();
        first.filter(|pair| stand(body, pair, up) && are_lowest(body, pair, up))
    });
    legs.map_or([None; 2], |pair| pair.map(Some))
}

/// The chain beside one whose name says its side: the only one that mirrors it.
pub(super) fn mirror_partner(
    body: &LinkTree,
    limb: usize,
    may_be: impl Fn(usize) -> bool,
) -> Option<usize> {
    let beside = |link: usize| body.is_moved(link) && body.carrier(link) == body.carrier(limb);
    let mut partners = (1..body.model.links.len())
        .filter(|&link| link != limb && beside(link) && may_be(link))
        .filter(|&link| mirror_axis(body, limb, link).is_some());
    partners.next().filter(|_| partners.next().is_none())
}

/// Pairs of chains, but those of limbs that begin at `known`.
fn mirrored_pairs(body: &LinkTree, known: &[usize]) -> Option<MirroredPairs> {
    let is_known = |link: usize| {
        let of =
            |&known: &usize| body.model.is_below(link, known) || body.model.is_below(known, link);
        known.iter().any(of)
    };
    let mut pairs = Vec::new();
    for parent in 0..body.model.links.len() {
        let starts: Vec<usize> = (1..body.model.links.len())
            .filter(|&link| body.is_moved(link) && body.carrier(link) == parent && !is_known(link))
            .collect();
        // Three chains alike and more are fingers, or wheels.
        let joints = |start: usize| body.turning(&body.path(start, LimbKind::Arm));
        let alike = |start: usize| starts.iter().filter(|&&s| joints(s) == joints(start)).count();
        let starts: Vec<usize> = starts
            .iter()
            .copied()
            .filter(|&start| alike(start) < 3 && joints(start) >= 2)
            .filter(|&start| !body.is_finger(start))
            .collect();
        for (index, &one) in starts.iter().enumerate() {
            for &other in &starts[index + 1..] {
                if let Some(axis) = mirror_axis(body, one, other) {
                    pairs.push((one, other, axis));
                }
            }
        }
    }
    // The lateral axis most pairs agree on.
    let votes = |axis: usize| pairs.iter().filter(|pair| pair.2 == axis).count();
    let lateral = [1, 0, 2].into_iter().max_by_key(|&axis| (votes(axis), axis == 1))?;
    let up = if lateral == 2 { 1 } else { 2 };
    let lowest = |pair: &(usize, usize, usize)| body.end(pair.0)[up];
    let mut pairs: Vec<_> = pairs.into_iter().filter(|pair| pair.2 == lateral).collect();
    pairs.sort_by(|a, b| lowest(a).total_cmp(&lowest(b)));
    let sided = |pair: (usize, usize, usize)| sided(body, [pair.0, pair.1], lateral);
    Some(MirroredPairs { pairs: pairs.into_iter().map(sided).collect(), up })
}

/// Which of two chains is the left one: by their names, else by where they end.
fn sided(body: &LinkTree, [one, other]: [usize; 2], lateral: usize) -> Pair {
    // Left is y where forward is x, and -x where forward is y.
    let sign = if lateral == 0 { -1.0 } else { 1.0 };
    let by_place = sign * (body.end(one)[lateral] - body.end(other)[lateral]) > 0.0;
    let first_is_left = match [one, other].map(|start| body.words[start].side()) {
        [Some(one), Some(other)] if one != other => one < other,
        _ => by_place,
    };
    if first_is_left { [one, other] } else { [other, one] }
}

/// Whether two chains have the joints of a leg and hang below their beginnings.
fn stand(body: &LinkTree, pair: &Pair, up: usize) -> bool {
    pair.iter().all(|&start| {
        let down = body.at(start) - body.end(start);
        1 + body.moved_below(start) >= 5 && down[up] > HANGING * down.norm()
    })
}

/// Whether a single pair that hangs can be the legs: it reaches as far down as anything of the
/// robot, and no lift or waist that rises from the base carries it. Arms hang, too.
fn are_lowest(body: &LinkTree, pair: &Pair, up: usize) -> bool {
    let heights = |is_part: &dyn Fn(usize) -> bool| {
        let links = (0..body.model.links.len()).filter(|&link| is_part(link));
        links.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], link| {
            let at = body.at(link)[up];
            [low.min(at), high.max(at)]
        })
    };
    // A frame on the floor below the robot is none of its parts.
    let is_part = |link: usize| body.is_moved(link) || body.model.links[link].mass_kg > 0.0;
    let is_of_pair = |link: usize| pair.iter().any(|&start| body.model.is_below(link, start));
    let [lowest, highest] = heights(&is_part);
    let [joints, _] = heights(&is_of_pair);
    let ends = pair.iter().filter_map(|&start| body.path(start, LimbKind::Leg).last().copied());
    let soles = ends.flat_map(|end| corners_of(body, end)).map(|corner| corner[up]);
    let reach = soles.fold(joints, f64::min);
    let near = LOWEST_SHARE * (highest - lowest);
    let carrier = body.carrier(pair[0]);
    let rises = carrier > 0 && body.at(carrier)[up] > body.at(0)[up] + near;
    reach <= lowest + near && !rises
}

/// The axis across which two chains mirror each other, if they do: where they are, or where
/// they begin and how long each of their segments is (one arm hangs, the other is held out).
fn mirror_axis(body: &LinkTree, one: usize, other: usize) -> Option<usize> {
    let [a, b] = [one, other].map(|start| {
        let path = body.path(start, LimbKind::Arm);
        path.into_iter().map(|link| body.at(link)).collect::<Vec<_>>()
    });
    if a.len() != b.len() || 1 + body.moved_below(one) < 2 {
        return None;
    }
    let size = a.iter().chain(&b).map(|p| (p - a[0]).norm()).fold(0.0, f64::max);
    let near = 0.05 * size + 1e-4;
    let begin = |axis: usize| (a[0][axis] - b[0][axis]).abs();
    let mirrors = |axis: usize| {
        let apart = begin(axis).max((a[a.len() - 1] - b[b.len() - 1])[axis].abs());
        let mirrored = |p: &Point3<f64>, q: &Point3<f64>| {
            let mut sum: Vector3<f64> = p.coords - q.coords;
            // Positions across add up to the same for every pair of points.
            sum[axis] = p[axis] + q[axis] - (a[0][axis] + b[0][axis]);
            sum.norm() < near
        };
        apart > 0.05 * size && a.iter().zip(&b).all(|(p, q)| mirrored(p, q))
    };
    let steps = |points: &[Point3<f64>]| {
        let pairs = points.windows(2).map(|pair| (pair[1] - pair[0]).norm());
        pairs.collect::<Vec<f64>>()
    };
    let alike =
        a.len() > ARM_JOINTS && steps(&a).iter().zip(steps(&b)).all(|(p, q)| (p - q).abs() < near);
    let begins = |axis: usize| begin(axis) > near && (0..3).all(|o| o == axis || begin(o) < near);
    (0..3).find(|&axis| mirrors(axis)).or_else(|| (0..3).find(|&axis| alike && begins(axis)))
}
