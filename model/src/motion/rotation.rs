//! Rotations as three rows: a vector v becomes `m v`.
#![allow(missing_docs, reason = "matrix algebra under its usual names")]

use super::vec3::{Vec3, cross, dot, norm, scale, unit_or};

pub type Matrix = [Vec3; 3];

pub const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

pub fn apply(m: &Matrix, v: Vec3) -> Vec3 {
    m.map(|row| dot(row, v))
}

pub fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|i| [m[0][i], m[1][i], m[2][i]])
}

pub fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b);
    a.map(|row| columns.map(|column| dot(row, column)))
}

/// A turn by the length of `vector`, radians, about its direction (Rodrigues).
pub fn about(vector: Vec3) -> Matrix {
    let angle = norm(vector);
    if angle < 1e-12 {
        return IDENTITY;
    }
    let [x, y, z] = scale(vector, 1.0 / angle);
    let (sin, cos) = angle.sin_cos();
    let rest = 1.0 - cos;
    [
        [cos + x * x * rest, x * y * rest - z * sin, x * z * rest + y * sin],
        [y * x * rest + z * sin, cos + y * y * rest, y * z * rest - x * sin],
        [z * x * rest - y * sin, z * y * rest + x * sin, cos + z * z * rest],
    ]
}

/// The shortest turn that takes the direction of `from` to that of `to`; none
/// where they are opposite or have no direction.
pub fn between(from: Vec3, to: Vec3) -> Matrix {
    let (from, to) = (unit_or(from, [0.0; 3]), unit_or(to, [0.0; 3]));
    let axis = cross(from, to);
    let sin = norm(axis);
    if sin < 1e-12 {
        return IDENTITY;
    }
    about(scale(axis, sin.atan2(dot(from, to)) / sin))
}
