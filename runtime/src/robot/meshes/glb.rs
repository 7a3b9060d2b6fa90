//! GLB meshes (binary glTF 2.0): triangles of all nodes of the scene, where the nodes put
//! them. Read here: the crates for it bring image decoders or another build of serde along,
//! and a page draws positions alone.
//!
//! glTF has y up and metres; a robot's axes are z up. Refused: what is compressed, or points
//! outside of the file. Nothing is allocated for a count that a file claims.

use super::node_matrix::{Matrix, moved, multiply};
use super::triangles::{Triangle, bounded};
use serde::Deserialize;

const MAGIC: u32 = 0x4654_6c67;
const JSON: u32 = 0x4e4f_534a;
const BINARY: u32 = 0x004e_4942;
const FLOAT: u32 = 5126;
const TRIANGLES: u32 = 4;
/// Nodes inside of nodes.
const DEEPEST: usize = 64;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Gltf {
    #[serde(default)]
    scene: usize,
    #[serde(default)]
    scenes: Vec<Scene>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<Mesh>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<BufferView>,
}

#[derive(Deserialize)]
struct Scene {
    #[serde(default)]
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
struct Node {
    mesh: Option<usize>,
    #[serde(default)]
    children: Vec<usize>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    mode: Option<u32>,
}

#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    count: usize,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct BufferView {
    #[serde(default)]
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

/// From y up to z up.
const UPRIGHT: Matrix =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// The triangles of a file; the error says why it cannot be drawn.
pub fn read(bytes: &[u8]) -> Result<Vec<Triangle>, String> {
    let (json, binary) = chunks(bytes).ok_or("it is no GLB, or cut off")?;
    let gltf: Gltf =
        serde_json::from_slice(json).map_err(|error| format!("its description: {error}"))?;
    let mut reading = Reading { gltf: &gltf, binary, triangles: Vec::new() };
    let roots = gltf.scenes.get(gltf.scene).map_or(&[][..], |scene| &scene.nodes);
    for &node in roots {
        reading.node(node, &UPRIGHT, 0)?;
    }
    Ok(reading.triangles)
}

/// The description and the numbers.
fn chunks(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    if word(0)? != MAGIC || word(4)? != 2 {
        return None;
    }
    let chunk = |at: usize, kind: u32| {
        let length = word(at)? as usize;
        let from = at.checked_add(8)?;
        (word(at + 4)? == kind).then(|| bytes.get(from..from.checked_add(length)?))?
    };
    let json = chunk(12, JSON)?;
    let binary = chunk(20 + json.len(), BINARY).unwrap_or_default();
    Some((json, binary))
}

struct Reading<'a> {
    gltf: &'a Gltf,
    binary: &'a [u8],
    triangles: Vec<Triangle>,
}

impl Reading<'_> {
    fn node(&mut self, place: usize, parent: &Matrix, depth: usize) -> Result<(), String> {
        let node = self.gltf.nodes.get(place).ok_or("a node is missing")?;
        if depth > DEEPEST {
            return Err("its nodes go in a circle".into());
        }
        let world = multiply(parent, &node.local());
        if let Some(mesh) = node.mesh {
            let mesh = self.gltf.meshes.get(mesh).ok_or("a mesh is missing")?;
            for primitive in &mesh.primitives {
                self.primitive(primitive, &world)?;
            }
        }
        for &child in &node.children {
            // What grows by a circle is bounded by its triangles, too.
            self.node(child, &world, depth + 1)?;
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &Primitive, world: &Matrix) -> Result<(), String> {
        if primitive.mode.is_some_and(|mode| mode != TRIANGLES) {
            return Ok(()); // points and lines
        }
        let position = primitive.attributes.position.ok_or("a mesh has no positions")?;
        let corners = self.positions(position)?;
        let places: Vec<usize> = match primitive.indices {
            Some(indices) => self.indices(indices)?,
            None => (0..corners.len()).collect(),
        };
        bounded(self.triangles.len() + places.len() / 3)?;
        for three in places.chunks_exact(3) {
            let corner = |place: usize| {
                let corner = corners.get(place).ok_or("a face has a corner that there is not")?;
                Ok::<_, String>(moved(world, corner))
            };
            self.triangles.push([corner(three[0])?, corner(three[1])?, corner(three[2])?]);
        }
        Ok(())
    }

    fn positions(&self, accessor: usize) -> Result<Vec<[f32; 3]>, String> {
        let accessor = self.gltf.accessors.get(accessor).ok_or("positions are missing")?;
        if accessor.component_type != FLOAT {
            return Err("its positions are no floats (compressed meshes are not drawn)".into());
        }
        let number = |bytes: &[u8], at: usize| {
            f32::from_le_bytes([0, 1, 2, 3].map(|byte| bytes[4 * at + byte]))
        };
        let items = self.items(accessor, 12)?;
        Ok(items.map(|bytes| [0, 1, 2].map(|axis| number(bytes, axis))).collect())
    }

    fn indices(&self, accessor: usize) -> Result<Vec<usize>, String> {
        let accessor = self.gltf.accessors.get(accessor).ok_or("faces are missing")?;
        let size = match accessor.component_type {
            5121 => 1,
            5123 => 2,
            5125 => 4,
            _ => return Err("its faces are no whole numbers".into()),
        };
        let whole = |bytes: &[u8]| {
            bytes.iter().rev().fold(0, |whole, byte| whole << 8 | usize::from(*byte))
        };
        Ok(self.items(accessor, size)?.map(whole).collect())
    }

    /// The items of an accessor, each of `size` bytes; all of them are in the file.
    fn items(
        &self,
        accessor: &Accessor,
        size: usize,
    ) -> Result<impl Iterator<Item = &[u8]>, String> {
        let outside = "its numbers are outside of the file";
        let view = accessor.buffer_view.and_then(|view| self.gltf.buffer_views.get(view));
        let view = view.filter(|view| view.buffer == 0).ok_or(outside)?;
        let end = view.byte_offset.checked_add(view.byte_length).ok_or(outside)?;
        let bytes = self.binary.get(view.byte_offset..end).ok_or(outside)?;
        let bytes = bytes.get(accessor.byte_offset..).ok_or(outside)?;
        let stride = view.byte_stride.unwrap_or(size).max(size);
        let needed = accessor.count.checked_sub(1).map_or(Some(0), |last| {
            last.checked_mul(stride).and_then(|before| before.checked_add(size))
        });
        let bytes = needed.and_then(|needed| bytes.get(..needed)).ok_or(outside)?;
        Ok(bytes.chunks(stride).map(move |item| &item[..size]))
    }
}

impl Node {
    fn local(&self) -> Matrix {
        if let Some(m) = self.matrix {
            return std::array::from_fn(|column| std::array::from_fn(|row| m[4 * column + row]));
        }
        let [x, y, z, w] = self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let scale = self.scale.unwrap_or([1.0; 3]);
        let [tx, ty, tz] = self.translation.unwrap_or_default();
        let turned = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)],
            [2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)],
            [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let column = |n: usize| {
            let [a, b, c] = turned[n].map(|part: f64| part * scale[n]);
            [a, b, c, 0.0]
        };
        [column(0), column(1), column(2), [tx, ty, tz, 1.0]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One triangle, moved 2 m up (y) by its node; its corners as 16-bit numbers.
    fn file() -> Vec<u8> {
        let mut binary = Vec::new();
        for value in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            binary.extend(value.to_le_bytes());
        }
        for index in [0_u16, 1, 2, 0] {
            binary.extend(index.to_le_bytes());
        }
        let mut json = br#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
            "nodes":[{"mesh":0,"translation":[0,2,0]}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
            "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                         {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
            "bufferViews":[{"buffer":0,"byteLength":36},
                           {"buffer":0,"byteOffset":36,"byteLength":6}],
            "buffers":[{"byteLength":44}]}"#
            .to_vec();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bytes = Vec::new();
        bytes.extend(MAGIC.to_le_bytes());
        bytes.extend(2_u32.to_le_bytes());
        bytes.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
        for (kind, chunk) in [(JSON, json), (BINARY, binary)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind.to_le_bytes());
            bytes.extend(chunk);
        }
        bytes
    }

    #[test]
    fn a_mesh_is_where_its_node_puts_it_and_stands_upright() {
        let triangles = read(&file()).unwrap();
        // glTF's y is up, its z towards the viewer.
        assert_eq!(triangles, [[[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 0.0, 3.0]]]);
    }

    #[test]
    fn what_is_damaged_is_refused_and_nothing_panics() {
        let whole = file();
        for length in 0..whole.len() - 8 {
            assert!(read(&whole[..length]).is_err(), "{length}");
        }
        for (place, value) in (0..whole.len()).flat_map(|place| [(place, 0xff), (place, b'9')]) {
            let mut damaged = whole.clone();
            damaged[place] = value;
            let _ = read(&damaged);
        }
        let text = String::from_utf8_lossy(&whole).replace("\"mesh\":0", "\"children\":[0]");
        let mut circle = whole.clone();
        let at = 20;
        let json = text.as_bytes();
        circle.truncate(at);
        circle.extend(&json[json.iter().position(|b| *b == b'{').unwrap()..]);
        assert!(read(&circle).is_err());
    }
}
