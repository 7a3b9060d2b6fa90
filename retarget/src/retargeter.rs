//! From human frames to joint targets: the whole way, one control cycle at a time.
//!
//! `next` does not allocate, does not block and takes bounded time. Whatever
//! comes in, what goes out holds the joint limits: see `tracker`.

mod setup;
mod standing;

use k::nalgebra::{Isometry3, Translation3};
use servodance_types::{FRAME_RATE_HZ, JointLimits, MotionFrame, Posture};

use crate::arm_search::ArmSearch;
use crate::body::BodyMap;
use crate::body_solver::{BodySolver, Question, Role, Task};
use crate::config::{Limb, RetargetConfig, Stance};
use crate::effort::{Carrier, Effort, EffortReport};
use crate::guard::Guard;
use crate::human::{self, Aim, Heading, Reader};
use crate::pelvis::Pelvis;
use crate::stepper::{Present, Stepper};
use crate::stream::{LOOKAHEAD_FRAMES, MotionStream, Points};
use crate::tracker::Tracker;
use crate::usual::Postures;
use crate::{Counts, RetargetError, RobotModel};
use standing::Standing;

/// Gauss-Newton steps a control cycle; the solution is warm.
const STEPS: usize = 2;
/// Speed at which rest is taken up, radians a second (metres, if it slides).
const GENTLE_RAD_S: f64 = 0.8;
/// How fast what is left shrinks at the end of that, 1/s.
const ARRIVING_PER_S: f64 = 3.0;
/// Nearer to rest than this the feet can be kept in place.
const ARRIVED_RAD: f64 = 0.003;

/// Turns human motion into joint targets for one robot.
pub struct Retargeter {
    model: RobotModel,
    map: BodyMap,
    limits: Vec<JointLimits>,
    jerk_rad_s3: Vec<f64>,
    limbs: Vec<Limb>,
    /// Joints between the pelvis and a planted foot.
    stands_on: Vec<bool>,
    rest: Vec<f64>,
    gains: crate::Gains,
    amplitude: f64,
    mirror: bool,
    dt_s: f64,
    preview_s: f64,
    stream: MotionStream,
    postures: Postures,
    reader: Reader,
    solver: BodySolver,
    search: ArmSearch,
    standing: Option<Standing>,
    trackers: Vec<Tracker>,
    bounds: Vec<(f64, f64)>,
    leg_bounds: Vec<(f64, f64)>,
    guard: Guard,
    wanted: Vec<f64>,
    output: Vec<f64>,
    poses: Vec<Isometry3<f64>>,
    held_root: Isometry3<f64>,
    effort: Effort,
    counts: Counts,
}

/// Where a joint can be next cycle by position and velocity limits alone.
fn around(limits: &JointLimits, now: f64, dt_s: f64) -> (f64, f64) {
    let reach = limits.velocity_rad_s * dt_s;
    let low = limits.lower_rad.max(now - reach);
    let high = limits.upper_rad.min(now + reach);
    (low.min(limits.upper_rad), high.max(limits.lower_rad))
}

impl Retargeter {
    /// Prepares the robot of a URDF text whose actuated joints are `joints`, in
    /// the order of all position slices.
    ///
    /// # Errors
    /// Names the joint, link or key that is wrong, and lists the choices.
    pub fn new(
        urdf_xml: &str,
        config: &RetargetConfig,
        joints: &[(String, JointLimits)],
        control_hz: f64,
    ) -> Result<Self, RetargetError> {
        config.check()?;
        if !(1.0..=10_000.0).contains(&control_hz) {
            return Err(RetargetError::Config {
                key: "control_hz".into(),
                value: control_hz.to_string(),
                expected: "expected 1 to 10000".into(),
            });
        }
        let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
        let model = RobotModel::configured(urdf_xml, &names, config)?;
        let limits = setup::usable_limits(joints, config.margin)?;
        let jerk_rad_s3 = setup::jerk_limits(&model, &limits, config)?;
        let map = BodyMap::new(&model, config)?;
        let upright = setup::upright_rotation(config)?;
        let dt_s = 1.0 / control_hz;

        let stands = config.stance.stands();
        let role = if stands { Role::Upper } else { Role::Hung };
        let solver = BodySolver::new(&model, map, config.weights, &limits, upright, role);
        let waist = !model.levers[map.chest].is_empty();
        let heading = match (config.stance, waist) {
            (Stance::Planted | Stance::Stepping, _) => Heading::Slow,
            (Stance::Hung, true) => Heading::Pelvis,
            (Stance::Hung, false) => Heading::Chest,
        };
        let search = ArmSearch::new(&model, &map, config.weights, &limits, dt_s);
        let limbs = map.limbs(&model);
        let is_leg = |limb: &Limb| matches!(limb, Limb::LeftLeg | Limb::RightLeg);
        let mut retargeter = Self {
            stands_on: limbs.iter().map(|l| stands && is_leg(l)).collect(),
            limbs,
            rest: solver.positions.clone(),
            gains: config.gain,
            amplitude: config.amplitude,
            mirror: config.mirror,
            dt_s,
            preview_s: config.preview_s,
            stream: MotionStream::new(),
            postures: Postures::new(),
            reader: Reader::new(heading, dt_s),
            standing: None,
            trackers: Vec::new(),
            leg_bounds: vec![(0.0, 0.0); limits.len()],
            bounds: limits.iter().map(|l| (l.lower_rad, l.upper_rad)).collect(),
            guard: Guard::new(limits.len(), dt_s),
            wanted: vec![0.0; limits.len()],
            output: vec![0.0; limits.len()],
            poses: vec![Isometry3::identity(); model.links.len()],
            held_root: Isometry3::from_parts(Translation3::identity(), upright),
            effort: setup::effort(&model, config, dt_s)?,
            counts: Counts::default(),
            model,
            map,
            limits,
            jerk_rad_s3,
            solver,
            search,
        };
        retargeter.find_rest(config)?;
        let rest = retargeter.rest.clone();
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

    /// Highest jerk of each joint, rad/s^3: held in every cycle.
    pub fn jerk_limits_rad_s3(&self) -> &[f64] {
        &self.jerk_rad_s3
    }

    /// Starts, standing still, from where the robot really is.
    ///
    /// # Errors
    /// A wrong number of positions, or one that is not finite (joint named).
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
        self.stream.push(frame, &mut self.counts);
    }

    /// Takes in the next human frame of a dance that somebody else has watched
    /// for longer, with the posture that was usual then: several robots that
    /// began at different times move alike by it.
    pub fn push_led(&mut self, frame: &MotionFrame, posture: &Posture) {
        self.push(frame);
        if frame.is_finite() {
            self.postures.push(frame.time_s, posture);
        }
    }

    /// How far beyond the asked time frames must have been pushed, seconds.
    pub fn lookahead_s(&self) -> f64 {
        LOOKAHEAD_FRAMES as f64 / FRAME_RATE_HZ + self.preview_s()
    }

    /// How long after a human pose's time the output shows it, seconds, while
    /// no limit holds it back.
    pub fn latency_s(&self) -> f64 {
        0.0
    }

    /// What gave way and what was refused so far.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// What the motion cost the motors so far: estimated torque and heat.
    pub fn effort(&self) -> EffortReport {
        self.effort.report(self.model.joint_names())
    }

    /// Estimated torque of each joint in the last cycle, newton metres; 0 where
    /// it is not known.
    pub fn torque_nm(&self) -> &[f64] {
        self.effort.torque_nm()
    }

    /// Work of all solvers so far: multiplications of their factorisations and of
    /// the search for better arms, roughly. Differences between cycles tell how evenly it is spread, on a
    /// busy machine as well.
    pub fn work(&self) -> u64 {
        let standing = self.standing.as_ref();
        self.solver.work()
            + self.search.work()
            + self.guard.work()
            + self.trackers.iter().map(Tracker::work).sum::<u64>()
            + standing.map_or(0, |s| s.legs.work() + s.pelvis.work())
    }

    /// Sets the share of the movement around the rest pose, 0 to 1.
    pub fn set_amplitude(&mut self, amplitude: f64) {
        if amplitude.is_finite() {
            self.amplitude = amplitude.clamp(0.0, 1.0);
        }
    }

    /// Dances as the mirror image, or not.
    pub fn set_mirror(&mut self, mirror: bool) {
        self.mirror = mirror;
    }

    /// Scales the movement of one limb, 0 to 2.
    pub fn set_gain(&mut self, limb: Limb, gain: f64) {
        if gain.is_finite() {
            *self.gains.of_mut(limb) = gain.clamp(0.0, 2.0);
        }
    }

    /// Writes the joint positions for human time `time_s`: radians, inside the
    /// limits of every joint. Call once a control cycle. Before the first frame
    /// the rest pose is taken up gently (so call it for a few seconds of
    /// negative time after [`seed`](Self::seed)); after the last one the pose is
    /// held.
    ///
    /// # Errors
    /// Only if `out_rad` has not one place a joint.
    pub fn next(&mut self, time_s: f64, out_rad: &mut [f64]) -> Result<(), RetargetError> {
        self.next_altered(time_s, |points| points.map(|points| (points, 1.0)), out_rad)
    }

    /// Like [`next`](Self::next), but `alter` may change the human pose that is
    /// due in [`preview_s`](Self::preview_s), or give one where there is none;
    /// with it how much of it is the dancer's, 0 to 1.
    ///
    /// # Errors
    /// Only if `out_rad` has not one place a joint.
    pub fn next_altered(
        &mut self,
        time_s: f64,
        alter: impl FnOnce(Option<Points>) -> Option<(Points, f64)>,
        out_rad: &mut [f64],
    ) -> Result<(), RetargetError> {
        self.check_length(out_rad.len())?;
        self.counts.cycles += 1;
        self.counts.starved_cycles += u64::from(self.stream.is_over(time_s));
        let aim = self.look(time_s + self.preview_s(), alter);
        self.set_bounds();
        self.wanted.copy_from_slice(&self.solver.positions);
        self.solve(&aim.unwrap_or_else(Aim::standing));
        match &aim {
            Some(aim) => self
                .search
                .look(&self.model, &mut self.solver, aim, &self.rest),
            None => {
                self.limbs_to_rest();
                self.legs_to_rest();
            }
        }
        self.track();
        self.judge();
        out_rad.copy_from_slice(&self.output);
        Ok(())
    }

    /// What is asked of the robot by the human pose of a moment.
    fn look(
        &mut self,
        time_s: f64,
        alter: impl FnOnce(Option<Points>) -> Option<(Points, f64)>,
    ) -> Option<Aim> {
        let dancer = self.stream.at(time_s);
        let (mut points, share) = alter(dancer)?;
        let led = dancer.and_then(|dancer| {
            let usual = self.postures.at(time_s)?;
            Some(usual.moved(&dancer, &points))
        });
        let mut led = led.map(|usual| (usual, share));
        if self.mirror {
            points = human::mirrored(&points);
            led = led.map(|(usual, share)| (usual.mirrored(), share));
        }
        Some(self.reader.read(&points, led))
    }

    /// Share of the movement that is shown: less when motors are strained.
    fn shown(&self) -> f64 {
        self.amplitude * self.effort.amplitude()
    }

    /// How far ahead of the output the human pose is taken in, seconds.
    pub fn preview_s(&self) -> f64 {
        self.trackers
            .first()
            .map_or(self.preview_s, |t| t.preview_cycles() as f64 * self.dt_s)
    }

    /// Solves for the legs now and for the rest when the preview ends.
    fn solve(&mut self, aim: &Aim) {
        let shown = self.shown();
        let gain = shown * self.gains.torso;
        if let Some(standing) = &mut self.standing {
            let mut wanted = Pelvis::wanted(aim, gain);
            if let Some(stepper) = &mut standing.stepper {
                let soles = self.map.legs.map(|leg| leg.sole.unwrap_or(0));
                let present = Present {
                    soles: soles.map(|sole| self.poses[sole].translation.vector),
                    weight: self.model.centre_of_mass(&self.poses).coords,
                    gain: shown * self.gains.left_leg.min(self.gains.right_leg),
                    aim,
                };
                stepper.carry(aim, &standing.feet, &mut wanted);
                stepper.step(&present, &mut standing.feet);
                (self.counts.steps, self.counts.refused_steps) = (stepper.steps, stepper.refused);
                if let Some(support) = &mut standing.legs.support {
                    support.stand_on(&standing.feet, stepper.down());
                }
            }
            let stepper = standing.stepper.as_ref();
            let firmness = stepper.map_or([1.0; 2], Stepper::firmness);
            // Feet that stay bind root and legs to what the output can do now;
            // steps are a way of their own, that the output follows.
            if standing.stepper.is_none() {
                standing.pelvis.observe(&standing.legs.base);
                standing.legs.positions.copy_from_slice(&self.output);
            }
            let root = standing.pelvis.step(&wanted);
            let feet = standing.feet_to_ask(&self.map, &self.poses, self.dt_s);
            standing.legs.solve(
                &self.model,
                &Question {
                    task: Task::Stand {
                        root: &root,
                        feet: &feet,
                        firmness,
                    },
                    rest: &self.rest,
                    steps: STEPS,
                    bounds: &self.leg_bounds,
                },
            );
            self.solver.base = standing.pelvis.pose(&wanted);
        }
        self.solver.solve(
            &self.model,
            &Question {
                task: Task::Dance(aim),
                rest: &self.rest,
                steps: STEPS,
                bounds: &self.bounds,
            },
        );
    }

    /// How far each joint may go in this cycle. Legs that stand go exactly as
    /// far as the output can follow, so that the whole body waits for the
    /// slowest of them and the feet stay; other joints, which are smoothed
    /// afterwards, as far as their speed allows.
    fn set_bounds(&mut self) {
        for joint in 0..self.limits.len() {
            let limits = &self.limits[joint];
            let here = self.output[joint];
            if self.stands_on[joint] {
                self.leg_bounds[joint] = match &self.standing {
                    Some(standing) if standing.stepper.is_some() => {
                        around(limits, standing.legs.positions[joint], self.dt_s)
                    }
                    _ => self.trackers[joint].allowed(),
                };
                self.bounds[joint] = (here, here);
                self.solver.positions[joint] = here;
            } else {
                let now = self.solver.positions[joint];
                self.leg_bounds[joint] = (here, here);
                self.bounds[joint] = around(limits, now, self.dt_s);
            }
        }
    }

    /// Without a dance there is nothing to solve: from the last solution, which
    /// is in `wanted`, straight to rest.
    fn limbs_to_rest(&mut self) {
        let step = GENTLE_RAD_S * self.dt_s;
        for joint in (0..self.rest.len()).filter(|&joint| !self.stands_on[joint]) {
            let last = self.wanted[joint];
            self.solver.positions[joint] = last + (self.rest[joint] - last).clamp(-step, step);
        }
    }

    /// Without a dance legs go straight to rest, all arriving together: a robot
    /// that was just switched on may stand anyhow, with no feet in place that
    /// could be kept there.
    fn legs_to_rest(&mut self) {
        let root = self.world_from_root(&self.output);
        let Some(standing) = &mut self.standing else {
            return;
        };
        let away = |joint: usize| self.rest[joint] - self.output[joint];
        let legs = || (0..self.rest.len()).filter(|&joint| self.stands_on[joint]);
        let farthest = legs().map(|joint| away(joint).abs()).fold(1e-9, f64::max);
        if farthest < ARRIVED_RAD {
            return;
        }
        let speed = GENTLE_RAD_S.min(ARRIVING_PER_S * farthest);
        for joint in legs() {
            let speed = away(joint) / farthest * speed;
            standing.legs.positions[joint] = self.trackers[joint].aim_at_speed(speed);
        }
        standing.restart(root);
    }

    /// Scales the solution around rest and lets each joint follow it.
    fn track(&mut self) {
        let mut limited = false;
        let shown = self.shown();
        for (joint, tracker) in self.trackers.iter_mut().enumerate() {
            let (bounds, wanted) = (&mut self.bounds[joint], &mut self.wanted[joint]);
            if let (Some(standing), true) = (&self.standing, self.stands_on[joint]) {
                // Decided together with the feet; not for the guard to change.
                *wanted = match standing.stepper {
                    Some(_) => tracker.follow(standing.legs.positions[joint]),
                    None => standing.legs.positions[joint],
                };
                *bounds = (*wanted, *wanted);
                continue;
            }
            let solved = self.solver.positions[joint];
            let scale = shown * self.gains.of(self.limbs[joint]);
            let rest = self.rest[joint];
            let aimed = tracker.aim(rest + scale * (solved - rest));
            *bounds = tracker.allowed();
            *wanted = aimed.clamp(bounds.0, bounds.1);
            limited |= (*wanted - aimed).abs() > 1e-9;
        }
        let guarded = self.guard.check(
            &self.model,
            &self.poses,
            &self.solver.pairs,
            &self.output,
            &self.bounds,
            &mut self.wanted,
        );
        self.counts.guarded_cycles += u64::from(guarded);
        for (joint, tracker) in self.trackers.iter_mut().enumerate() {
            tracker.go(self.wanted[joint]);
            self.output[joint] = tracker.position();
        }
        self.counts.limited_cycles += u64::from(limited);
    }

    /// Counts what the output does to feet and balance.
    fn judge(&mut self) {
        let root = self.world_from_root(&self.output);
        self.model.place(&root, &self.output, &mut self.poses);
        let gaps = self.solver.pairs.iter().map(|pair| pair.gap(&self.poses));
        let nearest = gaps.map(|gap| gap.distance_m).fold(f64::INFINITY, f64::min);
        self.counts.collision_cycles += u64::from(nearest < 0.0);
        self.counts.deepest_collision_um = self
            .counts
            .deepest_collision_um
            .max((-nearest * 1e6).max(0.0) as u64);
        let Some(standing) = &self.standing else {
            self.effort.observe(&self.model, &self.poses, None);
            return;
        };
        let com = self.model.centre_of_mass(&self.poses);
        let down = standing.down();
        let feet = [0, 1].map(|side| Carrier {
            sole: self.map.legs[side].sole.unwrap_or(0),
            down: down[side],
        });
        self.effort.observe(&self.model, &self.poses, Some(feet));
        if let Some(support) = &standing.legs.support {
            let zmp = self.effort.zero_moment_point().unwrap_or(com);
            self.counts.unbalanced_cycles += u64::from(support.outside_m(&com) > 0.0);
            self.counts.tipping_cycles += u64::from(support.outside_m(&zmp) > 0.0);
        }
        let moved = standing.has_moved_feet(&self.map, &self.poses);
        self.counts.feet_moved_cycles += u64::from(moved);
    }

    /// Where the root link is, in a world with its floor at z = 0 (planted) or
    /// its origin in the root link (hung), while the joints are at `positions`.
    pub fn world_from_root(&self, positions: &[f64]) -> Isometry3<f64> {
        let Some(standing) = &self.standing else {
            return self.held_root;
        };
        standing.world_from_root(&self.map, |link| self.model.link_pose(link, positions))
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
        self.trackers = positions
            .iter()
            .zip(self.limits.iter().zip(&self.jerk_rad_s3))
            .map(|(&position, (&limits, &jerk))| {
                Tracker::new(limits, jerk, dt_s, position, preview_s)
            })
            .collect();
        for (joint, &position) in positions.iter().enumerate() {
            self.solver.positions[joint] = self.limits[joint].clamp_rad(position);
        }
        self.output.copy_from_slice(positions);
        let root = self.world_from_root(positions);
        if let Some(standing) = &mut self.standing {
            standing.legs.positions.copy_from_slice(positions);
            standing.restart(root);
        }
        self.model.place(&root, positions, &mut self.poses);
        self.effort.restart();
    }

    /// Which feet stand on the floor, left and right; `None` on a stand.
    pub fn feet_down(&self) -> Option<[bool; 2]> {
        self.standing.as_ref().map(Standing::down)
    }
}
