//! Points spread over the surface of a robot's meshes: enough of them look like the robot in
//! a small picture.

use super::Meshes;
use servodance_retarget::nalgebra::{Point3, Vector3};

/// Bytes of a corner: position and normal as f32.
const CORNER: usize = 24;

/// A point of a link's surface, in the link's frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    pub link: usize,
    pub at: Point3<f64>,
    pub normal: Vector3<f64>,
}

impl Meshes {
    /// About `most` points, as many on each triangle as its area asks for.
    pub fn surface(&self, most: usize) -> Vec<SurfacePoint> {
        let triangles: Vec<[SurfacePoint; 3]> = self.triangles().collect();
        let area = |[a, b, c]: &[SurfacePoint; 3]| (b.at - a.at).cross(&(c.at - a.at)).norm() / 2.0;
        let whole: f64 = triangles.iter().map(area).sum();
        let each = whole / most as f64;
        let (mut points, mut due) = (Vec::with_capacity(most), 0.0);
        for triangle in &triangles {
            due += area(triangle);
            while due >= each && each > 0.0 {
                due -= each;
                points.push(inside(triangle, points.len()));
            }
        }
        points
    }

    fn triangles(&self) -> impl Iterator<Item = [SurfacePoint; 3]> + '_ {
        self.fixed.iter().flat_map(|instance| {
            let (visual, part) = (&instance.visual, &self.parts[instance.part]);
            let scale = Vector3::from(visual.scale);
            part.chunks_exact(3 * CORNER).map(move |triangle| {
                let number = |at: usize| {
                    let bytes: [u8; 4] = std::array::from_fn(|byte| triangle[4 * at + byte]);
                    f64::from(f32::from_le_bytes(bytes))
                };
                std::array::from_fn(|corner| {
                    let three =
                        |at: usize| Vector3::from_fn(|axis, _| number(6 * corner + at + axis));
                    SurfacePoint {
                        link: visual.link,
                        at: visual.pose_in_link * Point3::from(three(0).component_mul(&scale)),
                        normal: visual.pose_in_link.rotation * three(3),
                    }
                })
            })
        })
    }
}

/// The `index`th point of a sequence that fills a triangle evenly (golden ratios).
fn inside([a, b, c]: &[SurfacePoint; 3], index: usize) -> SurfacePoint {
    let (mut u, mut v) =
        ((index as f64 * 0.754_877_67).fract(), (index as f64 * 0.569_840_29).fract());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    SurfacePoint { at: a.at + (b.at - a.at) * u + (c.at - a.at) * v, ..*a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_retarget::MeshVisual;
    use servodance_retarget::nalgebra::Isometry3;

    #[test]
    fn points_are_spread_by_area_over_the_placed_mesh() {
        let corner = |x: f32, y: f32| [x, y, 0.0, 0.0, 0.0, 1.0];
        // A square of two triangles, and one of a ninth of its size far off.
        let triangles = [
            [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0)],
            [corner(0.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)],
            [corner(5.0, 0.0), corner(5.0 + 1.0 / 3.0, 0.0), corner(5.0, 1.0 / 3.0)],
        ];
        let mut meshes = Meshes::default();
        let part = meshes.add(&triangles).unwrap();
        let visual = MeshVisual {
            link: 3,
            pose_in_link: Isometry3::translation(0.0, 0.0, 2.0),
            filename: "plate.stl".into(),
            scale: [0.1; 3],
            rgba: [1.0; 4],
        };
        meshes.fixed.push(crate::robot::meshes::MeshInstance { visual, part });
        let points = meshes.surface(190);
        assert!((185..=190).contains(&points.len()), "{}", points.len());
        assert!(points.iter().all(|p| p.link == 3 && (p.at.z - 2.0).abs() < 1e-9));
        let far = points.iter().filter(|p| p.at.x > 0.4).count();
        assert!((8..=12).contains(&far), "{far}");
        assert_eq!(meshes.surface(0), []);
    }
}
