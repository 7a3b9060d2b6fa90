//! Collision capsules for a new robot file: from the shapes that are drawn or
//! given for collision; where there are only meshes, from the lengths of the
//! limbs and the width of the shoulders.

use k::nalgebra::{Isometry3, Point3};

use super::anatomy::Anatomy;
use crate::config::CapsuleConfig;
use crate::kinematics::{Capsule, RobotModel, capsule_of};

/// Radius of a limb against its length, and of a trunk against the
/// width of the shoulders.
const LIMB_SLENDERNESS: f64 = 0.12;
const TRUNK_SHARE: f64 = 0.3;

/// Capsules around every link that has a shape or a length, at `positions`.
pub(crate) fn capsules(
    model: &RobotModel,
    positions: &[f64],
    anatomy: &Anatomy,
) -> Vec<CapsuleConfig> {
    let poses = &model.link_poses(positions);
    let mut out: Vec<CapsuleConfig> = Vec::new();
    for link in 0..model.links.len() {
        if let Some(capsule) = largest(model, link) {
            out.push(config(model, &capsule));
        }
    }
    let has = |out: &[CapsuleConfig], link: usize| {
        out.iter().any(|capsule| capsule.link == model.link_names()[link])
    };
    for limb in anatomy.arms.iter().chain(&anatomy.legs) {
        for pair in limb.path.windows(2) {
            let length = (origin(poses, pair[1]) - origin(poses, pair[0])).norm();
            let longest = limb.lengths_m[0].max(limb.lengths_m[1]);
            if !has(&out, pair[0]) && length > 0.3 * longest {
                let to = poses[pair[0]].inverse() * origin(poses, pair[1]);
                out.push(config(
                    model,
                    &Capsule {
                        link: pair[0],
                        ends: [Point3::origin(), to],
                        radius_m: LIMB_SLENDERNESS * length,
                    },
                ));
            }
        }
    }
    if !has(&out, anatomy.chest)
        && let Some(trunk) = trunk(model, poses, anatomy)
    {
        out.push(config(model, &trunk));
    }
    out
}

fn largest(model: &RobotModel, link: usize) -> Option<Capsule> {
    let shapes = model.all_shapes();
    shapes
        .filter(|shape| shape.link == link)
        .map(capsule_of)
        .filter(|(volume, _)| volume.is_finite() && *volume > 0.0)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, capsule)| capsule)
}

/// From between the hips (or the chest's origin) to between the shoulders.
fn trunk(model: &RobotModel, poses: &[Isometry3<f64>], anatomy: &Anatomy) -> Option<Capsule> {
    let top = |name: &Option<String>| {
        let link = model.link(name.as_deref()?)?;
        Some(origin(poses, link))
    };
    let [left, right] = anatomy.arms.each_ref().map(|arm| top(&arm.top));
    let (left, right) = (left?, right?);
    let shoulders = Point3::from((left.coords + right.coords) * 0.5);
    let hips = anatomy.legs.each_ref().map(|leg| top(&leg.top));
    let bottom = match hips {
        [Some(left), Some(right)] => Point3::from((left.coords + right.coords) * 0.5),
        _ => origin(poses, anatomy.chest),
    };
    let in_chest = poses[anatomy.chest].inverse();
    Some(Capsule {
        link: anatomy.chest,
        ends: [in_chest * bottom, in_chest * shoulders],
        radius_m: TRUNK_SHARE * (left - right).norm(),
    })
}

fn config(model: &RobotModel, capsule: &Capsule) -> CapsuleConfig {
    let round = |v: f64| (v * 1e4).round() / 1e4;
    let [from, to] = capsule.ends.map(|end| [round(end.x), round(end.y), round(end.z)]);
    CapsuleConfig {
        link: model.link_names()[capsule.link].clone(),
        from_m: from,
        to_m: to,
        radius_m: round(capsule.radius_m).max(1e-4),
    }
}

fn origin(poses: &[Isometry3<f64>], link: usize) -> Point3<f64> {
    Point3::from(poses[link].translation.vector)
}
