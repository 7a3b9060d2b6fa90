//! Shapes fixed to links: boxes, cylinders, balls and meshes to draw, capsules
//! for collisions. Metres, in the link's frame.

use k::link::Geometry;
use k::nalgebra::{Isometry3, Point3, Vector3};

/// A simple shape to draw; lengths in metres.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub enum Shape {
    Box { size_m: [f64; 3] },
    Cylinder { radius_m: f64, length_m: f64 },
    Sphere { radius_m: f64 },
}

/// A shape fixed to a link: colour parts are 0 to 1.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub struct Visual {
    /// Index into [`RobotModel::link_names`](crate::RobotModel::link_names).
    pub link: usize,
    pub pose_in_link: Isometry3<f64>,
    pub shape: Shape,
    pub rgba: [f32; 4],
}

/// A mesh fixed to a link: colour parts are 0 to 1.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub struct MeshVisual {
    pub link: usize,
    pub pose_in_link: Isometry3<f64>,
    /// As the description has it: a path, or `package://NAME/PATH`.
    pub filename: String,
    pub scale: [f64; 3],
    pub rgba: [f32; 4],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Capsule {
    pub link: usize,
    pub ends: [Point3<f64>; 2],
    pub radius_m: f64,
}

/// Volume of a shape and the capsule that takes its place.
pub(crate) fn capsule_of(visual: &Visual) -> (f64, Capsule) {
    let size = match visual.shape {
        Shape::Box { size_m } => Vector3::from(size_m),
        Shape::Cylinder { radius_m, length_m } => {
            Vector3::new(2.0 * radius_m, 2.0 * radius_m, length_m)
        }
        Shape::Sphere { radius_m } => Vector3::repeat(2.0 * radius_m),
    };
    let longest = size.imax();
    let radius_m = (size.sum() - size[longest]) / 4.0;
    let mut half = Vector3::zeros();
    half[longest] = (size[longest] / 2.0 - radius_m).max(0.0);
    let ends = [half, -half].map(|end| visual.pose_in_link * Point3::from(end));
    let capsule = Capsule { link: visual.link, ends, radius_m };
    (size.product(), capsule)
}

#[derive(Clone, Debug, Default)]
pub(crate) struct LinkShapes {
    pub visuals: Vec<Visual>,
    pub meshes: Vec<MeshVisual>,
    pub solids: Vec<Visual>,
}

impl LinkShapes {
    pub fn add(&mut self, link: usize, shapes: &k::link::Link<f64>) {
        for visual in &shapes.visuals {
            let color = &visual.material.color;
            let rgba = [color.r, color.g, color.b, color.a].map(|part| part as f32);
            self.visuals.extend(simple(link, &visual.geometry, *visual.origin(), rgba));
            if let Geometry::Mesh { filename, scale } = &visual.geometry {
                self.meshes.push(MeshVisual {
                    link,
                    pose_in_link: *visual.origin(),
                    filename: filename.clone(),
                    scale: [scale.x, scale.y, scale.z],
                    rgba,
                });
            }
        }
        let solids = shapes.collisions.iter();
        self.solids.extend(
            solids.filter_map(|solid| simple(link, &solid.geometry, *solid.origin(), [1.0; 4])),
        );
    }
}

/// `None` for meshes.
fn simple(
    link: usize,
    geometry: &Geometry<f64>,
    pose_in_link: Isometry3<f64>,
    rgba: [f32; 4],
) -> Option<Visual> {
    let shape = match *geometry {
        Geometry::Box { depth, width, height } => Shape::Box { size_m: [depth, width, height] },
        Geometry::Cylinder { radius, length } | Geometry::Capsule { radius, length } => {
            Shape::Cylinder { radius_m: radius, length_m: length }
        }
        Geometry::Sphere { radius } => Shape::Sphere { radius_m: radius },
        Geometry::Mesh { .. } => return None,
    };
    Some(Visual { link, pose_in_link, shape, rgba })
}
