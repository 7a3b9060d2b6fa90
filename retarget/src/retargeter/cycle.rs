//! One control cycle: pose target, inverse kinematics, limits, counters.
//!
//! `next` does not allocate, does not block and takes bounded time. Whatever
//! comes in, what goes out holds the joint limits: see `limits`.

use servodance_types::{JointLimits, MotionFrame, Posture};

use super::Retargeter;
use super::counts::RetargetCounts;
use crate::balance::GovernorInput;
use crate::config::{BodyKind, EVERY_LIMB, Limb, RetargetError};
use crate::contact::{FootStepper, PelvisTrajectory, StepContext};
use crate::dancer::{
    BodyPoints, PoseTarget, antenna_figure, arm_figure, mirrored, trunk_figure, usable_points,
};
use crate::dynamics::StanceFoot;
use crate::solver::{SolverGoal, SolverInput};

const STEPS: usize = 2;
/// Speed at which rest is taken up, radians a second (metres, if it slides).
const GENTLE_RAD_S: f64 = 0.8;
/// How fast what is left shrinks at the end of that, 1/s.
const ARRIVING_PER_S: f64 = 3.0;
/// Over which a dance takes up its size, seconds: all at once it would be a throw of the arms.
const BEGINS_S: f64 = 0.8;
/// For how long the pose of the first frame is taken up, and when that is: long before it.
const TAKEN_UP_S: f64 = 4.0;
const BEFORE_ALL_S: f64 = -1e6;
/// Nearer to rest than this the feet can be kept in place.
const ARRIVED_RAD: f64 = 0.003;

impl Retargeter {
    /// Writes the joint positions for human time `time_s`: radians, inside the
    /// limits of every joint. Call once a control cycle. Before the first frame
    /// the rest pose is taken up gently (so call it for a few seconds of
    /// negative time after [`seed`](Self::seed)); after the last one the pose is
    /// held.
    /// Fails only if `out_rad` has not one place a joint.
    pub fn next(&mut self, time_s: f64, out_rad: &mut [f64]) -> Result<(), RetargetError> {
        self.next_altered(time_s, |points| points.map(|points| (points, 1.0)), out_rad)
    }

    /// Like [`next`](Self::next), but `alter` may change the human pose that is
    /// due in [`preview_s`](Self::preview_s), or give one where there is none;
    /// with it how much of it is the dancer's, 0 to 1.
    /// Fails only if `out_rad` has not one place a joint.
    pub fn next_altered(
        &mut self,
        time_s: f64,
        alter: impl FnOnce(Option<BodyPoints>) -> Option<(BodyPoints, f64)>,
        out_rad: &mut [f64],
    ) -> Result<(), RetargetError> {
        self.check_length(out_rad.len())?;
        self.show(time_s, alter);
        out_rad.copy_from_slice(&self.output);
        Ok(())
    }

    /// One cycle; its result is in `output`.
    fn show(
        &mut self,
        time_s: f64,
        alter: impl FnOnce(Option<BodyPoints>) -> Option<(BodyPoints, f64)>,
    ) {
        self.counts.cycles += 1;
        self.counts.starved_cycles += u64::from(self.motion.is_over(time_s));
        let target = self.pose_target(time_s + self.preview_s(), alter);
        self.set_bounds();
        self.wanted.copy_from_slice(&self.solver.positions);
        let target = target.map(|target| self.figure(target));
        self.danced_s += if target.is_some() { self.dt_s } else { 0.0 };
        self.solve(&target.unwrap_or_else(|| self.figure(PoseTarget::standing())));
        match &target {
            Some(target) => self.search.step(&self.model, &mut self.solver, target, &self.rest),
            None => {
                self.limbs_to_rest();
                self.before_dance.copy_from_slice(&self.solver.positions);
                self.legs_to_rest();
            }
        }
        self.track_targets();
        self.update_counts();
    }

    /// Takes up the pose of `frame` before any other has come, from where the robot is, and
    /// counts nothing of the way: for motion that is known beforehand and shown from its first
    /// frame on. `posture`: what is usual for the dancer then.
    pub fn take_up(&mut self, frame: &MotionFrame, posture: &Posture) {
        let Some(points) = usable_points(frame) else { return };
        self.taken_up = Some(posture.into());
        for _ in 0..(TAKEN_UP_S / self.dt_s).round() as usize {
            self.show(BEFORE_ALL_S, |_| Some((points, 1.0)));
        }
        self.taken_up = None;
        self.reader.forget();
        self.torque.restart();
        self.counts = RetargetCounts::default();
    }

    /// What is asked of the robot by the human pose of a moment.
    fn pose_target(
        &mut self,
        time_s: f64,
        alter: impl FnOnce(Option<BodyPoints>) -> Option<(BodyPoints, f64)>,
    ) -> Option<PoseTarget> {
        let dancer = self.motion.at(time_s);
        let (mut points, share) = alter(dancer)?;
        let led = dancer.and_then(|dancer| {
            let usual = self.postures.at(time_s)?;
            Some(usual.moved(&dancer, &points))
        });
        let led = self.taken_up.or(led);
        let mut led = led.map(|usual| (usual, share));
        if self.mirror {
            points = mirrored(&points);
            led = led.map(|(usual, share)| (usual.mirrored(), share));
        }
        Some(self.reader.read(&points, led))
    }

    /// What a body of this kind shows of it.
    fn figure(&self, target: PoseTarget) -> PoseTarget {
        match self.kind {
            BodyKind::Arm => arm_figure(&target, &self.arm_mount),
            BodyKind::Head => antenna_figure(&target),
            _ => target,
        }
    }

    /// Share of a limb's movement that its motors can do: less when they are strained.
    fn strained(&self, limb: Limb) -> f64 {
        self.amplitude * self.caution * self.torque.amplitude(limb) * self.gains.of(limb)
    }

    /// Share of a dance that has just begun.
    fn begun(&self) -> f64 {
        let share = (self.danced_s / BEGINS_S).min(1.0);
        share * share * (3.0 - 2.0 * share)
    }

    /// Solves for the legs now and for the rest when the preview ends.
    fn solve(&mut self, aim: &PoseTarget) {
        let demand = self.begun() * self.strained(Limb::Torso);
        let trunk = trunk_figure(aim, demand);
        if let Some(feet) = &mut self.four_feet {
            let places = feet.step(&trunk);
            self.solver.solve(
                &self.model,
                &SolverInput {
                    goal: SolverGoal::FourFeet { links: &feet.links, places: &places },
                    rest: &self.rest,
                    steps: STEPS,
                    bounds: &self.bounds,
                },
            );
            return;
        }
        let gain = demand * self.stance.as_ref().map_or(1.0, |stance| stance.governor.pelvis);
        let step_gain = gain * self.gains.left_leg.min(self.gains.right_leg);
        if let Some(stance) = &mut self.stance {
            let mut wanted = PelvisTrajectory::wanted(aim, gain);
            if let Some(stepper) = &mut stance.stepper {
                let soles = self.map.legs.map(|leg| leg.sole.unwrap_or(0));
                let com = self.model.centre_of_mass(&self.poses);
                let present = StepContext {
                    soles: soles.map(|sole| self.poses[sole].translation.vector),
                    weight: com.coords,
                    zmp: self.torque.zero_moment_point().unwrap_or(com).coords,
                    is_steady: self.is_steady,
                    gain: step_gain,
                    aim,
                };
                stepper.step(&present, &mut stance.feet);
                stepper.shift_sway(&stance.feet, &mut wanted);
                (self.counts.steps, self.counts.refused_steps) = (stepper.steps, stepper.refused);
                if let Some(support) = &mut stance.legs.support {
                    support.stand_on(&stance.feet, stepper.down());
                }
            }
            let stepper = stance.stepper.as_ref();
            let firmness = stepper.map_or([1.0; 2], FootStepper::firmness);
            // Feet that stay bind root and legs to what the output can do now;
            // steps are a way of their own, that the output follows.
            if stance.stepper.is_none() {
                stance.pelvis.observe(&stance.legs.base);
                stance.legs.positions.copy_from_slice(&self.output);
            }
            let countered = stance.pelvis.shifted(wanted, &stance.governor.counterweight());
            let root = stance.pelvis.step(&countered);
            let feet = stance.feet_to_ask(&self.map, &self.poses, self.dt_s);
            stance.legs.solve(
                &self.model,
                &SolverInput {
                    goal: SolverGoal::Stand { root: &root, feet: &feet, firmness },
                    rest: &self.rest,
                    steps: STEPS,
                    bounds: &self.leg_bounds,
                },
            );
            self.solver.base = stance.pelvis.pose(&wanted);
        }
        self.solver.solve(
            &self.model,
            &SolverInput {
                goal: SolverGoal::Dance(aim),
                rest: &self.rest,
                steps: STEPS,
                bounds: &self.bounds,
            },
        );
        self.govern(aim, demand);
    }

    /// Looks at where all of the dance would put the zero-moment point. Where the weight
    /// goes for a step is decided in `contact::stepping`.
    fn govern(&mut self, aim: &PoseTarget, demand: f64) {
        let limbs = EVERY_LIMB.map(|limb| self.begun() * self.strained(limb));
        let Some(stance) = &mut self.stance else { return };
        for (joint, planned) in self.planned.iter_mut().enumerate() {
            let (solved, rest) = (self.solver.positions[joint], self.rest[joint]);
            *planned = match self.stands_on[joint] {
                true if stance.stepper.is_some() => solved,
                // The legs follow the pelvis, whose shift the governor adds itself.
                true => rest,
                false => rest + limbs[self.limbs[joint] as usize] * (solved - rest),
            };
        }
        let wanted = PelvisTrajectory::wanted(aim, demand);
        stance.governor.observe(&GovernorInput {
            model: &self.model,
            positions: &self.planned,
            root: stance.pelvis.pose(&wanted),
            rest: *stance.pelvis.rest(),
            support: &stance.governed,
        });
    }

    /// How far each joint may go in this cycle. Legs that stand go exactly as
    /// far as the output can follow, so that the whole body waits for the
    /// slowest of them and the feet stay; other joints, which are smoothed
    /// afterwards, as far as their speed allows.
    fn set_bounds(&mut self) {
        for joint in 0..self.limits.len() {
            let limits = &self.dance_limits[joint];
            let here = self.output[joint];
            if self.stands_on[joint] {
                self.leg_bounds[joint] = match &self.stance {
                    Some(stance) if stance.stepper.is_some() => {
                        around(limits, stance.legs.positions[joint], self.dt_s)
                    }
                    _ => self.trackers[joint].reachable(),
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
        if let Some(feet) = &mut self.four_feet {
            feet.restart();
        }
        let Some(stance) = &mut self.stance else {
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
            stance.legs.positions[joint] = self.trackers[joint].toward_velocity(speed);
        }
        stance.restart(root);
    }

    /// Scales the solution around rest and lets each joint follow it.
    fn track_targets(&mut self) {
        let mut limited = false;
        let limbs = EVERY_LIMB.map(|limb| self.strained(limb));
        let begun = self.begun();
        for joint in 0..self.trackers.len() {
            self.held[joint] = self.held_by_the_body(joint);
            let scale = limbs[self.limbs[joint] as usize] * self.carried(joint);
            let tracker = &mut self.trackers[joint];
            let (bounds, wanted) = (&mut self.bounds[joint], &mut self.wanted[joint]);
            if let (Some(stance), true) = (&self.stance, self.stands_on[joint]) {
                // Decided together with the feet; not for the collision limit to change.
                *wanted = match stance.stepper {
                    Some(_) => tracker.follow(stance.legs.positions[joint]),
                    None => stance.legs.positions[joint],
                };
                *bounds = (*wanted, *wanted);
                continue;
            }
            let solved = self.solver.positions[joint];
            // All joints of four legs together keep the feet in their places.
            if self.four_feet.is_some() {
                *wanted = tracker.follow(solved);
                *bounds = (*wanted, *wanted);
                continue;
            }
            let rest = self.rest[joint];
            let shown = rest + scale * (solved - rest);
            let before = self.before_dance[joint];
            let target = before + begun * (shown - before);
            let speed = self.limits[joint].velocity_rad_s;
            let aimed = tracker.plan(self.feed_forward.ahead_of(joint, target, speed, self.dt_s));
            *bounds = tracker.reachable();
            *wanted = aimed.clamp(bounds.0, bounds.1);
            if self.stance.is_some() && self.limbs[joint] == Limb::Torso {
                // A trunk that makes room for an arm would tip the robot over.
                *bounds = (*wanted, *wanted);
            }
            let allowed = *wanted;
            limited |= (allowed - aimed).abs() > 1e-9;
            self.held_on_its_way(joint, aimed, allowed);
        }
        let guarded = self.collision_limit.apply(
            &self.model,
            &self.poses,
            &self.solver.pairs,
            &self.output,
            &self.bounds,
            &mut self.wanted,
        );
        self.counts.guarded_cycles += u64::from(guarded);
        if guarded {
            self.held_apart();
        }
        for (joint, tracker) in self.trackers.iter_mut().enumerate() {
            tracker.advance(self.wanted[joint]);
            self.output[joint] = tracker.position();
        }
        self.counts.limited_cycles += u64::from(limited);
    }

    fn update_counts(&mut self) {
        let root = self.world_from_root(&self.output);
        self.model.place(&root, &self.output, &mut self.poses);
        let gaps = self.solver.pairs.iter().map(|pair| pair.gap(&self.poses));
        let nearest = gaps.map(|gap| gap.distance_m).fold(f64::INFINITY, f64::min);
        self.counts.collision_cycles += u64::from(nearest < 0.0);
        self.counts.deepest_collision_um =
            self.counts.deepest_collision_um.max((-nearest * 1e6).max(0.0) as u64);
        let Some(stance) = &self.stance else {
            self.torque.observe(&self.model, &self.poses, None);
            return;
        };
        let com = self.model.centre_of_mass(&self.poses);
        let down = stance.down();
        let feet = [0, 1].map(|side| StanceFoot {
            sole: self.map.legs[side].sole.unwrap_or(0),
            down: down[side],
        });
        self.torque.observe(&self.model, &self.poses, Some(feet));
        if let Some(support) = &stance.legs.support {
            let zmp = self.torque.zero_moment_point().unwrap_or(com);
            self.counts.unbalanced_cycles += u64::from(support.outside_m(&com) > 0.0);
            self.counts.tipping_cycles += u64::from(support.outside_m(&zmp) > 0.0);
        }
        let moved = stance.has_moved_feet(&self.map, &self.poses);
        self.counts.feet_moved_cycles += u64::from(moved);
    }
}

/// Where a joint can be next cycle by position and velocity limits alone.
fn around(limits: &JointLimits, now: f64, dt_s: f64) -> (f64, f64) {
    let reach = limits.velocity_rad_s * dt_s;
    let low = limits.lower_rad.max(now - reach);
    let high = limits.upper_rad.min(now + reach);
    (low.min(limits.upper_rad), high.max(limits.lower_rad))
}
