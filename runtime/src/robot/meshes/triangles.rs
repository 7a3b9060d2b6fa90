//! Triangles as a page draws them, from whatever file: bounded, finite, each with the normal
//! that its corners give (those in files are often wrong or zero).

/// Longest file that is read, bytes.
pub const LONGEST: u64 = 32 << 20;
/// Triangles of one mesh at most: more than a page draws smoothly.
pub const MOST_TRIANGLES: usize = 200_000;

/// Position and normal.
pub type Corner = [f32; 6];
/// Three positions.
pub type Triangle = [[f32; 3]; 3];

/// Triangles with their normals, those without area left out; the error says why they cannot
/// be drawn.
pub fn drawn(triangles: Vec<Triangle>) -> Result<Vec<[Corner; 3]>, String> {
    if triangles.is_empty() {
        return Err("it has no triangles".into());
    }
    bounded(triangles.len())?;
    if !triangles.iter().flatten().flatten().all(|value| value.is_finite()) {
        return Err("a corner is no point".into());
    }
    Ok(triangles.into_iter().filter_map(with_normal).collect())
}

pub fn bounded(triangles: usize) -> Result<(), String> {
    match triangles > MOST_TRIANGLES {
        true => Err(format!("it has more than {MOST_TRIANGLES} triangles")),
        false => Ok(()),
    }
}

/// The corners with the triangle's normal; `None` of a triangle without area.
fn with_normal(corners: Triangle) -> Option<[Corner; 3]> {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let edge = |from: [f64; 3], to: [f64; 3]| [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let (u, v) = (edge(a, b), edge(a, c));
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = cross.iter().map(|part| part * part).sum::<f64>().sqrt();
    let [x, y, z] = cross.map(|part| (part / length) as f32);
    let known = x.is_finite() && y.is_finite() && z.is_finite();
    known.then(|| corners.map(|[a, b, c]| [a, b, c, x, y, z]))
}
