//! Capsules around the links: how near the arms come to the rest of the body.
//!
//! One capsule a link, made of the largest simple shape drawn for it: along its
//! longest side, as thick as the mean of the others. Distances are closed forms
//! (nearest points of two segments: Ericson, Real-Time Collision Detection,
//! 2005, 5.1.9).

use crate::kinematics::{BodyMap, Capsule, RobotModel, capsule_of};
use k::nalgebra::{Isometry3, Point3, Vector3};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CapsulePair {
    one: Capsule,
    other: Capsule,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CapsuleGap {
    pub distance_m: f64,
    pub normal: Vector3<f64>,
    pub links: [usize; 2],
    pub points: [Point3<f64>; 2],
}

impl CapsulePair {
    pub fn gap(&self, poses: &[Isometry3<f64>]) -> CapsuleGap {
        let place = |capsule: &Capsule| capsule.ends.map(|end| poses[capsule.link] * end);
        let (a, b) = nearest(place(&self.one), place(&self.other));
        let between = a - b;
        let length = between.norm();
        let normal = match length > 1e-9 {
            true => between / length,
            // Lines that cross: any way out will do.
            false => Vector3::x(),
        };
        CapsuleGap {
            distance_m: length - self.one.radius_m - self.other.radius_m,
            normal,
            links: [self.one.link, self.other.link],
            points: [a, b],
        }
    }
}

/// Pairs worth watching: each arm against trunk, head, legs and the other
/// arm. Pairs that touch in every pose (neighbours in the tree) or already at
/// rest are left out.
pub(crate) fn pairs(
    model: &RobotModel,
    map: &BodyMap,
    rest: &[Isometry3<f64>],
) -> Vec<CapsulePair> {
    let capsules = capsules(model);
    let arm_of = |link: usize| {
        map.arms
            .iter()
            .position(|arm| arm.shoulder.is_some_and(|shoulder| model.is_below(link, shoulder)))
    };
    let mut pairs = Vec::new();
    for (index, one) in capsules.iter().enumerate() {
        for other in &capsules[index + 1..] {
            let sides = [arm_of(one.link), arm_of(other.link)];
            let watched = match sides {
                [None, None] => false,
                [Some(left), Some(right)] => left != right,
                _ => true,
            };
            let (one, other) = match sides[0] {
                Some(_) => (*one, *other),
                None => (*other, *one),
            };
            let pair = CapsulePair { one, other };
            if watched
                && !neighbours(model, one.link, other.link)
                && pair.gap(rest).distance_m > 0.0
            {
                pairs.push(pair);
            }
        }
    }
    pairs
}

/// Links with at most two driven joints between them cannot keep apart freely.
fn neighbours(model: &RobotModel, one: usize, other: usize) -> bool {
    let top = model.common_ancestor(one, other);
    let above = model.driven_ancestors[top].len();
    let joints =
        model.driven_ancestors[one].len() + model.driven_ancestors[other].len() - 2 * above;
    joints < 2
}

/// Those of the robot file, else one a link from its shapes.
fn capsules(model: &RobotModel) -> Vec<Capsule> {
    if !model.capsules.is_empty() {
        return model.capsules.clone();
    }
    let mut largest: Vec<(f64, Capsule)> = Vec::new();
    for visual in model.visuals() {
        let (volume, capsule) = capsule_of(visual);
        if !volume.is_finite() || volume <= 0.0 {
            continue;
        }
        match largest.iter_mut().find(|(_, c)| c.link == visual.link) {
            Some(known) if known.0 >= volume => {}
            Some(known) => *known = (volume, capsule),
            None => largest.push((volume, capsule)),
        }
    }
    largest.into_iter().map(|(_, capsule)| capsule).collect()
}

fn nearest(p: [Point3<f64>; 2], q: [Point3<f64>; 2]) -> (Point3<f64>, Point3<f64>) {
    let (d1, d2, r) = (p[1] - p[0], q[1] - q[0], p[0] - q[0]);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    let c = d1.dot(&r);
    const POINT: f64 = 1e-18;
    let (s, t) = if a <= POINT && e <= POINT {
        (0.0, 0.0)
    } else if a <= POINT {
        (0.0, (f / e).clamp(0.0, 1.0))
    } else if e <= POINT {
        ((-c / a).clamp(0.0, 1.0), 0.0)
    } else {
        let b = d1.dot(&d2);
        let parallel = a * e - b * b;
        let s = match parallel > 1e-12 * a * e {
            true => ((b * f - c * e) / parallel).clamp(0.0, 1.0),
            false => 0.5,
        };
        let t = (b * s + f) / e;
        match t {
            t if t < 0.0 => ((-c / a).clamp(0.0, 1.0), 0.0),
            t if t > 1.0 => (((b - c) / a).clamp(0.0, 1.0), 1.0),
            t => (s, t),
        }
    };
    (p[0] + d1 * s, q[0] + d2 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Point3<f64>> {
        prop::array::uniform3(-1.0..1.0_f64).prop_map(Point3::from)
    }

    proptest! {
        #[test]
        fn no_other_points_are_nearer(p in [point(), point()], q in [point(), point()]) {
            let (a, b) = nearest(p, q);
            let best = (a - b).norm();
            for i in 0..=20 {
                for j in 0..=20 {
                    let (s, t) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let other = (p[0] + (p[1] - p[0]) * s) - (q[0] + (q[1] - q[0]) * t);
                    prop_assert!(other.norm() >= best - 1e-9);
                }
            }
        }
    }

    #[test]
    fn crossing_lines_and_points_have_a_gap() {
        let p = [Point3::new(-1.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.0)];
        let q = [Point3::new(0.0, -1.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
        let (a, b) = nearest(p, q);
        assert!((a - b).norm() < 1e-12);
        let (a, b) = nearest([p[0]; 2], [q[0]; 2]);
        assert_eq!((a, b), (p[0], q[0]));
    }
}
