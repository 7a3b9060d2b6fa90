//! Sizes of links: what moves together as one body, and how far it reaches.

use super::link_tree::LinkTree;
use crate::kinematics::{RobotModel, Shape, Visual};
use k::nalgebra::{Point3, Vector3};

/// Corners of a shape's bounding box, in its link's frame.
fn corners(visual: &Visual) -> Vec<Point3<f64>> {
    let half = match visual.shape {
        Shape::Box { size_m } => Vector3::from(size_m) / 2.0,
        Shape::Cylinder { radius_m, length_m } => Vector3::new(radius_m, radius_m, length_m / 2.0),
        Shape::Sphere { radius_m } => Vector3::repeat(radius_m),
    };
    let mut out = Vec::with_capacity(8);
    for x in [-1.0, 1.0] {
        for y in [-1.0, 1.0] {
            for z in [-1.0, 1.0] {
                let corner = Point3::new(x * half.x, y * half.y, z * half.z);
                out.push(visual.pose_in_link * corner);
            }
        }
    }
    out
}

/// Links that are rigid with `link`, itself first.
pub(super) fn rigid_with(model: &RobotModel, link: usize) -> Vec<usize> {
    let same = |other: &usize| {
        model.is_below(*other, link) && model.drives_above(*other) == model.drives_above(link)
    };
    (link..model.links.len()).filter(same).collect()
}

/// Corners of all shapes that are rigid with `link`, in the root's frame; those of its
/// meshes where it has no other shape.
pub(super) fn corners_of(body: &LinkTree, link: usize) -> Vec<Point3<f64>> {
    let rigid = rigid_with(body.model, link);
    let placed = |link: usize, at: Point3<f64>| body.poses[link] * at;
    let shapes = body.model.all_shapes().filter(|shape| rigid.contains(&shape.link));
    let mut found: Vec<Point3<f64>> = shapes
        .flat_map(|shape| corners(shape).into_iter().map(|corner| placed(shape.link, corner)))
        .collect();
    if found.is_empty() {
        let meshes = body.model.meshes().iter().filter(|mesh| rigid.contains(&mesh.link));
        found.extend(meshes.flat_map(|mesh| {
            let scaled = |[x, y, z]: [f64; 3]| {
                let [along, across, up] = mesh.scale;
                placed(mesh.link, mesh.pose_in_link * Point3::new(x * along, y * across, z * up))
            };
            (body.meshes)(&mesh.filename).into_iter().map(scaled)
        }));
    }
    found.retain(|corner| corner.coords.iter().all(|v| v.is_finite()));
    found
}

/// Whether anything that is rigid with `link` has a shape other than a mesh.
pub(super) fn has_shapes(body: &LinkTree, link: usize) -> bool {
    let rigid = rigid_with(body.model, link);
    body.model.all_shapes().any(|shape| rigid.contains(&shape.link))
}

/// The centre of mass of what is rigid with `link`, root's frame; `None` without mass.
pub(super) fn middle_of_mass(body: &LinkTree, link: usize) -> Option<Point3<f64>> {
    let links = &body.model.links;
    let (mut moment, mut mass) = (Vector3::zeros(), 0.0);
    for link in rigid_with(body.model, link) {
        moment += (body.poses[link] * links[link].com).coords * links[link].mass_kg;
        mass += links[link].mass_kg;
    }
    (mass > 0.0).then(|| Point3::from(moment / mass))
}

/// Where the body of `link` ends: the middle of its far side along the way its
/// mass or shape lies from its origin. Root's frame; `None` without either.
pub(super) fn far_end(body: &LinkTree, link: usize) -> Option<Point3<f64>> {
    let origin = body.at(link);
    let corners = corners_of(body, link);
    let middle = match corners.is_empty() {
        true => middle_of_mass(body, link)? - origin,
        false => corners.iter().map(|c| c - origin).sum::<Vector3<f64>>() / corners.len() as f64,
    };
    let way = middle.try_normalize(1e-3)?;
    // Mass alone lies about half way.
    let reach = match corners.is_empty() {
        true => 2.0 * middle.norm(),
        false => corners.iter().map(|c| (c - origin).dot(&way)).fold(0.0, f64::max),
    };
    (reach > 5e-3).then(|| origin + way * reach)
}
