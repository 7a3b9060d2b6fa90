//! Meshes among the assets of an MJCF model: their files, by name. The files themselves are not
//! read here, so that what a mesh weighs is known only where the model says it.

use std::collections::HashMap;
use std::path::Path;

use k::nalgebra::{Isometry3, Translation3, Vector3};
use roxmltree::Node;
use urdf_rs::{Geometry, Vec3};

use super::attributes::{MeshAsset, MjcfAttributes, unit_quaternion};
use crate::config::RetargetError;

/// All of a model, by name. MuJoCo calls a mesh without a name as its file without the ending.
pub(super) fn read(
    root: Node,
    attributes: &MjcfAttributes,
) -> Result<HashMap<String, MeshAsset>, RetargetError> {
    let compiler = root.children().filter(|node| node.has_tag_name("compiler"));
    let setting = |key: &str| compiler.clone().find_map(|compiler| compiler.attribute(key));
    let folder = Path::new(setting("meshdir").or(setting("assetdir")).unwrap_or_default());
    let plain = setting("strippath") == Some("true");
    let mut meshes = HashMap::new();
    for mesh in attributes.assets(root, "mesh") {
        let Some(file) = mesh.text("file").map(Path::new) else { continue };
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let name = mesh.node.attribute("name").unwrap_or(&stem).to_owned();
        let inside = if plain { Path::new(file.file_name().unwrap_or_default()) } else { file };
        let scale = Vec3(mesh.vector("scale", [1.0; 3])?);
        let filename = folder.join(inside).to_string_lossy().into_owned();
        let at = Vector3::from(mesh.vector("refpos", [0.0; 3])?);
        let turned = unit_quaternion(&mesh.numbers("refquat")?.unwrap_or_default());
        let pose = Isometry3::from_parts(Translation3::from(at), turned).inverse();
        let geometry = Geometry::Mesh { filename, scale: Some(scale) };
        meshes.insert(name, MeshAsset { geometry, pose });
    }
    Ok(meshes)
}
