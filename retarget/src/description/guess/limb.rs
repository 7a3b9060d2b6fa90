//! One arm or leg: from the trunk to its end, and where it bends.

use k::nalgebra::{Point3, Vector3};

use super::link_tree::LinkTree;
use super::shape::{corners_of, far_end, rigid_with};
use super::words::{ANKLE, ELBOW, FOREARM, HAND, KNEE, NameWords, SHANK, SOLE, TOES};
use crate::kinematics::JointMotion;

/// Axes nearer to a segment than this cosine twist it; others bend it.
const TWIST: f64 = 0.8;
/// Length of fingers against the way to the hand that carries them.
const FINGER_SHARE: f64 = 0.35;
/// Joints between the root and a gripper.
pub(super) const ARM_JOINTS: usize = 4;
/// Joints of an arm that has a wrist.
const WHOLE_ARM: usize = 6;
/// Joints of an ankle are this near to the last one, of the way from the knee to the last.
const ANKLE_SHARE: f64 = 0.35;
/// A foot reaches as far down as its toes, within this share of the leg.
const LEVEL_SHARE: f64 = 0.02;
/// Toes begin within this share of the leg from the foot that carries them.
const TOES_SHARE: f64 = 0.4;
/// Joints within this share of a limb are at one place: a ball joint.
const BALL_SHARE: f64 = 0.01;
/// Cosine from which a chain that points so far down hangs.
pub(super) const HANGING: f64 = 0.7;
/// So many joints that slide, one after the other, are a telescope.
const TELESCOPE: usize = 2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LimbKind {
    Arm,
    Leg,
    /// A leg of four: it ends at the point that stands.
    Paw,
    /// An arm that is the whole robot: it ends where its gripper does.
    Lone,
}

/// The points of one limb. Link indices; the end may be a new point on a link.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct FoundLimb {
    pub top: Option<usize>,
    pub middle: Option<usize>,
    pub end: Option<usize>,
    pub sole: Option<usize>,
    /// Where the end is, in the frame of the named link, if no link's origin is.
    pub tip: Option<(usize, Point3<f64>)>,
    pub path: Vec<usize>,
}

impl FoundLimb {
    pub fn is_there(&self) -> bool {
        self.top.is_some() && (self.middle.is_some() || self.end.is_some() || self.tip.is_some())
    }
}

impl LinkTree<'_> {
    /// The link that carries a chain: the nearest above that is moved, or the root.
    pub fn carrier(&self, link: usize) -> usize {
        let mut above = self.model.ancestors(link).skip(1);
        above.find(|&up| self.is_moved(up)).unwrap_or(0)
    }

    /// Where the chain that begins at `start` ends.
    pub fn end(&self, start: usize) -> Point3<f64> {
        let path = self.path(start, LimbKind::Arm);
        self.at(path.last().copied().unwrap_or(start))
    }

    /// Whether a chain ends well below its beginning; z is up.
    pub fn hangs(&self, start: usize) -> bool {
        let down = self.at(start) - self.end(start);
        down.z > HANGING * down.norm()
    }

    /// Whether a chain is short beside the one that carries it, as at the end of an arm.
    pub fn is_finger(&self, start: usize) -> bool {
        let carrier = self.carrier(start);
        let carried: Vec<usize> = self.model.ancestors(carrier).collect();
        let path = self.path(start, LimbKind::Arm);
        let end = path.last().copied().unwrap_or(start);
        let length_m = self.way_m(end) - self.way_m(start);
        self.turning(&carried) >= ARM_JOINTS && length_m < FINGER_SHARE * self.way_m(carrier)
    }

    /// Whether a chain begins as a telescope: a tool at its end is no limb.
    pub fn is_telescope(&self, path: &[usize]) -> bool {
        let moved = path.iter().filter(|&&link| self.is_moved(link));
        let slides =
            |link: &&usize| matches!(self.model.links[**link].motion, JointMotion::Prismatic(_));
        moved.take(TELESCOPE).filter(slides).count() == TELESCOPE
    }

    /// Length of the way from the root's origin to a link, from joint to joint.
    pub fn way_m(&self, link: usize) -> f64 {
        let up: Vec<usize> = self.model.ancestors(link).collect();
        up.windows(2).map(|pair| (self.at(pair[0]) - self.at(pair[1])).norm()).sum()
    }

    /// Turning joints along a path.
    pub fn turning(&self, path: &[usize]) -> usize {
        let turns = |&&link: &&usize| {
            let motion = self.model.links[link].motion;
            self.is_moved(link) && matches!(motion, JointMotion::Revolute(_))
        };
        path.iter().filter(turns).count()
    }

    /// Whether the joint right above `link` is driven.
    pub fn is_moved(&self, link: usize) -> bool {
        let above = self.model.links[link].parent;
        above.is_some_and(|above| self.model.drives_above(link) > self.model.drives_above(above))
    }

    /// Whether the joint right above `link` follows another.
    pub fn follows(&self, link: usize) -> bool {
        let led = |joint: usize| self.model.joint_names()[joint] != self.model.parent_joints[link];
        self.model.links[link].drive.is_some_and(|drive| led(drive.joint))
    }

    /// Whether a link is a head: one that is called a camera is, too, if the joint that turns it
    /// is called a head's.
    pub fn is_head(&self, link: usize) -> bool {
        let by_joint = || NameWords::of_joint(self.model, link).is_head();
        self.words[link].is_head() || (self.is_moved(link) && by_joint())
    }

    /// Driven joints below `link` along the longest way.
    pub fn moved_below(&self, link: usize) -> usize {
        let below = self.children[link].iter();
        below
            .map(|&child| usize::from(self.is_moved(child)) + self.moved_below(child))
            .max()
            .unwrap_or(0)
    }

    /// From `start` along the limb to where it ends or splits into fingers.
    pub fn path(&self, start: usize, kind: LimbKind) -> Vec<usize> {
        let mut path = vec![start];
        let mut at = start;
        loop {
            let moving = self.moving_children(at);
            let bends = path.iter().filter(|&&link| self.is_moved(link)).count();
            let fingers = moving.iter().all(|&c| self.words[c].is_finger());
            let next = match moving[..] {
                [] => None,
                [only] if !(fingers && bends > 1) => Some(only),
                _ if bends > 2 => self.past_gears(at, &moving),
                _ => moving.into_iter().max_by_key(|&child| self.moved_below(child)),
            };
            let next = next.or_else(|| self.named_end(at, kind));
            let Some(next) =
                next.filter(|&next| kind != LimbKind::Leg || !self.are_toes(next, start))
            else {
                return path;
            };
            path.push(next);
            at = next;
        }
    }

    /// Children that lead on to joints, but wheels; without those that weigh nothing beside
    /// one that does: they are a drawing of a linkage.
    fn moving_children(&self, link: usize) -> Vec<usize> {
        let mut moving: Vec<usize> = self.children[link]
            .iter()
            .copied()
            .filter(|&child| self.is_moved(child) || self.moved_below(child) > 0)
            .filter(|&child| !self.words[child].is_wheel())
            .collect();
        if moving.len() > 1 && moving.iter().any(|&child| self.weighs(child)) {
            moving.retain(|&child| self.weighs(child));
        }
        moving
    }

    /// Whether a link or anything below has mass.
    fn weighs(&self, link: usize) -> bool {
        let below = |&other: &usize| self.model.is_below(other, link);
        let mut below = (link..self.model.links.len()).filter(below);
        below.any(|other| self.model.links[other].mass_kg > 0.0)
    }

    /// Whether a link is the toes of a foot that reaches the floor itself; the leg begins at
    /// `start`.
    fn are_toes(&self, link: usize, start: usize) -> bool {
        let foot = self.carrier(link);
        if !self.is_moved(link) || !self.words[link].has(TOES) || foot == start {
            return false;
        }
        let leg = self.at(foot) - self.at(start);
        let length = leg.norm();
        if (self.at(link) - self.at(foot)).norm() > TOES_SHARE * length {
            return false;
        }
        let reach = |link: usize| {
            let corners = corners_of(self, link);
            let along = corners.iter().map(|corner| (corner - self.at(start)).dot(&leg) / length);
            along.fold(f64::NEG_INFINITY, f64::max)
        };
        let links = link..self.model.links.len();
        let below = links.filter(|&other| self.model.is_below(other, link));
        let toes = below.map(reach).fold(f64::NEG_INFINITY, f64::max);
        match (reach(foot), toes) {
            (on_foot, on_toes) if on_foot.is_finite() && on_toes.is_finite() => {
                on_toes - on_foot < LEVEL_SHARE * length
            }
            // Without shapes their names have to do.
            _ => self.words[foot].has(ANKLE) || self.words[foot].has(&["foot"]),
        }
    }

    /// The one of several chains that is too long for a finger, and by far the longest: the
    /// others are gears or rods.
    fn past_gears(&self, carrier: usize, moving: &[usize]) -> Option<usize> {
        let reach_m = |child: usize| {
            let end = self.path(child, LimbKind::Arm).last().copied().unwrap_or(child);
            self.way_m(end) - self.way_m(carrier)
        };
        let mut chains: Vec<_> = moving.iter().map(|&child| (reach_m(child), child)).collect();
        chains.sort_by(|a, b| b.0.total_cmp(&a.0));
        let [(longest_m, limb), (next_m, _), ..] = chains[..] else {
            return None;
        };
        let finger_m = FINGER_SHARE * self.way_m(carrier);
        (longest_m > finger_m && longest_m > 2.0 * next_m).then_some(limb)
    }

    /// A fixed child whose name says that it is the limb's end.
    fn named_end(&self, link: usize, kind: LimbKind) -> Option<usize> {
        let far = |child: &usize| (self.at(*child) - self.at(link)).norm();
        let of_one_finger = |child: usize| kind == LimbKind::Arm && self.words[child].is_finger();
        let named = |names: &'static [&'static str]| {
            // Of a human's limbs only what hangs right there: an end further out is a tool.
            let fixed = match kind {
                LimbKind::Arm | LimbKind::Leg => self.children[link].clone(),
                _ => rigid_with(self.model, link).split_off(1),
            };
            fixed
                .into_iter()
                .filter(move |&child| !self.is_moved(child))
                .filter(move |&child| self.words[child].has(names))
                .filter(move |&child| !of_one_finger(child) && !self.words[child].is_camera())
                .filter(|child| far(child) > 1e-3)
        };
        let farthest = |names| named(names).max_by(|a, b| far(a).total_cmp(&far(b)));
        // A bumper, a toe or a patch of the sole's skin has a longer name than the sole.
        let plainest = |names| named(names).min_by_key(|&child| self.words[child].count());
        match kind {
            LimbKind::Arm | LimbKind::Lone => farthest(HAND),
            LimbKind::Leg if self.words[link].is_sole() => None,
            LimbKind::Leg => plainest(&["sole"]).or_else(|| plainest(&["foot"])),
            LimbKind::Paw => {
                let rigid = rigid_with(self.model, link).into_iter().skip(1);
                let last = rigid.max_by(|a, b| far(a).total_cmp(&far(b)));
                farthest(&["foot", "toe", "tip"])
                    .or_else(|| self.wheel_on(link))
                    .or(last.filter(|child| far(child) > 5e-3))
            }
        }
    }

    /// The wheel on which a leg stands.
    fn wheel_on(&self, link: usize) -> Option<usize> {
        let mut children = self.children[link].iter().copied();
        children.find(|&child| self.words[child].is_wheel() && self.moved_below(child) == 0)
    }

    pub fn limb(&self, path: Vec<usize>, kind: LimbKind) -> FoundLimb {
        let joint = |link: usize| self.is_moved(link) && !self.words[link].is_wheel();
        let moved: Vec<usize> = path.iter().copied().filter(|&l| joint(l)).collect();
        let (Some(&first), Some(&last)) = (moved.first(), path.last()) else {
            return FoundLimb::default();
        };
        let mut found = FoundLimb { path: path.clone(), ..FoundLimb::default() };
        let mut end = self.at(last);
        if kind == LimbKind::Arm || !self.words[last].has(SOLE) {
            // A last link whose origin is on its joint says nothing of its length.
            if let Some(&tip_link) = moved.last()
                && (self.at(last) - self.at(tip_link)).norm() < 5e-3
                && let Some(far) = far_end(self, tip_link)
                && kind != LimbKind::Leg
            {
                found.tip = Some((tip_link, self.poses[tip_link].inverse() * far));
                end = far;
            }
        }
        let middle = self.middle(&moved, end, kind);
        found.middle = middle;
        let Some(middle) = middle else {
            // One segment: the limb's end takes the middle's place.
            found.top = Some(self.top(&moved[..1], end).unwrap_or(first));
            found.end = Some(last);
            found.sole = (kind == LimbKind::Leg).then_some(last);
            return found;
        };
        let above: Vec<usize> = moved.iter().copied().take_while(|&l| l != middle).collect();
        found.top = self.top(&above, self.at(middle));
        match kind {
            LimbKind::Leg => self.foot(&mut found, middle, &moved, last),
            _ => self.hand(&mut found, middle, last, end, kind),
        }
        found
    }

    /// The elbow or knee: by name, else the bend whose shorter segment is the longest.
    fn middle(&self, moved: &[usize], end: Point3<f64>, kind: LimbKind) -> Option<usize> {
        let tiers: &[&[&str]] = match kind {
            LimbKind::Arm | LimbKind::Lone => &[ELBOW, FOREARM],
            LimbKind::Leg | LimbKind::Paw => &[KNEE, SHANK],
        };
        let first = self.at(*moved.first()?);
        let apart = |link: usize| (self.at(link) - first).norm();
        let whole = (end - first).norm().max(moved.iter().map(|&l| apart(l)).fold(0.0, f64::max));
        for tier in tiers {
            let named = moved.iter().skip(1).copied().filter(|&link| {
                let is_there = self.words[link].has(tier) && apart(link) > 0.1 * whole;
                is_there && !self.twists(link, end)
            });
            // Some call the part above the knee joint a knee.
            let joint = |link: &usize| NameWords::of_joint(self.model, *link).has(tier);
            let by_joint = named.clone().find(joint);
            if let Some(named) = by_joint.or_else(|| named.clone().next()) {
                return Some(named);
            }
        }
        // Lengths along the limb.
        let mut along = vec![0.0];
        for pair in moved.windows(2) {
            let step = (self.at(pair[1]) - self.at(pair[0])).norm();
            along.push(along.last().copied().unwrap_or(0.0) + step);
        }
        let last = moved.last().map_or(0.0, |&link| (end - self.at(link)).norm());
        let length = along.last().copied().unwrap_or(0.0) + last;
        if length < 1e-3 {
            return None;
        }
        // Of a hip's joints at one place none is a knee, however far down the leg they are.
        let at_one_place = |i: usize| {
            let bend = i + 1 < moved.len() && !self.twists(moved[i], end);
            bend && along[i + 1] - along[i] < BALL_SHARE * length
        };
        let in_ball = |i: usize| kind == LimbKind::Leg && (at_one_place(i) || at_one_place(i - 1));
        // A hand beyond six joints is no part of the forearm.
        let wrist = match moved {
            [.., last] if moved.len() >= WHOLE_ARM && kind != LimbKind::Leg => self.at(*last),
            _ => end,
        };
        let shorter_m = |link: usize| apart(link).min((wrist - self.at(link)).norm());
        (1..moved.len())
            .filter(|&i| (0.2..0.8).contains(&(along[i] / length)))
            .filter(|&i| !in_ball(i))
            .map(|i| moved[i])
            .filter(|&link| !self.twists(link, wrist))
            .max_by(|&a, &b| shorter_m(a).total_cmp(&shorter_m(b)))
    }

    /// The joint that the upper segment turns about: the last that bends it.
    fn top(&self, above: &[usize], middle: Point3<f64>) -> Option<usize> {
        let far = |link: usize| (middle - self.at(link)).norm();
        let farthest = above.iter().map(|&link| far(link)).fold(0.0, f64::max);
        above
            .iter()
            .rev()
            .copied()
            .find(|&link| far(link) > 0.6 * farthest && !self.twists(link, middle))
            .or_else(|| above.last().copied())
    }

    /// Whether the joint of `link` turns about the line to `to`.
    fn twists(&self, link: usize, to: Point3<f64>) -> bool {
        let JointMotion::Revolute(axis) = self.model.links[link].motion else {
            return true;
        };
        let line = to - self.at(link);
        line.try_normalize(1e-6)
            .is_some_and(|line| (self.poses[link] * axis.into_inner()).dot(&line).abs() > TWIST)
    }

    fn hand(
        &self,
        found: &mut FoundLimb,
        elbow: usize,
        last: usize,
        end: Point3<f64>,
        kind: LimbKind,
    ) {
        let whole = (end - self.at(elbow)).norm();
        let far = |link: usize| (self.at(link) - self.at(elbow)).norm();
        let below = found.path.iter().copied().skip_while(|&l| l != elbow).skip(1);
        let named = below
            .filter(|&link| self.words[link].has(HAND) && far(link) > 0.4 * whole)
            .find(|&link| far(link) > 5e-3)
            .filter(|_| kind == LimbKind::Arm);
        let plain = (far(last) > 0.25 * whole && far(last) > 5e-3).then_some(last);
        found.end = named.or(plain).or(match found.tip {
            Some(_) => None,
            None => Some(last),
        });
        if found.end.is_some() {
            found.tip = None;
        }
    }

    fn foot(&self, found: &mut FoundLimb, knee: usize, moved: &[usize], last: usize) {
        let far = |link: usize| (self.at(link) - self.at(knee)).norm();
        let below = || moved.iter().copied().skip_while(|&l| l != knee).skip(1);
        let farthest = below().map(far).fold(0.0, f64::max);
        let named = below().find(|&l| self.words[l].has(ANKLE) && far(l) > 0.4 * farthest);
        let lowest = moved.last().copied().unwrap_or(last);
        let to_lowest = |link: usize| (self.at(link) - self.at(lowest)).norm();
        let first = below().find(|&l| to_lowest(l) < ANKLE_SHARE * farthest && far(l) > 5e-3);
        found.end = named.or(first).or((far(last) > 5e-3).then_some(last));
        found.sole = Some(last);
    }
}

/// The length from top to middle and from middle to end, metres.
pub(super) fn limb_lengths(body: &LinkTree, found: &FoundLimb) -> [f64; 2] {
    let end = match (&found.tip, found.end) {
        (Some((link, at)), _) => Some(body.poses[*link] * at),
        (None, Some(link)) => Some(body.at(link)),
        _ => None,
    };
    let distance = |a: Option<Point3<f64>>, b: Option<Point3<f64>>| match (a, b) {
        (Some(a), Some(b)) => (b - a).norm(),
        _ => 0.0,
    };
    let (top, middle) = (found.top.map(|l| body.at(l)), found.middle.map(|l| body.at(l)));
    match middle {
        Some(_) => [distance(top, middle), distance(middle, end)],
        None => [distance(top, end), 0.0],
    }
}

pub(super) fn mean(points: &[Point3<f64>]) -> Option<Point3<f64>> {
    let sum: Vector3<f64> = points.iter().map(|point| point.coords).sum();
    (!points.is_empty()).then(|| Point3::from(sum / points.len() as f64))
}
