//! Shapes of an MJCF body, with the masses that they stand for.

use std::f64::consts::PI;

use k::nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use urdf_rs::{Collision, Color, Geometry, Material, Pose, Vec3, Vec4, Visual};

use super::attributes::{MjcfElement, from_z};
use crate::config::RetargetError;

/// Density of shapes without mass, kg/m^3.
const DENSITY: f64 = 1000.0;

pub(super) struct MjcfGeom {
    pub pose: Isometry3<f64>,
    pub mass_kg: f64,
    pub reach_m: f64,
    geometry: Geometry,
    rgba: [f64; 4],
    group: i32,
}

/// MuJoCo's viewer draws the groups up to this one; what only touches is in others.
const LAST_SHOWN_GROUP: i32 = 2;

impl MjcfGeom {
    /// `None` for planes, height fields and the like. `frame`: the body's frame in the link's.
    pub fn read(geom: MjcfElement, frame: Isometry3<f64>) -> Result<Option<Self>, RetargetError> {
        let mut pose = geom.pose()?;
        let size = geom.numbers("size")?.unwrap_or_default();
        let part = |index: usize| size.get(index).copied().unwrap_or(0.0).abs();
        let kind = geom.text("type").unwrap_or("sphere");
        let mut half_length = part(1);
        if let Some([a, b, c, d, e, f]) = geom.numbers("fromto")?.as_deref() {
            let (from, to) = (Vector3::new(*a, *b, *c), Vector3::new(*d, *e, *f));
            half_length = (to - from).norm() / 2.0;
            let turned = match half_length > 1e-9 {
                true => from_z(to - from),
                false => UnitQuaternion::identity(),
            };
            let middle = Translation3::from((from + to) / 2.0);
            pose = geom.around * Isometry3::from_parts(middle, turned);
        }
        let fromto = geom.text("fromto").is_some();
        let radius = part(0);
        let (geometry, volume, reach_m) = match kind {
            "sphere" => {
                let volume = 4.0 / 3.0 * PI * radius.powi(3);
                (Geometry::Sphere { radius }, volume, radius)
            }
            "capsule" | "cylinder" => {
                let (caps, ends) = match kind {
                    "capsule" => (radius, 4.0 / 3.0 * PI * radius.powi(3)),
                    _ => (0.0, 0.0),
                };
                let length = 2.0 * (half_length + caps);
                let volume = PI * radius * radius * 2.0 * half_length + ends;
                let geometry = Geometry::Cylinder { radius, length };
                (geometry, volume, half_length.max(radius))
            }
            "box" | "ellipsoid" => {
                let half = match fromto {
                    true => [radius, radius, half_length],
                    false => [part(0), part(1), part(2)],
                };
                let share = if kind == "box" { 8.0 } else { 4.0 / 3.0 * PI };
                let volume = share * half.iter().product::<f64>();
                let size = Vec3(half.map(|h| 2.0 * h));
                let reach_m = half.into_iter().fold(0.0, f64::max);
                (Geometry::Box { size }, volume, reach_m)
            }
            "mesh" => {
                let mesh = geom.text("mesh").and_then(|name| geom.attributes.meshes.get(name));
                let Some(mesh) = mesh else { return Ok(None) };
                pose *= mesh.pose;
                (mesh.geometry.clone(), 0.0, 0.0)
            }
            _ => return Ok(None),
        };
        let [density] = geom.vector("density", [DENSITY])?;
        let [mass_kg] = geom.vector("mass", [density * volume])?;
        Ok(Some(Self {
            pose: frame * pose,
            mass_kg: mass_kg.max(0.0),
            reach_m,
            geometry,
            rgba: geom.vector("rgba", color_of_material(geom))?,
            group: geom.vector("group", [0.0])?[0] as i32,
        }))
    }

    pub fn is_mesh(&self) -> bool {
        matches!(self.geometry, Geometry::Mesh { .. })
    }

    /// Whether a viewer draws it.
    pub fn is_shown(&self) -> bool {
        self.group <= LAST_SHOWN_GROUP
    }

    /// Whether both are the same mesh in the same place: once to draw and once to touch.
    pub fn is_same_mesh(&self, other: &Self) -> bool {
        let file = |geom: &Self| match &geom.geometry {
            Geometry::Mesh { filename, .. } => Some(filename.clone()),
            _ => None,
        };
        self.is_mesh() && file(self) == file(other) && self.pose == other.pose
    }

    pub fn collision(&self, pose: impl Fn(&Isometry3<f64>) -> Pose) -> Collision {
        Collision { name: None, origin: pose(&self.pose), geometry: self.geometry.clone() }
    }

    pub fn visual(&self, pose: impl Fn(&Isometry3<f64>) -> Pose) -> Visual {
        Visual {
            name: None,
            origin: pose(&self.pose),
            geometry: self.geometry.clone(),
            material: Some(Material {
                name: String::new(),
                color: Some(Color { rgba: Vec4(self.rgba) }),
                texture: None,
            }),
        }
    }
}

/// The colour of a shape that says none itself.
fn color_of_material(geom: MjcfElement) -> [f64; 4] {
    let material = geom.text("material").and_then(|name| geom.attributes.materials.get(name));
    material.copied().unwrap_or([0.5, 0.5, 0.5, 1.0])
}
