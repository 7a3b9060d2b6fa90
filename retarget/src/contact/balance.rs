//! The area that the feet stand on, and how far a point is outside of it.

use k::nalgebra::{Isometry3, Point3, Vector3};

const CORNERS: usize = 8;

/// One edge of the support polygon: inside is `normal . p <= offset_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PolygonEdge {
    pub normal: Vector3<f64>,
    pub offset_m: f64,
}

impl PolygonEdge {
    /// How far outside `point` is, metres; negative inside.
    pub fn outside_m(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) - self.offset_m
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SupportPolygon {
    pub edges: Vec<PolygonEdge>,
    sole_m: [f64; 2],
    corners: Vec<Vector3<f64>>,
}

impl SupportPolygon {
    /// From the poses of the soles (upright in the world: x forward) and the
    /// length and width of each.
    pub fn new(feet: &[Isometry3<f64>; 2], sole_m: [f64; 2]) -> Self {
        let mut support = Self {
            edges: Vec::with_capacity(CORNERS + 1),
            sole_m,
            corners: Vec::with_capacity(CORNERS),
        };
        support.stand_on(feet, [true; 2]);
        support
    }

    /// The area of the feet that are down; does not allocate. With none down it
    /// stays as it was.
    pub fn stand_on(&mut self, feet: &[Isometry3<f64>; 2], down: [bool; 2]) {
        if down == [false; 2] {
            return;
        }
        self.corners.clear();
        for (foot, _) in feet.iter().zip(down).filter(|(_, down)| *down) {
            self.corners.extend(sole_corners(foot, self.sole_m));
        }
        hull(&self.corners, &mut self.edges);
    }

    /// Middle of the corners.
    pub fn middle(&self) -> Vector3<f64> {
        let sum: Vector3<f64> = self.corners.iter().sum();
        let middle = sum / self.corners.len().max(1) as f64;
        Vector3::new(middle.x, middle.y, 0.0)
    }

    /// Farthest distance outside any edge, metres; negative inside.
    pub fn outside_m(&self, point: &Point3<f64>) -> f64 {
        self.edges.iter().map(|edge| edge.outside_m(point)).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Corners of the sole of a foot that stands flat at `foot`, world, metres.
pub(crate) fn sole_corners(foot: &Isometry3<f64>, [length, width]: [f64; 2]) -> [Vector3<f64>; 4] {
    let heading = foot_heading(foot);
    let side = Vector3::z().cross(&heading);
    [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(along, across)| {
        foot.translation.vector + heading * (along * length / 2.0) + side * (across * width / 2.0)
    })
}

/// Horizontal direction nearest to the world's x that the sole points along:
/// whichever of its axes that is.
fn foot_heading(foot: &Isometry3<f64>) -> Vector3<f64> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let turned = axes
        .into_iter()
        .map(|axis| foot.rotation * axis)
        .flat_map(|axis| [axis, -axis])
        .max_by(|a, b| a.x.total_cmp(&b.x))
        .unwrap_or_else(Vector3::x);
    let flat = Vector3::new(turned.x, turned.y, 0.0);
    flat.try_normalize(1e-9).unwrap_or_else(Vector3::x)
}

/// Edges of the convex hull: pairs with all other points on one side.
fn hull(points: &[Vector3<f64>], edges: &mut Vec<PolygonEdge>) {
    edges.clear();
    for (i, from) in points.iter().enumerate() {
        for (j, to) in points.iter().enumerate() {
            let along = to - from;
            let normal = Vector3::new(along.y, -along.x, 0.0);
            let Some(normal) = normal.try_normalize(1e-9) else {
                continue;
            };
            let offset_m = normal.dot(from);
            let all_inside = points.iter().all(|p| normal.dot(p) <= offset_m + 1e-9);
            let known = edges.iter().any(|edge| edge.normal.dot(&normal) > 1.0 - 1e-9);
            if i != j && all_inside && !known && edges.len() < edges.capacity() {
                edges.push(PolygonEdge { normal, offset_m });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_soles_make_one_rectangle() {
        let foot = |y: f64| Isometry3::translation(0.1, y, 0.0);
        let support = SupportPolygon::new(&[foot(0.05), foot(-0.05)], [0.2, 0.06]);
        assert_eq!(support.edges.len(), 4);
        assert!((support.outside_m(&Point3::new(0.1, 0.0, 0.3)) + 0.08).abs() < 1e-12);
        assert!((support.outside_m(&Point3::new(0.25, 0.0, 0.3)) - 0.05).abs() < 1e-12);
    }
}
