//! Before the first cycle: checked limits, the way up, the rest pose, the stance.

use std::collections::BTreeMap;

use k::nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use servodance_types::JointLimits;

use super::{Retargeter, Standing};
use crate::balance::Support;
use crate::body_solver::{BodySolver, Question, Role, Task};
use crate::collision;
use crate::config::{RetargetConfig, Stance};
use crate::effort::Effort;
use crate::error::choices;
use crate::human::Aim;
use crate::pelvis::Pelvis;
use crate::stepper::Stepper;
use crate::{RetargetError, RobotModel};

/// Gauss-Newton steps to find the rest pose from nothing.
const REST_STEPS: usize = 200;
/// How much more slowly the pelvis of a stepping robot speeds up: on one foot
/// there is less room for balance.
const STEPPING_PACE: f64 = 0.5;
/// Least crouch of a stepping robot, leg lengths: a leg that is nearly straight
/// cannot reach for the next place.
const STEPPING_CROUCH: f64 = 0.15;
/// Knees are never straighter: near straight, small steps of the pelvis would
/// need large ones of the knee.
const LEAST_KNEE_RAD: f64 = 0.12;

impl Retargeter {
    /// The rest pose: the solver's answer to an upright dancer, arms down, with
    /// the configured joints put where the configuration says.
    pub(super) fn find_rest(&mut self, config: &RetargetConfig) -> Result<(), RetargetError> {
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
        if config.stance.stands() {
            let length = self.solver.leg_length();
            let legs = &self.map.legs;
            if !legs.iter().all(|leg| leg.sole.is_some()) || length < 1e-3 {
                return Err(RetargetError::Config {
                    key: "stance".into(),
                    value: stance_name(config.stance).into(),
                    expected: format!(
                        "a robot on its feet needs hip, knee, ankle and sole of both legs in \
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
        let crouch = match config.stance {
            Stance::Stepping => config.crouch.max(STEPPING_CROUCH),
            _ => config.crouch,
        };
        root.translation.z -= heights[0].min(heights[1]) + crouch * leg_m;
        for _ in 0..20 {
            legs.solve(
                &self.model,
                &Question {
                    task: Task::Stand {
                        root: &root,
                        feet: &feet,
                        firmness: [1.0; 2],
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
        legs.support = Some(Support::new(&feet, config.sole_m));
        let cycles = (self.preview_s / self.dt_s).round() as usize;
        let pace = match config.stance {
            Stance::Stepping => STEPPING_PACE,
            _ => 1.0,
        };
        let stepper = (config.stance == Stance::Stepping)
            .then(|| Stepper::new(feet, leg_m, config.sole_m, self.dt_s, cycles));
        self.standing = Some(Standing {
            // What was reached, not what was asked: rest is then an equilibrium.
            pelvis: Pelvis::new(legs.base, leg_m, self.dt_s, self.preview_s, pace),
            feet,
            stepper,
            legs,
        });
    }
}

fn stance_name(stance: Stance) -> &'static str {
    match stance {
        Stance::Planted => "planted",
        Stance::Stepping => "stepping",
        Stance::Hung => "hung",
    }
}

/// The limits as used: rates lowered to `margin`.
pub(super) fn usable_limits(
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

/// Torque and heat of the motors: limits as configured, else the URDF's.
pub(super) fn effort(
    model: &RobotModel,
    config: &RetargetConfig,
    dt_s: f64,
) -> Result<Effort, RetargetError> {
    let mut limits = model.effort_nm.clone();
    for (joint, limit) in by_joint(model, &config.torque.limit_nm)? {
        limits[joint] = Some(limit);
    }
    Ok(Effort::new(model, limits, config.torque.clone(), dt_s))
}

/// Jerk limits: as configured, else from the rise time.
pub(super) fn jerk_limits(
    model: &RobotModel,
    limits: &[JointLimits],
    config: &RetargetConfig,
) -> Result<Vec<f64>, RetargetError> {
    let rise = |limits: &JointLimits| limits.acceleration_rad_s2 / config.jerk_rise_s;
    let mut jerk: Vec<f64> = limits.iter().map(rise).collect();
    for (joint, degrees) in by_joint(model, &config.jerk_deg_s3)? {
        jerk[joint] = degrees.to_radians() * config.margin;
    }
    Ok(jerk)
}

/// Joint indices and positions of `[retarget.rest_deg]`, inside the limits.
fn rest_overrides(
    model: &RobotModel,
    limits: &[JointLimits],
    rest_deg: &BTreeMap<String, f64>,
) -> Result<Vec<(usize, f64)>, RetargetError> {
    let given = by_joint(model, rest_deg)?.into_iter();
    let inside = |(joint, degrees): (usize, f64)| {
        let limits: &JointLimits = &limits[joint];
        (joint, limits.clamp_rad(degrees.to_radians()))
    };
    Ok(given.map(inside).collect())
}

/// Values given by joint name, by joint index.
pub(super) fn by_joint(
    model: &RobotModel,
    values: &BTreeMap<String, f64>,
) -> Result<Vec<(usize, f64)>, RetargetError> {
    let names = model.joint_names();
    values
        .iter()
        .map(|(name, &value)| {
            let index = names.iter().position(|other| other == name);
            index
                .map(|index| (index, value))
                .ok_or_else(|| RetargetError::NoSuchJoint {
                    name: name.clone(),
                    choices: choices(names.iter().map(String::as_str)),
                })
        })
        .collect()
}

/// Rotation that brings the configured forward axis to x and the up axis to z.
pub(super) fn upright_rotation(
    config: &RetargetConfig,
) -> Result<UnitQuaternion<f64>, RetargetError> {
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
