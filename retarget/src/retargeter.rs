//! From human frames to joint targets: the whole way, one control cycle at a time.
//!
//! `next` does not allocate, does not block and takes bounded time. Whatever
//! comes in, what goes out holds the joint limits: see `tracker`.

use std::collections::BTreeMap;

use k::nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use servodance_types::{FRAME_RATE_HZ, JointLimits, MotionFrame};

use crate::balance::Support;
use crate::body::BodyMap;
use crate::body_solver::{BodySolver, Feet, Question, Role, Task};
use crate::collision;
use crate::config::{Limb, RetargetConfig, Stance};
use crate::error::choices;
use crate::guard::Guard;
use crate::human::{self, Aim, Heading, Reader};
use crate::pelvis::Pelvis;
use crate::preview::PREVIEW_S;
use crate::stream::{LOOKAHEAD_FRAMES, MotionStream};
use crate::tracker::Tracker;
use crate::{Counts, RetargetError, RobotModel};

/// Gauss-Newton steps a control cycle; the solution is warm.
const STEPS: usize = 2;
/// Gauss-Newton steps to find the rest pose from nothing.
const REST_STEPS: usize = 200;
/// Time to full acceleration, seconds: sets the jerk limit.
const ACCELERATION_RISE_S: f64 = 0.02;
/// Knees are never straighter: near straight, small steps of the pelvis would
/// need large ones of the knee.
const LEAST_KNEE_RAD: f64 = 0.12;
/// A planted foot farther away has moved, metres.
const FOOT_MOVED_M: f64 = 0.002;

/// Turns human motion into joint targets for one robot.
pub struct Retargeter {
    model: RobotModel,
    map: BodyMap,
    limits: Vec<JointLimits>,
    limbs: Vec<Limb>,
    /// Joints between the pelvis and a planted foot.
    stands_on: Vec<bool>,
    rest: Vec<f64>,
    gains: crate::Gains,
    amplitude: f64,
    mirror: bool,
    dt_s: f64,
    stream: MotionStream,
    reader: Reader,
    solver: BodySolver,
    standing: Option<Standing>,
    trackers: Vec<Tracker>,
    bounds: Vec<(f64, f64)>,
    leg_bounds: Vec<(f64, f64)>,
    guard: Guard,
    wanted: Vec<f64>,
    output: Vec<f64>,
    poses: Vec<Isometry3<f64>>,
    held_root: Isometry3<f64>,
    counts: Counts,
}

/// What only a robot on its feet has.
struct Standing {
    feet: Feet,
    pelvis: Pelvis,
    legs: BodySolver,
    support: Support,
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
        let model = RobotModel::new(urdf_xml, &names)?;
        let limits = usable_limits(joints, config.margin)?;
        let map = BodyMap::new(&model, config)?;
        let upright = upright_rotation(config)?;
        let dt_s = 1.0 / control_hz;

        let planted = config.stance == Stance::Planted;
        let role = if planted { Role::Upper } else { Role::Hung };
        let solver = BodySolver::new(&model, map, config.weights, &limits, upright, role);
        let waist = !model.levers[map.chest].is_empty();
        let heading = match (config.stance, waist) {
            (Stance::Planted, _) => Heading::Slow,
            (Stance::Hung, true) => Heading::Pelvis,
            (Stance::Hung, false) => Heading::Chest,
        };
        let limbs = map.limbs(&model);
        let is_leg = |limb: &Limb| matches!(limb, Limb::LeftLeg | Limb::RightLeg);
        let mut retargeter = Self {
            stands_on: limbs.iter().map(|l| planted && is_leg(l)).collect(),
            limbs,
            rest: solver.positions.clone(),
            gains: config.gain,
            amplitude: config.amplitude,
            mirror: config.mirror,
            dt_s,
            stream: MotionStream::new(),
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
            counts: Counts::default(),
            model,
            map,
            limits,
            solver,
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
    /// the rest pose is taken up; after the last one the pose is held.
    ///
    /// # Errors
    /// Only if `out_rad` has not one place a joint.
    pub fn next(&mut self, time_s: f64, out_rad: &mut [f64]) -> Result<(), RetargetError> {
        self.check_length(out_rad.len())?;
        self.counts.cycles += 1;
        self.counts.starved_cycles += u64::from(self.stream.is_over(time_s));
        let aim = match self.stream.at(time_s + self.preview_s()) {
            Some(points) if self.mirror => self.reader.read(&human::mirrored(&points)),
            Some(points) => self.reader.read(&points),
            None => Aim::standing(),
        };
        self.solve(&aim);
        self.track();
        self.judge();
        out_rad.copy_from_slice(&self.output);
        Ok(())
    }

    /// How far ahead of the output the solver of arms and head works.
    fn preview_s(&self) -> f64 {
        self.trackers
            .first()
            .map_or(PREVIEW_S, |t| t.preview_cycles() as f64 * self.dt_s)
    }

    /// Solves for the legs now and for the rest when the preview ends.
    fn solve(&mut self, aim: &Aim) {
        self.set_bounds();
        let gain = self.amplitude * self.gains.torso;
        if let Some(standing) = &mut self.standing {
            let wanted = Pelvis::wanted(aim, gain);
            standing.pelvis.observe(&standing.legs.base);
            let root = standing.pelvis.step(&wanted);
            standing.legs.positions.copy_from_slice(&self.output);
            standing.legs.solve(
                &self.model,
                &Question {
                    task: Task::Stand {
                        root: &root,
                        feet: &standing.feet,
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
                self.leg_bounds[joint] = self.trackers[joint].allowed();
                self.bounds[joint] = (here, here);
                self.solver.positions[joint] = here;
            } else {
                let now = self.solver.positions[joint];
                let reach = limits.velocity_rad_s * self.dt_s;
                self.leg_bounds[joint] = (here, here);
                self.bounds[joint] = (
                    limits.lower_rad.max(now - reach),
                    limits.upper_rad.min(now + reach),
                );
            }
        }
    }

    /// Scales the solution around rest and lets each joint follow it.
    fn track(&mut self) {
        let mut limited = false;
        for (joint, tracker) in self.trackers.iter_mut().enumerate() {
            let (bounds, wanted) = (&mut self.bounds[joint], &mut self.wanted[joint]);
            if let (Some(standing), true) = (&self.standing, self.stands_on[joint]) {
                // Decided together with the feet; not for the guard to change.
                *wanted = standing.legs.positions[joint];
                *bounds = (*wanted, *wanted);
                continue;
            }
            let solved = self.solver.positions[joint];
            let scale = self.amplitude * self.gains.of(self.limbs[joint]);
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
            let jerk_exceeded = tracker.go(self.wanted[joint]);
            self.counts.jerk_exceeded += u64::from(jerk_exceeded);
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
            return;
        };
        let com = self.model.centre_of_mass(&self.poses);
        let unbalanced = standing.support.outside_m(&com) > 0.0;
        self.counts.unbalanced_cycles += u64::from(unbalanced);
        let moved = (0..2).any(|side| {
            let Some(sole) = self.map.legs[side].sole else {
                return false;
            };
            let place = self.poses[sole].translation.vector;
            (place - standing.feet[side].translation.vector).norm() > FOOT_MOVED_M
        });
        self.counts.feet_moved_cycles += u64::from(moved);
    }

    /// Where the root link is, in a world with its floor at z = 0 (planted) or
    /// its origin in the root link (hung), while the joints are at `positions`.
    pub fn world_from_root(&self, positions: &[f64]) -> Isometry3<f64> {
        let Some(standing) = &self.standing else {
            return self.held_root;
        };
        let mut roots = [self.held_root; 2];
        for (side, root) in roots.iter_mut().enumerate() {
            if let Some(sole) = self.map.legs[side].sole {
                let root_from_sole = self.link_pose(sole, positions);
                *root = standing.feet[side] * root_from_sole.inverse();
            }
        }
        let [left, right] = roots;
        Isometry3::from_parts(
            Translation3::from((left.translation.vector + right.translation.vector) * 0.5),
            left.rotation.nlerp(&right.rotation, 0.5),
        )
    }

    fn link_pose(&self, link: usize, positions: &[f64]) -> Isometry3<f64> {
        self.model.link_pose(link, positions)
    }

    fn check_length(&self, actual: usize) -> Result<(), RetargetError> {
        let expected = self.limits.len();
        match actual == expected {
            true => Ok(()),
            false => Err(RetargetError::Length { expected, actual }),
        }
    }

    fn start_at(&mut self, positions: &[f64]) {
        let (dt_s, limits) = (self.dt_s, &self.limits);
        self.trackers = positions
            .iter()
            .zip(limits)
            .map(|(&position, &limits)| {
                let jerk = limits.acceleration_rad_s2 / ACCELERATION_RISE_S;
                Tracker::new(limits, jerk, dt_s, position)
            })
            .collect();
        for (joint, &position) in positions.iter().enumerate() {
            self.solver.positions[joint] = self.limits[joint].clamp_rad(position);
        }
        self.output.copy_from_slice(positions);
        let root = self.world_from_root(positions);
        if let Some(standing) = &mut self.standing {
            standing.pelvis.restart();
            standing.legs.base = root;
        }
        self.model.place(&root, positions, &mut self.poses);
    }

    /// The rest pose: the solver's answer to an upright dancer, arms down, with
    /// the configured joints put where the configuration says.
    fn find_rest(&mut self, config: &RetargetConfig) -> Result<(), RetargetError> {
        let fixed = rest_overrides(&self.model, &self.limits, &config.rest_deg)?;
        let far = self.bounds.clone();
        let zero: Vec<f64> = self.solver.positions.clone();
        self.solver.solve(
            &self.model,
            &Question {
                task: Task::Dance(&Aim::standing()),
                rest: &zero,
                steps: REST_STEPS,
                bounds: &far,
            },
        );
        if config.stance == Stance::Planted {
            let length = self.solver.leg_length();
            let legs = &self.map.legs;
            if !legs.iter().all(|leg| leg.sole.is_some()) || length < 1e-3 {
                return Err(RetargetError::Config {
                    key: "stance".into(),
                    value: "planted".into(),
                    expected: format!(
                        "a planted robot needs hip, knee, ankle and sole of both legs in \
                         [retarget.body]; found left {:?}, right {:?}; or use stance = \"hung\"",
                        self.leg_names(0),
                        self.leg_names(1)
                    ),
                });
            }
            self.stand(config, length, &far);
        }
        for &(joint, position) in &fixed {
            self.solver.positions[joint] = position;
        }
        self.keep_knees_bent(&zero);
        self.rest.clone_from(&self.solver.positions);
        let poses = self.solver.poses(&self.model).to_vec();
        self.solver.pairs = collision::pairs(&self.model, &self.map, &poses);
        Ok(())
    }

    /// Knees bend one way: the side of straight that most of their range is on.
    fn keep_knees_bent(&mut self, zero: &[f64]) {
        for leg in self.map.legs {
            let (Some(hip), Some(knee), Some(ankle)) = (leg.hip, leg.knee, leg.ankle) else {
                continue;
            };
            let Some(lever) = self.model.levers[knee].last() else {
                continue;
            };
            let joint = lever.joint;
            let (lower, upper) = self.bounds[joint];
            let mut positions = zero.to_vec();
            let mut length_at = |position: f64| {
                positions[joint] = position;
                let hip = self.model.link_pose(hip, &positions);
                let ankle = self.model.link_pose(ankle, &positions);
                (hip.translation.vector - ankle.translation.vector).norm()
            };
            let steps = 200;
            let place = |k: i32| lower + (upper - lower) * f64::from(k) / f64::from(steps);
            let straight = (0..=steps)
                .map(place)
                .max_by(|a, b| length_at(*a).total_cmp(&length_at(*b)))
                .unwrap_or(lower);
            let limits = &mut self.limits[joint];
            if upper - straight > straight - lower {
                limits.lower_rad = (straight + LEAST_KNEE_RAD).clamp(lower, upper - 1e-3);
            } else {
                limits.upper_rad = (straight - LEAST_KNEE_RAD).clamp(lower + 1e-3, upper);
            }
            self.solver.positions[joint] = limits.clamp_rad(self.solver.positions[joint]);
        }
    }

    fn leg_names(&self, side: usize) -> Vec<&str> {
        let leg = self.map.legs[side];
        [leg.hip, leg.knee, leg.ankle, leg.sole]
            .into_iter()
            .flatten()
            .map(|link| self.model.link_names()[link].as_str())
            .collect()
    }

    /// Puts the robot on its feet, sunk a little, its weight between them.
    fn stand(&mut self, config: &RetargetConfig, leg_m: f64, far: &[(f64, f64)]) {
        let mut legs = BodySolver::new(
            &self.model,
            self.map,
            config.weights,
            &self.limits,
            self.held_root.rotation,
            Role::Stance,
        );
        let start = self.solver.positions.clone();
        legs.positions.clone_from(&start);
        legs.base = self.held_root;
        let soles = self.map.legs.map(|leg| leg.sole.unwrap_or(0));
        let poses = legs.poses(&self.model);
        let heights = soles.map(|sole| poses[sole].translation.z);
        let mut feet = soles.map(|sole| poses[sole]);
        for foot in &mut feet {
            foot.translation.z = 0.0;
        }
        let middle = (feet[0].translation.vector + feet[1].translation.vector) * 0.5;
        let mut root = self.held_root;
        root.translation.z -= heights[0].min(heights[1]) + config.crouch * leg_m;
        for _ in 0..20 {
            legs.solve(
                &self.model,
                &Question {
                    task: Task::Stand {
                        root: &root,
                        feet: &feet,
                    },
                    rest: &start,
                    steps: REST_STEPS / 10,
                    bounds: far,
                },
            );
            let poses = legs.poses(&self.model);
            let com = self.model.centre_of_mass(poses);
            root.translation.x -= 0.7 * (com.x - middle.x);
            root.translation.y -= 0.7 * (com.y - middle.y);
        }
        self.solver.positions.clone_from(&legs.positions);
        self.solver.base = legs.base;
        let support = Support::new(&feet, config.sole_m);
        legs.support = Some(support.clone());
        self.standing = Some(Standing {
            // What was reached, not what was asked: rest is then an equilibrium.
            pelvis: Pelvis::new(legs.base, leg_m, self.dt_s),
            feet,
            legs,
            support,
        });
    }
}

/// The limits as used: rates lowered to `margin`.
fn usable_limits(
    joints: &[(String, JointLimits)],
    margin: f64,
) -> Result<Vec<JointLimits>, RetargetError> {
    joints
        .iter()
        .map(|(name, limits)| {
            let checked = limits.checked().map_err(|reason| RetargetError::Joint {
                joint: name.clone(),
                reason,
            })?;
            Ok(JointLimits {
                velocity_rad_s: checked.velocity_rad_s * margin,
                acceleration_rad_s2: checked.acceleration_rad_s2 * margin,
                ..checked
            })
        })
        .collect()
}

/// Joint indices and positions of `[retarget.rest_deg]`, inside the limits.
fn rest_overrides(
    model: &RobotModel,
    limits: &[JointLimits],
    rest_deg: &BTreeMap<String, f64>,
) -> Result<Vec<(usize, f64)>, RetargetError> {
    rest_deg
        .iter()
        .map(|(name, degrees)| {
            let names = model.joint_names();
            let index = names.iter().position(|other| other == name);
            let Some(index) = index else {
                return Err(RetargetError::NoSuchJoint {
                    name: name.clone(),
                    choices: choices(names.iter().map(String::as_str)),
                });
            };
            Ok((index, limits[index].clamp_rad(degrees.to_radians())))
        })
        .collect()
}

/// Rotation that brings the configured forward axis to x and the up axis to z.
fn upright_rotation(config: &RetargetConfig) -> Result<UnitQuaternion<f64>, RetargetError> {
    let forward = axis("forward", &config.forward)?;
    let up = axis("up", &config.up)?;
    if forward.dot(&up) != 0.0 {
        return Err(RetargetError::Config {
            key: "up".into(),
            value: config.up.clone(),
            expected: format!("expected an axis other than forward = {}", config.forward),
        });
    }
    let rows = Matrix3::from_columns(&[forward, up.cross(&forward), up]).transpose();
    Ok(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix_unchecked(rows),
    ))
}

fn axis(key: &str, name: &str) -> Result<Vector3<f64>, RetargetError> {
    match name.trim_start_matches('+') {
        "x" => Ok(Vector3::x()),
        "y" => Ok(Vector3::y()),
        "z" => Ok(Vector3::z()),
        "-x" => Ok(-Vector3::x()),
        "-y" => Ok(-Vector3::y()),
        "-z" => Ok(-Vector3::z()),
        _ => Err(RetargetError::Config {
            key: key.into(),
            value: name.into(),
            expected: "expected one of x, y, z, -x, -y, -z".into(),
        }),
    }
}
