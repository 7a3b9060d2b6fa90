//! The robot as rigid links, for a physics engine: masses, joints, and where it
//! can touch the floor.

use k::nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use servodance_types::{LinkDrive, LinkMotion, Placement, RigidLink, TouchPoint};

use super::joint_torque::GRAVITY_M_S2;
use crate::contact::sole_corners;
use crate::kinematics::{BodyMap, JointMotion, RobotModel, Shape, Visual};

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[(row, column)]))
}

/// A pose as plain numbers.
pub(crate) fn placement(pose: &Isometry3<f64>) -> Placement {
    Placement {
        rotation: rows(pose.rotation.to_rotation_matrix().matrix()),
        at_m: pose.translation.vector.into(),
    }
}

/// The links of a model, in its order.
/// With `feet` (poses of the soles at rest and their size) the feet touch the floor by
/// the four corners of each sole, everything else by its shapes; a body on `four_feet` by
/// the origins of those links.
pub(crate) fn rigid_links(
    model: &RobotModel,
    map: &BodyMap,
    feet: Option<(&[Isometry3<f64>; 2], [f64; 2])>,
    four_feet: Option<&[usize; 4]>,
) -> Vec<RigidLink> {
    let mut links: Vec<RigidLink> = model
        .links
        .iter()
        .enumerate()
        .map(|(index, link)| RigidLink {
            name: model.link_names()[index].clone(),
            parent: link.parent,
            origin: placement(&link.still_pose()),
            motion: match link.motion {
                _ if link.drive.is_none() => LinkMotion::Fixed,
                JointMotion::Fixed | JointMotion::Platform => LinkMotion::Fixed,
                JointMotion::Revolute(axis) => LinkMotion::Revolute(axis.into_inner().into()),
                JointMotion::Prismatic(axis) => LinkMotion::Prismatic(axis.into_inner().into()),
            },
            drive: link.drive.map(|drive| LinkDrive {
                joint: drive.joint,
                scale: drive.scale,
                offset: drive.offset,
            }),
            mass_kg: link.mass_kg,
            com_m: link.com.coords.into(),
            inertia_kg_m2: rows(&link.inertia),
            touch: Vec::new(),
        })
        .collect();
    for shape in model.touch_shapes() {
        links[shape.link].touch.extend(touch_points(shape));
    }
    if let Some((feet, sole_m)) = feet {
        for (side, foot) in feet.iter().enumerate() {
            let Some(sole) = map.legs[side].sole else { continue };
            clear_touch(model, sole, &mut links);
            let corners = sole_corners(foot, sole_m);
            links[sole].touch = corners
                .map(|corner| TouchPoint {
                    at_m: (foot.inverse() * Point3::from(corner)).coords.into(),
                    radius_m: 0.0,
                    foot: Some(side),
                })
                .to_vec();
        }
    }
    for (foot, &link) in four_feet.into_iter().flatten().enumerate() {
        clear_touch(model, link, &mut links);
        let at_m = [0.0; 3];
        links[link].touch.push(TouchPoint { at_m, radius_m: 0.0, foot: Some(foot % 2) });
    }
    links
}

/// What moves with a sole touches the floor by the sole alone.
fn clear_touch(model: &RobotModel, sole: usize, links: &mut [RigidLink]) {
    for (link, rigid) in links.iter_mut().enumerate() {
        if model.drives_above(link) == model.drives_above(sole)
            && model.is_below(link, model.last_driven(sole))
        {
            rigid.touch.clear();
        }
    }
}

/// What a joint of a robot at rest carries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointLoad {
    /// Moment of inertia about the joint's axis, kg m2: of what is beyond the joint, with
    /// what is beyond the next one across the axis (an elbow bends); or, for a leg that
    /// stands, of half the robot over it.
    pub inertia_kg_m2: f64,
    /// Weight times lever of the same, newton metres a radian.
    pub gravity_nm_rad: f64,
    /// Effort limit of the description, newton metres.
    pub effort_nm: Option<f64>,
}

/// Loads by joint; `stands` says which joints are of legs on the floor.
pub(crate) fn joint_loads(
    model: &RobotModel,
    poses: &[Isometry3<f64>],
    stands: &[bool],
) -> Vec<JointLoad> {
    let mut loads = vec![JointLoad::default(); stands.len()];
    for (index, link) in model.links.iter().enumerate() {
        let (Some(drive), JointMotion::Revolute(axis)) = (link.drive, link.motion) else {
            continue;
        };
        let axis = poses[index].rotation * axis.into_inner();
        let at = poses[index].translation.vector;
        let (mut inertia, mut lever) = (0.0, 0.0);
        let share = if stands[drive.joint] { 0.5 } else { 1.0 };
        for (other, body) in model.links.iter().enumerate() {
            let carried = match stands[drive.joint] {
                // Above an ankle is all of the robot but the foot.
                true => !model.is_below(other, index),
                false => model.is_below(other, index),
            };
            if carried && body.mass_kg > 0.0 {
                let away = poses[other] * body.com - Point3::from(at);
                let bends = !stands[drive.joint] && model.last_driven(other) != index;
                let across = match bends {
                    true => away.norm_squared(),
                    false => axis.cross(&away).norm_squared(),
                };
                inertia += share * body.mass_kg * across;
                if !stands[drive.joint] {
                    let axis = poses[other].rotation.inverse() * axis;
                    inertia += axis.dot(&(body.inertia * axis));
                }
                lever += share * body.mass_kg * GRAVITY_M_S2 * across.sqrt();
            }
        }
        let load = &mut loads[drive.joint];
        load.inertia_kg_m2 = load.inertia_kg_m2.max(inertia);
        load.gravity_nm_rad = load.gravity_nm_rad.max(lever);
        load.effort_nm = model.effort_nm[drive.joint];
    }
    loads
}

/// Balls that stand for a shape: corners of a box, the round ends of the rest.
fn touch_points(shape: &Visual) -> Vec<TouchPoint> {
    let place = |at: Vector3<f64>, radius_m: f64| TouchPoint {
        at_m: (shape.pose_in_link * Point3::from(at)).coords.into(),
        radius_m,
        foot: None,
    };
    match shape.shape {
        Shape::Box { size_m } => {
            let half = Vector3::from(size_m) / 2.0;
            let sign =
                |corner: usize, axis: usize| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
            let corner = |index| Vector3::from_fn(|axis, _| sign(index, axis) * half[axis]);
            (0..8).map(|index| place(corner(index), 0.0)).collect()
        }
        Shape::Cylinder { radius_m, length_m } => {
            let half = (length_m / 2.0 - radius_m).max(0.0);
            [half, -half].map(|z| place(Vector3::z() * z, radius_m)).to_vec()
        }
        Shape::Sphere { radius_m } => vec![place(Vector3::zeros(), radius_m)],
    }
}
