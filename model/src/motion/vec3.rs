//! Vectors of three `f64`: the few operations that motion code needs.
#![allow(missing_docs, reason = "vector algebra under its usual names")]

use servodance_types::Point3;

pub type Vec3 = [f64; 3];

pub fn wide(p: Point3) -> Vec3 {
    p.map(f64::from)
}

pub fn narrow(v: Vec3) -> Point3 {
    v.map(|x| x as f32)
}

pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: Vec3, s: f64) -> Vec3 {
    a.map(|x| x * s)
}

pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

pub fn lerp(a: Vec3, b: Vec3, t: f64) -> Vec3 {
    add(scale(a, 1.0 - t), scale(b, t))
}

/// `a` with length one; `fallback` where `a` has no direction.
pub fn unit_or(a: Vec3, fallback: Vec3) -> Vec3 {
    let length = norm(a);
    if length > 1e-9 { scale(a, 1.0 / length) } else { fallback }
}

/// `v` turned by `angle_rad` about the vertical: +z turns towards +x.
pub fn turn(v: Vec3, angle_rad: f64) -> Vec3 {
    let (sin, cos) = angle_rad.sin_cos();
    [cos * v[0] + sin * v[2], v[1], cos * v[2] - sin * v[0]]
}
