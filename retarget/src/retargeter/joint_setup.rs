//! Limits and strength of the joints as configured, and the way up.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use crate::config::{BodyKind, Limb, RetargetConfig, RetargetError, choices};
use crate::dynamics::TorqueEstimator;
use crate::kinematics::{JointMotion, RobotModel, TurningBase};
use k::nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use servodance_types::JointLimits;

/// Cosine of the angle to the vertical up to which an axis counts as upright.
const UPRIGHT: f64 = 0.8;

/// The limits as used: rates lowered to `margin`.
pub(super) fn usable_limits(
    joints: &[(String, JointLimits)],
    margin: f64,
) -> Result<Vec<JointLimits>, RetargetError> {
    joints
        .iter()
        .map(|(name, limits)| {
            let checked = limits
                .checked()
                .map_err(|reason| RetargetError::Joint { joint: name.clone(), reason })?;
            Ok(JointLimits {
                velocity_rad_s: checked.velocity_rad_s * margin,
                acceleration_rad_s2: checked.acceleration_rad_s2 * margin,
                ..checked
            })
        })
        .collect()
}

/// The joints whose axis is upright in the rest pose.
pub(super) fn yaw_joints(model: &RobotModel, upright: &Isometry3<f64>, rest: &[f64]) -> Vec<usize> {
    let mut poses = vec![Isometry3::identity(); model.links.len()];
    model.place(upright, rest, &mut poses);
    let own = model.links.iter().zip(&poses).filter_map(|(link, pose)| match link.motion {
        JointMotion::Revolute(axis) if (pose.rotation * axis).z.abs() > UPRIGHT => {
            link.drive.map(|drive| drive.joint)
        }
        _ => None,
    });
    let mut joints: Vec<usize> = own.collect();
    joints.sort_unstable();
    joints.dedup();
    joints
}

/// A joint that turns about the vertical has more than one way round to a pose, and one that
/// goes round again winds up its cables: it keeps to a quarter turn either way.
pub(super) fn near_rest(yaws: &[usize], rest: &[f64], limits: &[JointLimits]) -> Vec<JointLimits> {
    let mut near = limits.to_vec();
    for &joint in yaws {
        let limits = &mut near[joint];
        limits.lower_rad = limits.lower_rad.max(rest[joint] - FRAC_PI_2);
        limits.upper_rad = limits.upper_rad.min(rest[joint] + FRAC_PI_2);
    }
    near
}

/// Torque and heat of the motors: limits as configured, else the URDF's.
/// The limb that gives way when a joint is overloaded: legs that stand cost the
/// pelvis its movement.
pub(super) fn load_limbs(limbs: &[Limb], stands: bool) -> Vec<Limb> {
    let loaded = |limb: &Limb| match limb {
        Limb::LeftLeg | Limb::RightLeg if stands => Limb::Torso,
        other => *other,
    };
    limbs.iter().map(loaded).collect()
}

pub(super) fn torque_estimator(
    model: &RobotModel,
    config: &RetargetConfig,
    limbs: &[Limb],
    dt_s: f64,
) -> Result<TorqueEstimator, RetargetError> {
    let mut limits = model.effort_nm.clone();
    for (joint, limit) in by_joint(model, &config.torque.limit_nm)? {
        limits[joint] = Some(limit);
    }
    Ok(TorqueEstimator::new(model, limits, limbs, config.torque.clone(), dt_s))
}

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

pub(super) fn by_joint(
    model: &RobotModel,
    values: &BTreeMap<String, f64>,
) -> Result<Vec<(usize, f64)>, RetargetError> {
    let names = model.joint_names();
    values
        .iter()
        .map(|(name, &value)| {
            let index = names.iter().position(|other| other == name);
            index.map(|index| (index, value)).ok_or_else(|| RetargetError::NoSuchJoint {
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
    Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows)))
}

/// The base on wheels of a robot that has one.
pub(super) fn turning_base(
    model: &RobotModel,
    config: &RetargetConfig,
    upright: Isometry3<f64>,
) -> Result<Option<TurningBase>, RetargetError> {
    let on_feet = config.stance.stands() || config.kind == BodyKind::Quadruped;
    if on_feet && let Some(wheel) = config.wheel.first() {
        return Err(RetargetError::Config {
            key: "wheel".into(),
            value: wheel.link.clone(),
            expected: "expected no wheels on a robot that stands on its feet".into(),
        });
    }
    TurningBase::new(model, &config.wheel, upright)
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
