//! COLLADA (DAE) meshes: all of a file as one, where its nodes put them, metres. The crate
//! `mesh-loader` reads their corners. Nodes are read here, because the crate puts nodes inside
//! of nodes in the wrong place and draws a mesh that several nodes show once.
//!
//! `up_axis` is left aside, as RViz does: descriptions are made for that.

use super::node_matrix::{IDENTITY, Matrix, from_rows, multiply};
use super::scene_files::{add_mesh, parsed};
use super::triangles::Triangle;
use roxmltree::{Document, Node, ParsingOptions};
use servodance_retarget::nalgebra::{Rotation3, Unit, Vector3};
use std::collections::HashMap;

/// Nodes inside of nodes.
const DEEPEST: usize = 64;
/// Elements of a file.
const MOST_ELEMENTS: u32 = 500_000;
/// Nodes that a scene shows, those that it shows again counted again.
const MOST_NODES: usize = 10_000;

/// A mesh by its name, and where it is shown.
struct Shown<'a> {
    mesh: &'a str,
    place: Matrix,
}

/// The triangles of a COLLADA file.
pub fn read(bytes: &[u8]) -> Result<Vec<Triangle>, String> {
    let text = String::from_utf8_lossy(bytes);
    // Without these the crate leaves corners as they are.
    let bare = text.replace("instance_geometry", "instance_node");
    let scene = parsed(|| mesh_loader::collada::from_slice(bare.as_bytes()), "COLLADA")?;
    let options = ParsingOptions { nodes_limit: MOST_ELEMENTS, ..ParsingOptions::default() };
    let document = Document::parse_with_options(&text, options)
        .map_err(|error| format!("it is no COLLADA: {error}"))?;
    let shown = shown(&document)?;
    let mut triangles = Vec::new();
    for Shown { mesh, place } in &shown {
        let mut named = scene.meshes.iter().filter(|other| other.name == *mesh);
        named.try_for_each(|mesh| add_mesh(mesh, place, &mut triangles))?;
    }
    Ok(triangles)
}

/// The meshes of the scene that the file shows, else of its first.
fn shown<'a>(document: &'a Document) -> Result<Vec<Shown<'a>>, String> {
    let of_name =
        |name: &'static str| document.descendants().filter(move |it| it.has_tag_name(name));
    let unit = of_name("unit").find_map(|unit| unit.attribute("meter")?.trim().parse().ok());
    let unit_m: f64 = unit.unwrap_or(1.0);
    let wanted = of_name("instance_visual_scene").find_map(|scene| target(&scene));
    let scenes = || of_name("visual_scene");
    let scene = scenes().find(|scene| scene.attribute("id") == wanted).or_else(|| scenes().next());
    let mut scale = IDENTITY;
    (0..3).for_each(|axis| scale[axis][axis] = unit_m);
    let named = of_name("node").filter_map(|node| Some((node.attribute("id")?, node)));
    let mut walk = Walk { named: named.collect(), nodes: 0, shown: Vec::new() };
    for node in scene.iter().flat_map(Node::children).filter(|child| child.has_tag_name("node")) {
        walk.node(&node, &scale, 0)?;
    }
    Ok(walk.shown)
}

/// A walk through the nodes of a scene.
struct Walk<'a> {
    named: HashMap<&'a str, Node<'a, 'a>>,
    nodes: usize,
    shown: Vec<Shown<'a>>,
}

impl<'a> Walk<'a> {
    /// Adds what a node and those inside of it show.
    fn node(&mut self, node: &Node<'a, 'a>, parent: &Matrix, depth: usize) -> Result<(), String> {
        if depth > DEEPEST {
            return Err("its nodes go in a circle".into());
        }
        self.nodes += 1;
        if self.nodes > MOST_NODES {
            return Err(format!("it shows more than {MOST_NODES} nodes"));
        }
        let parts = node.children().filter_map(|part| transform(&part));
        let place = parts.fold(*parent, |place, part| multiply(&place, &part));
        for part in node.children() {
            match part.tag_name().name() {
                "node" => self.node(&part, &place, depth + 1)?,
                "instance_node" => {
                    let other = target(&part).and_then(|id| self.named.get(id)).copied();
                    if let Some(other) = other {
                        self.node(&other, &place, depth + 1)?;
                    }
                }
                "instance_geometry" => {
                    self.shown.extend(target(&part).map(|mesh| Shown { mesh, place }));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// The name that an element refers to in the same file.
fn target<'a>(element: &Node<'a, 'a>) -> Option<&'a str> {
    element.attribute("url")?.strip_prefix('#')
}

/// A part of a node's place; `None` of what is none, and of a number that cannot be read.
fn transform(element: &Node) -> Option<Matrix> {
    let numbers: Result<Vec<f64>, _> =
        element.text().unwrap_or_default().split_whitespace().map(str::parse).collect();
    let numbers = numbers.ok()?;
    match (element.tag_name().name(), &numbers[..]) {
        ("matrix", rows) => Some(from_rows(rows.try_into().ok()?)),
        ("translate", &[x, y, z]) => {
            let mut place = IDENTITY;
            place[3] = [x, y, z, 1.0];
            Some(place)
        }
        ("scale", &[x, y, z]) => {
            let mut place = IDENTITY;
            (place[0][0], place[1][1], place[2][2]) = (x, y, z);
            Some(place)
        }
        ("rotate", &[x, y, z, degrees]) => {
            let axis = Unit::try_new(Vector3::new(x, y, z), 1e-9)?;
            Some(Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous().into())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle in millimetres that two nodes show, one inside of another, and a node apart.
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
<matrix>0.5 0 0 0 0 0 -0.5 0 0 0.5 0 0 0 0 0 1</matrix><node id="inside">
<translate>0 0 500</translate><rotate>0 0 1 90</rotate><instance_geometry url="#g"/></node></node>
<node id="apart"><translate>0 0 5</translate><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"##;

    #[test]
    fn nodes_put_a_mesh_in_its_places_in_metres() {
        let triangles = read(DAE.as_bytes()).unwrap();
        let wanted = [
            // Turned about z, raised, halved and turned again.
            [[0.0, -0.25, 0.0], [0.0, -0.25, 0.5], [-0.5, -0.25, 0.0]],
            [[0.0, 0.0, 0.005], [1.0, 0.0, 0.005], [0.0, 1.0, 0.005]],
        ];
        assert_eq!(triangles.len(), 2);
        let seen = triangles.as_flattened().as_flattened();
        for (seen, wanted) in seen.iter().zip(wanted.as_flattened().as_flattened()) {
            assert!((seen - wanted).abs() < 1e-6, "{triangles:?}");
        }
    }

    #[test]
    fn nodes_in_a_circle_are_refused() {
        let circle = DAE.replace(
            "<instance_geometry url=\"#g\"/></node></node>",
            "<instance_node url=\"#n\"/></node></node>",
        );
        assert!(read(circle.as_bytes()).unwrap_err().contains("circle"));
    }

    /// Each node shows the next one twice.
    #[test]
    fn nodes_that_double_are_refused() {
        let doubled: String = (0..40)
            .map(|n| {
                let next = format!("<instance_node url=\"#d{}\"/>", n + 1);
                format!("<node id=\"d{n}\">{next}{next}</node>")
            })
            .collect();
        let many = DAE.replace("<node id=\"apart\">", &format!("{doubled}<node id=\"apart\">"));
        assert!(read(many.as_bytes()).unwrap_err().contains("more than"));
    }

    #[test]
    fn what_is_damaged_is_refused_or_drawn_and_nothing_breaks_down() {
        for length in 0..DAE.len() {
            let _ = read(&DAE.as_bytes()[..length]);
        }
        assert!(read(b"<COLLADA/>").unwrap_or_default().is_empty());
    }
}
