//! How a body on four legs stands at rest: each foot under its hip, knees bent.

use k::nalgebra::Point3;

use super::rest_pose::RestSearch;
use crate::config::RetargetError;
use crate::contact::FourFeet;
use crate::solver::{SolverGoal, SolverInput};

/// Height of a hip over its foot, leg lengths: room to go up and down.
const STANDING: f64 = 0.85;
/// A leg that hangs by less than this share of its length is spread, not under the body.
const UNDER: f64 = 0.5;
/// A knee straighter than this is bent before the search, by so much, radians.
const STRAIGHT_RAD: f64 = 0.35;
const BEND_RAD: f64 = 0.8;
const STEPS: usize = 200;

impl RestSearch<'_> {
    /// Moves the solver to where the robot stands on all four feet.
    pub(super) fn stand_on_four(&mut self) -> Result<FourFeet, RetargetError> {
        let Some(links) = FourFeet::links(&self.map) else {
            return Err(RetargetError::Config {
                key: "kind".into(),
                value: "quadruped".into(),
                expected:
                    "a quadruped needs left_hand, right_hand (its front feet), left_sole and \
                           right_sole (its hind feet) in [retarget.body]"
                        .into(),
            });
        };
        let arms = self.map.arms.map(|leg| (leg.shoulder, leg.elbow));
        let legs = self.map.legs.map(|leg| (leg.hip, leg.knee));
        let tops = [arms[0], arms[1], legs[0], legs[1]];
        let poses = self.solver.poses(self.model).to_vec();
        let at = |link: usize| Point3::from(poses[link].translation.vector);
        let mut places = links.map(at);
        let mut lengths = [0.0; 4];
        for (leg, &(hip, knee)) in tops.iter().enumerate() {
            let (Some(hip), Some(knee)) = (hip, knee) else { continue };
            let foot = places[leg];
            let length = (at(hip) - at(knee)).norm() + (at(knee) - foot).norm();
            lengths[leg] = length;
            if at(hip).z - foot.z > UNDER * length {
                places[leg] = Point3::new(at(hip).x, foot.y, at(hip).z - STANDING * length);
                self.bend(knee, [at(hip), at(knee), foot], links[leg]);
            }
        }
        let start = self.solver.positions.clone();
        let limits = self.limits.iter();
        let bounds: Vec<(f64, f64)> = limits.map(|l| (l.lower_rad, l.upper_rad)).collect();
        self.solver.solve(
            self.model,
            &SolverInput {
                goal: SolverGoal::FourFeet { links: &links, places: &places },
                rest: &start,
                steps: STEPS,
                bounds: &bounds,
            },
        );
        let poses = self.solver.poses(self.model);
        let mut places = links.map(|link| Point3::from(poses[link].translation.vector));
        let floor = places.iter().map(|place| place.z).fold(f64::INFINITY, f64::min);
        for place in &mut places {
            place.z -= floor;
        }
        self.solver.base.translation.z -= floor;
        let leg_m = (lengths.iter().sum::<f64>() / 4.0).max(1e-3);
        let rates = [self.dt_s, self.config.preview_s];
        Ok(FourFeet::new(links, places, self.solver.base, leg_m, rates))
    }

    /// Bends a knee that is nearly straight: to the side with more room, else so that it
    /// points back.
    fn bend(&mut self, knee: usize, [hip, at, foot]: [Point3<f64>; 3], foot_link: usize) {
        let Some(joint) = self.model.driven_ancestors[knee].last().map(|a| a.joint) else {
            return;
        };
        if (at - hip).angle(&(foot - at)) > STRAIGHT_RAD {
            return;
        }
        let limits = self.limits[joint];
        let now = self.solver.positions[joint];
        let rooms = [now - limits.lower_rad, limits.upper_rad - now];
        let bent = |by: f64| limits.clamp_rad(now + by);
        let ahead = |by: f64| {
            let mut positions = self.solver.positions.clone();
            positions[joint] = bent(by);
            (self.upright * self.model.link_pose(foot_link, &positions)).translation.x
        };
        let both = rooms.iter().all(|room| *room > BEND_RAD);
        let up = if both { ahead(BEND_RAD) > ahead(-BEND_RAD) } else { rooms[1] > rooms[0] };
        self.solver.positions[joint] = bent(if up { BEND_RAD } else { -BEND_RAD });
    }
}
