//! From human frames to joint targets: the robot, its state and its settings.
//! One control cycle is in `cycle`.

mod arm_mount;
pub(crate) mod counts;
mod cycle;
mod four_feet_rest;
mod held_back;
mod joint_setup;
mod rest_pose;

use k::nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use servodance_types::{
    FRAME_RATE_HZ, HeldBack, JointLimits, MotionFrame, Placement, Posture, RigidLink, TouchPoint,
};

use crate::config::{BodyKind, Gains, Limb, RetargetConfig, RetargetError, Stance};
use crate::contact::{FourFeet, PlantedStance};
use crate::dancer::{
    ArmMount, BaselinePosture, HeadingReference, LOOKAHEAD_FRAMES, MOST_BASE_TURN, MotionBuffer,
    PoseReader, PostureTrack,
};
use crate::dynamics::{
    JointLoad, TorqueEstimator, TorqueReport, joint_loads, placement, rigid_links,
};
use crate::kinematics::{BodyMap, DrivenAncestor, JointMotion, RobotModel};
use crate::limits::{CollisionLimit, FeedForward, JointTracker};
use crate::solver::{ArmSearch, BodySolver, SolverScope};
use arm_mount::arm_mount;
use counts::RetargetCounts;
use rest_pose::{Footing, RestSearch};

/// A joint of a leg: the link that it moves, and its axis in that link.
pub(crate) struct LegJoint {
    pub link: usize,
    pub joint: usize,
    pub axis: Vector3<f64>,
}

/// Seconds of a control cycle.
fn period_s(control_hz: f64) -> Result<f64, RetargetError> {
    match (1.0..=10_000.0).contains(&control_hz) {
        true => Ok(1.0 / control_hz),
        false => Err(RetargetError::Config {
            key: "control_hz".into(),
            value: control_hz.to_string(),
            expected: "expected 1 to 10000".into(),
        }),
    }
}

/// What a robot with or without a waist takes for the dancer's heading.
fn heading_reference(config: &RetargetConfig, waist: bool) -> HeadingReference {
    match (config.stance, waist) {
        _ if !config.kind.is_human_like() || !config.wheel.is_empty() => HeadingReference::Slow,
        (Stance::Planted | Stance::Stepping, _) => HeadingReference::Slow,
        (Stance::Hung, true) => HeadingReference::Pelvis,
        (Stance::Hung, false) => HeadingReference::Chest,
    }
}

/// Turns human motion into joint targets for one robot.
pub struct Retargeter {
    model: RobotModel,
    map: BodyMap,
    limits: Vec<JointLimits>,
    /// The same, narrower where a dance keeps nearer to rest.
    dance_limits: Vec<JointLimits>,
    jerk_rad_s3: Vec<f64>,
    limbs: Vec<Limb>,
    stands_on: Vec<bool>,
    rest: Vec<f64>,
    yaws: Vec<usize>,
    gains: Gains,
    amplitude: f64,
    /// Share of the amplitude that the robot's senses allow.
    caution: f64,
    /// Whether the robot leans as planned: without that no foot lifts.
    is_steady: bool,
    mirror: bool,
    dt_s: f64,
    preview_s: f64,
    motion: MotionBuffer,
    postures: PostureTrack,
    /// What is usual for the dancer while the first pose is taken up.
    taken_up: Option<BaselinePosture>,
    reader: PoseReader,
    solver: BodySolver,
    search: ArmSearch,
    kind: BodyKind,
    arm_mount: ArmMount,
    stance: Option<PlantedStance>,
    four_feet: Option<FourFeet>,
    trackers: Vec<JointTracker>,
    bounds: Vec<(f64, f64)>,
    leg_bounds: Vec<(f64, f64)>,
    collision_limit: CollisionLimit,
    wanted: Vec<f64>,
    /// The solution as the limbs' shares show it, for the governor.
    planned: Vec<f64>,
    output: Vec<f64>,
    held: Vec<HeldBack>,
    poses: Vec<Isometry3<f64>>,
    upright: Isometry3<f64>,
    sole_m: [f64; 2],
    torque: TorqueEstimator,
    counts: RetargetCounts,
    /// For how long a dance has been shown.
    danced_s: f64,
    /// Joint positions that were asked for before the dance began, radians.
    before_dance: Vec<f64>,
    feed_forward: FeedForward,
}

impl Retargeter {
    /// Prepares the robot of a URDF text whose actuated joints are `joints`, in
    /// the order of all position slices.
    /// Fails with the joint, link or key that is wrong, and lists the choices.
    pub fn new(
        urdf_xml: &str,
        config: &RetargetConfig,
        joints: &[(String, JointLimits)],
        control_hz: f64,
    ) -> Result<Self, RetargetError> {
        config.check()?;
        let dt_s = period_s(control_hz)?;
        let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
        let model = RobotModel::configured(urdf_xml, &names, config)?;
        let mut limits = joint_setup::usable_limits(joints, config.margin)?;
        let jerk_rad_s3 = joint_setup::jerk_limits(&model, &limits, config)?;
        let map = BodyMap::new(&model, config)?;
        let upright = joint_setup::upright_rotation(config)?;

        let stands = config.stance.stands() && config.kind != BodyKind::Quadruped;
        let scope = match stands {
            true => SolverScope::Upper,
            false => SolverScope::Hung,
        };
        let mut solver = BodySolver::new(&model, map, config.weights, &limits, upright, scope);
        let waist = model.drives_above(map.chest) > 0;
        // The front legs of a quadruped are no arms to search better answers for.
        let searched = match config.kind {
            BodyKind::Quadruped => BodyMap { arms: Default::default(), ..map },
            _ => map,
        };
        let limbs = map.limbs(&model);
        let is_leg = |limb: &Limb| matches!(limb, Limb::LeftLeg | Limb::RightLeg);
        let upright = Isometry3::from_parts(Translation3::identity(), upright);
        let loads = match config.kind {
            BodyKind::Quadruped => vec![Limb::Torso; limbs.len()],
            _ => joint_setup::load_limbs(&limbs, stands),
        };
        let torque = joint_setup::torque_estimator(&model, config, &loads, dt_s)?;
        let arm_mount = arm_mount(&model, &map.arms[0], &upright, &limits);
        solver.turning_base = joint_setup::turning_base(&model, config, upright)?;
        let footing = RestSearch {
            model: &model,
            map,
            config,
            upright,
            arm_mount: &arm_mount,
            dt_s,
            limits: &mut limits,
            solver: &mut solver,
        }
        .run()?;
        let (stance, four_feet) = match footing {
            Footing::None => (None, None),
            Footing::Two(stance) => (Some(*stance), None),
            Footing::Four(feet) => (None, Some(*feet)),
        };
        let rest = solver.positions.clone();
        let yaws = joint_setup::yaw_joints(&model, &upright, &rest);
        let dance_limits = joint_setup::near_rest(&yaws, &rest, &limits);
        let search = ArmSearch::new(&model, &searched, config.weights, &dance_limits, dt_s);
        let bounds = limits.iter().map(|l| (l.lower_rad, l.upper_rad)).collect();
        let mut retargeter = Self {
            stands_on: limbs.iter().map(|l| stands && is_leg(l)).collect(),
            limbs,
            gains: config.gain,
            amplitude: config.amplitude,
            caution: 1.0,
            is_steady: true,
            mirror: config.mirror,
            dt_s,
            preview_s: config.preview_s,
            motion: MotionBuffer::new(),
            postures: PostureTrack::new(),
            taken_up: None,
            reader: PoseReader::new(heading_reference(config, waist), dt_s),
            kind: config.kind,
            arm_mount,
            stance,
            four_feet,
            trackers: Vec::new(),
            leg_bounds: vec![(0.0, 0.0); limits.len()],
            bounds,
            collision_limit: CollisionLimit::new(limits.len(), dt_s),
            wanted: vec![0.0; limits.len()],
            planned: vec![0.0; limits.len()],
            output: vec![0.0; limits.len()],
            held: vec![HeldBack::Nothing; limits.len()],
            poses: vec![Isometry3::identity(); model.links.len()],
            upright,
            sole_m: config.sole_m,
            torque,
            counts: RetargetCounts::default(),
            danced_s: 0.0,
            before_dance: vec![0.0; limits.len()],
            feed_forward: FeedForward::new(limits.len()),
            model,
            map,
            limits,
            dance_limits,
            jerk_rad_s3,
            solver,
            search,
            rest: rest.clone(),
            yaws,
        };
        retargeter.start_at(&rest);
        Ok(retargeter)
    }

    /// The robot's tree and shapes.
    pub fn model(&self) -> &RobotModel {
        &self.model
    }

    /// The natural pose, arms down: radians. The first output, if not seeded.
    pub fn rest(&self) -> &[f64] {
        &self.rest
    }

    /// The last output; rest, or where it was seeded, before there is any.
    pub fn positions_rad(&self) -> &[f64] {
        &self.output
    }

    /// Starts, standing still, from where the robot really is.
    /// Fails on a wrong number of positions, or one that is not finite.
    pub fn seed(&mut self, present_rad: &[f64]) -> Result<(), RetargetError> {
        self.check_length(present_rad.len())?;
        if let Some(index) = present_rad.iter().position(|p| !p.is_finite()) {
            return Err(RetargetError::NotFinite {
                joint: self.model.joint_names()[index].clone(),
            });
        }
        self.start_at(present_rad);
        Ok(())
    }

    /// Takes in the next human frame. Frames that cannot be used are counted.
    pub fn push(&mut self, frame: &MotionFrame) {
        self.motion.push(frame, &mut self.counts);
    }

    /// Takes in the next human frame of a dance that another program has watched
    /// for longer, with the baseline posture known there: several robots that
    /// began at different times move alike by it.
    pub fn push_with_posture(&mut self, frame: &MotionFrame, posture: &Posture) {
        self.push(frame);
        if frame.is_finite() {
            self.postures.push(frame.time_s, posture);
        }
    }

    /// How far ahead of the output the human pose is taken in, seconds.
    pub fn preview_s(&self) -> f64 {
        self.trackers.first().map_or(self.preview_s, |t| t.preview_cycles() as f64 * self.dt_s)
    }

    /// How far beyond the asked time frames must have been pushed, seconds.
    pub fn lookahead_s(&self) -> f64 {
        LOOKAHEAD_FRAMES as f64 / FRAME_RATE_HZ + self.preview_s()
    }

    /// Events so far: limits that held a joint back, frames that were refused.
    pub fn counts(&self) -> &RetargetCounts {
        &self.counts
    }

    /// What the motion cost the motors so far: estimated torque and heat.
    pub fn torque_report(&self) -> TorqueReport {
        self.torque.report(self.model.joint_names())
    }

    /// Estimated torque of each joint in the last cycle, newton metres (newtons where the
    /// joint slides); zero in the first cycles.
    pub fn torque_nm(&self) -> &[f64] {
        self.torque.torque_nm()
    }

    /// Work of all solvers so far: multiplications of their factorisations and of
    /// the search for better arms, roughly. Differences between cycles show how
    /// evenly the work is spread, on a busy machine as well.
    pub fn work(&self) -> u64 {
        let stance = self.stance.as_ref();
        self.solver.work()
            + self.search.work()
            + self.collision_limit.work()
            + self.trackers.iter().map(JointTracker::work).sum::<u64>()
            + stance.map_or(0, |s| s.legs.work() + s.pelvis.work())
            + self.four_feet.as_ref().map_or(0, FourFeet::work)
    }

    /// Sets the share of the movement around the rest pose, 0 to 1.
    pub fn set_amplitude(&mut self, amplitude: f64) {
        if amplitude.is_finite() {
            self.amplitude = amplitude.clamp(0.0, 1.0);
        }
    }

    /// Sets the share of the amplitude that is shown while the robot senses less than it
    /// should, 0 to 1.
    pub fn set_caution(&mut self, share: f64) {
        self.caution = share.clamp(0.0, 1.0);
    }

    /// Sends joints that do not stand ahead by their velocity times so many seconds, for servos
    /// that make fast movements smaller. With 0, as at first, targets are where the robot is to
    /// be.
    pub fn set_feed_forward(&mut self, seconds: f64) {
        self.feed_forward.set(seconds);
    }

    /// Says whether the robot leans as planned: while it does not, no foot lifts for a step.
    pub fn set_steady(&mut self, is_steady: bool) {
        self.is_steady = is_steady;
    }

    /// Dances as the mirror image, or not.
    pub fn set_mirror(&mut self, mirror: bool) {
        self.mirror = mirror;
    }

    /// The robot's links for a physics engine. Those of a robot on its feet touch the
    /// floor by their soles; shapes that reach below the floor at rest do not.
    pub fn rigid_links(&self) -> Vec<RigidLink> {
        let feet = self.stance.as_ref().map(|stance| (&stance.home, self.sole_m));
        let four = self.four_feet.as_ref().map(|feet| &feet.links);
        let mut links = rigid_links(&self.model, &self.map, feet, four);
        if feet.is_some() || four.is_some() {
            for (link, pose) in links.iter_mut().zip(self.rest_poses()) {
                let above =
                    |touch: &TouchPoint| (pose * Point3::from(touch.at_m)).z > touch.radius_m;
                link.touch.retain(|touch| touch.foot.is_some() || above(touch));
            }
        }
        links
    }

    /// For each leg of a robot on its feet its turning joints, from the hip down; `None`
    /// on a stand.
    pub(crate) fn standing_legs(&self) -> Option<[Vec<LegJoint>; 2]> {
        self.stance.as_ref()?;
        Some(self.map.legs.map(|leg| {
            let sole = leg.sole.unwrap_or(0);
            let own = |ancestor: &&DrivenAncestor| self.stands_on[ancestor.joint];
            let ancestors = self.model.driven_ancestors[sole].iter().filter(own);
            let turning =
                ancestors.filter_map(|ancestor| match self.model.links[ancestor.link].motion {
                    JointMotion::Revolute(axis) => {
                        let axis = axis.into_inner() * ancestor.scale.signum();
                        Some(LegJoint { link: ancestor.link, joint: ancestor.joint, axis })
                    }
                    _ => None,
                });
            turning.collect()
        }))
    }

    /// Poses of the links at rest, in the world.
    pub(crate) fn rest_poses(&self) -> Vec<Isometry3<f64>> {
        let mut poses = vec![Isometry3::identity(); self.model.links.len()];
        self.model.place(&self.world_from_root(&self.rest), &self.rest, &mut poses);
        poses
    }

    /// Mass, kilograms, and height of the centre of mass at rest, metres.
    pub(crate) fn mass_and_height(&self) -> (f64, f64) {
        let masses = self.model.links.iter().map(|link| link.mass_kg);
        (masses.sum(), self.model.centre_of_mass(&self.rest_poses()).z)
    }

    /// How far outside the soles the planned centre of mass would be if it were moved by
    /// `shift`, metres; negative inside, and on a stand.
    pub(crate) fn outside_soles_m(&self, shift: Vector3<f64>) -> f64 {
        let support = self.stance.as_ref().and_then(|stance| stance.legs.support.as_ref());
        let com = self.model.centre_of_mass(&self.poses) + shift;
        support.map_or(f64::NEG_INFINITY, |support| support.outside_m(&com))
    }

    pub(crate) fn period_s(&self) -> f64 {
        self.dt_s
    }

    pub(crate) fn upright(&self) -> UnitQuaternion<f64> {
        self.upright.rotation
    }

    /// What each joint carries at rest.
    pub fn joint_loads(&self) -> Vec<JointLoad> {
        let carries: Vec<bool> = match self.four_feet {
            None => self.stands_on.clone(),
            Some(ref feet) => {
                let below = feet.links.iter().flat_map(|&foot| &self.model.driven_ancestors[foot]);
                let mut carries = vec![false; self.limits.len()];
                below.for_each(|ancestor| carries[ancestor.joint] = true);
                carries
            }
        };
        joint_loads(&self.model, &self.rest_poses(), &carries)
    }

    /// The joints that turn about the vertical at rest: they stay within a quarter turn of it.
    pub fn yaw_joints(&self) -> &[usize] {
        &self.yaws
    }

    /// The joints that do not belong to legs.
    pub fn upper_joints(&self) -> Vec<usize> {
        let is_leg = |joint: &usize| matches!(self.limbs[*joint], Limb::LeftLeg | Limb::RightLeg);
        (0..self.limbs.len()).filter(|joint| !is_leg(joint)).collect()
    }

    /// [`world_from_root`](Self::world_from_root) as plain numbers.
    pub fn root_placement(&self, positions: &[f64]) -> Placement {
        placement(&self.world_from_root(positions))
    }

    /// How far the robot leans from its rest pose until its centre of mass is above an edge
    /// of the soles, radians; `None` without two feet that stand.
    pub fn tipping_angle_rad(&self) -> Option<f64> {
        let stance = self.stance.as_ref()?;
        let mut poses = self.poses.clone();
        self.model.place(&self.world_from_root(&self.rest), &self.rest, &mut poses);
        let com = self.model.centre_of_mass(&poses);
        Some((-stance.governed.outside_m(&com)).atan2(com.z))
    }

    /// Which feet stand on the floor, left and right; `None` on a stand.
    pub fn feet_down(&self) -> Option<[bool; 2]> {
        self.stance.as_ref().map(PlantedStance::down)
    }

    /// Where the root link is, in a world with its floor at z = 0 (planted) or
    /// its origin in the root link (hung), while the joints are at `positions`.
    pub fn world_from_root(&self, positions: &[f64]) -> Isometry3<f64> {
        let seen = |link: usize| self.model.link_pose(link, positions);
        match (&self.stance, &self.four_feet) {
            (Some(stance), _) => stance.world_from_root(&self.map, seen),
            (None, Some(feet)) => {
                let point = |link: usize| Point3::from(seen(link).translation.vector);
                feet.world_from_root(feet.links.map(point))
            }
            (None, None) => match &self.solver.turning_base {
                Some(base) => base.turned(base.turn_rad(positions, &self.rest)),
                None => self.upright,
            },
        }
    }

    fn check_length(&self, actual: usize) -> Result<(), RetargetError> {
        let expected = self.limits.len();
        match actual == expected {
            true => Ok(()),
            false => Err(RetargetError::Length { expected, actual }),
        }
    }

    fn start_at(&mut self, positions: &[f64]) {
        let (dt_s, preview_s) = (self.dt_s, self.preview_s);
        for wheel in self.solver.turning_base.iter().flat_map(|base| &base.wheels) {
            let (joint, limits) = (wheel.joint, &self.limits[wheel.joint]);
            self.rest[joint] = wheel.rest_rad(positions[joint], limits, MOST_BASE_TURN);
        }
        let trackers = positions.iter().enumerate().map(|(joint, &position)| {
            // A joint that begins beyond where a dance takes it comes back gently.
            let near = &self.dance_limits[joint];
            let is_near = near.clamp_rad(position) == position;
            let limits = if is_near { *near } else { self.limits[joint] };
            JointTracker::new(limits, self.jerk_rad_s3[joint], dt_s, position, preview_s)
        });
        self.trackers = trackers.collect();
        for (joint, &position) in positions.iter().enumerate() {
            self.solver.positions[joint] = self.limits[joint].clamp_rad(position);
        }
        self.output.copy_from_slice(positions);
        let root = self.world_from_root(positions);
        if let Some(feet) = &mut self.four_feet {
            feet.restart();
        }
        if let Some(stance) = &mut self.stance {
            stance.legs.positions.copy_from_slice(positions);
            stance.restart(root);
        }
        self.model.place(&root, positions, &mut self.poses);
        self.torque.restart();
        self.danced_s = 0.0;
        self.before_dance.copy_from_slice(&self.solver.positions);
        self.feed_forward.restart();
    }
}
