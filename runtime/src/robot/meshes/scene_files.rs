//! OBJ meshes, and what the crate `mesh-loader` makes of a file of several meshes. Materials and
//! textures are left out: a link has the colour that its description gives it.

use super::node_matrix::{IDENTITY, Matrix, moved};
use super::triangles::{Triangle, bounded};
use mesh_loader::{Mesh, Scene};
use std::io;
use std::panic::catch_unwind;

/// The triangles of an OBJ file.
pub fn obj(bytes: &[u8]) -> Result<Vec<Triangle>, String> {
    let no_materials = |_: &std::path::Path| Err::<Vec<u8>, _>(io::ErrorKind::NotFound.into());
    let scene = parsed(|| mesh_loader::obj::from_slice(bytes, None, no_materials), "OBJ")?;
    let mut triangles = Vec::new();
    scene.meshes.iter().try_for_each(|mesh| add_mesh(mesh, &IDENTITY, &mut triangles))?;
    Ok(triangles)
}

/// What a parser makes of a file. A parser that panics on a damaged one has said so; the robot
/// dances without that mesh.
pub(super) fn parsed(
    parse: impl FnOnce() -> io::Result<Scene> + std::panic::UnwindSafe,
    kind: &str,
) -> Result<Scene, String> {
    let broken = |_| format!("it is no {kind} that can be read");
    catch_unwind(parse).map_err(broken)?.map_err(|error| {
        let told = error.to_string();
        format!("it is no {kind}: {}", told.lines().next().unwrap_or_default())
    })
}

/// Adds a mesh that is put in its place.
pub(super) fn add_mesh(
    mesh: &Mesh,
    place: &Matrix,
    triangles: &mut Vec<Triangle>,
) -> Result<(), String> {
    bounded(triangles.len() + mesh.faces.len())?;
    for face in &mesh.faces {
        let corner = |at: u32| mesh.vertices.get(at as usize).map(|corner| moved(place, corner));
        let [a, b, c] = face.map(corner);
        let corners = a.zip(b).zip(c).map(|((a, b), c)| [a, b, c]);
        triangles.push(corners.ok_or("a face has a corner that there is not")?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

    #[test]
    fn a_square_becomes_two_triangles() {
        let square = obj(OBJ.as_bytes()).unwrap();
        assert_eq!(square.len(), 2);
        assert!(square.iter().flatten().all(|corner| corner[2] == 0.0));
    }

    #[test]
    fn what_is_damaged_is_refused_or_drawn_and_nothing_breaks_down() {
        for length in 0..OBJ.len() {
            let _ = obj(&OBJ.as_bytes()[..length]);
        }
        for damaged in ["f 1 2 3\n", "v 0 0 0\nf 1 1 99999999999999\n", "\u{0}\u{ff}"] {
            assert!(obj(damaged.as_bytes()).unwrap_or_default().is_empty(), "{damaged}");
        }
    }
}
