//! OBJ and COLLADA (DAE) meshes, through the crate `mesh-loader`: all meshes of a file as one,
//! where its nodes put them, metres. Materials and textures are left out: a link has the
//! colour that its description gives it.

use super::triangles::{Triangle, bounded};
use std::io;
use std::panic::catch_unwind;

/// The triangles of an OBJ file.
pub fn obj(bytes: &[u8]) -> Result<Vec<Triangle>, String> {
    let no_materials = |_: &std::path::Path| Err::<Vec<u8>, _>(io::ErrorKind::NotFound.into());
    parsed(|| mesh_loader::obj::from_slice(bytes, None, no_materials), "OBJ")
}

/// The triangles of a COLLADA file.
pub fn collada(bytes: &[u8]) -> Result<Vec<Triangle>, String> {
    let text = String::from_utf8_lossy(bytes);
    let (unit_m, in_metres) = without_unit(&text);
    let mut triangles =
        parsed(|| mesh_loader::collada::from_slice(in_metres.as_bytes()), "COLLADA")?;
    triangles.iter_mut().flatten().flatten().for_each(|value| *value *= unit_m);
    Ok(triangles)
}

/// A COLLADA file's unit, metres, and the file as if that were 1 m: `mesh-loader` scales corners
/// by the unit and leaves the places of nodes as they are.
fn without_unit(text: &str) -> (f32, String) {
    let whole = || (1.0, text.to_owned());
    let Some((before, rest)) = text.split_once("<unit") else { return whole() };
    let Some((unit, after)) = rest.split_once('>') else { return whole() };
    let value = unit.split_once("meter=\"").and_then(|(_, rest)| rest.split('"').next());
    let unit_m = value.and_then(|value| value.trim().parse().ok()).unwrap_or(1.0);
    let end = if unit.ends_with('/') { "/" } else { "" };
    (unit_m, format!("{before}<unit meter=\"1\"{end}>{after}"))
}

/// What a parser makes of a file. A parser that panics on a damaged one has said so; the robot
/// dances without that mesh.
fn parsed(
    parse: impl FnOnce() -> io::Result<mesh_loader::Scene> + std::panic::UnwindSafe,
    kind: &str,
) -> Result<Vec<Triangle>, String> {
    let broken = |_| format!("it is no {kind} that can be read");
    let scene = catch_unwind(parse).map_err(broken)?;
    let scene = scene.map_err(|error| {
        let told = error.to_string();
        format!("it is no {kind}: {}", told.lines().next().unwrap_or_default())
    })?;
    let mut triangles = Vec::new();
    for mesh in &scene.meshes {
        bounded(triangles.len() + mesh.faces.len())?;
        for face in &mesh.faces {
            let corner = |place: u32| mesh.vertices.get(place as usize).copied();
            let [a, b, c] = face.map(corner);
            let corners = a.zip(b).zip(c).map(|((a, b), c)| [a, b, c]);
            triangles.push(corners.ok_or("a face has a corner that there is not")?);
        }
    }
    Ok(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    const DAE: &str = r##"<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.001" name="millimeter"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">0 0 0 1000 0 0 0 1000 0</float_array>
<technique_common><accessor source="#a" count="3" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n">
<translate>0 0 500</translate><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##;

    #[test]
    fn a_square_becomes_two_triangles_and_a_node_puts_its_mesh_in_its_place_in_metres() {
        let square = obj(OBJ.as_bytes()).unwrap();
        assert_eq!(square.len(), 2);
        assert!(square.iter().flatten().all(|corner| corner[2] == 0.0));
        let triangle = collada(DAE.as_bytes()).unwrap();
        let near = |a: &[f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        assert_eq!(triangle.len(), 1);
        for (corner, wanted) in
            triangle[0].iter().zip([[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.0, 1.0, 0.5]])
        {
            assert!(near(corner, wanted), "{triangle:?}");
        }
    }

    #[test]
    fn what_is_damaged_is_refused_or_drawn_and_nothing_breaks_down() {
        for text in [OBJ, DAE] {
            for length in 0..text.len() {
                let part = &text.as_bytes()[..length];
                let _ = (obj(part), collada(part));
            }
        }
        for damaged in ["f 1 2 3\n", "v 0 0 0\nf 1 1 99999999999999\n", "\u{0}\u{ff}"] {
            assert!(obj(damaged.as_bytes()).unwrap_or_default().is_empty(), "{damaged}");
        }
        assert!(collada(b"<COLLADA/>").unwrap_or_default().is_empty());
    }
}
