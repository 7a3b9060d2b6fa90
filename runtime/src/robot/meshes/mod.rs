//! The meshes of a robot, for the page to draw.
//!
//! A mesh is named by the robot's description, which may come from anywhere:
//! only the robot's own files are read ([`RobotFolders`]). What cannot be drawn is left
//! out with a reason; the link is then drawn as if it had no mesh.

mod collada;
mod glb;
mod node_matrix;
mod scene_files;
mod stl;
mod surface;
mod triangles;

pub use self::surface::SurfacePoint;
use self::triangles::{Corner, LONGEST, Triangle, drawn};
use crate::robot::Robot;
use crate::robot::robot_folders::RobotFolders;
use servodance_retarget::{MeshVisual, RobotModel};
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

/// All meshes of a robot together, bytes of what browsers get.
const MOST_BYTES: usize = 96 << 20;
const REASONS: usize = 3;

#[derive(Clone, Debug)]
pub struct MeshInstance {
    pub visual: MeshVisual,
    pub part: usize,
}

#[derive(Clone, Debug, Default)]
#[allow(missing_docs)] // the names say it
pub struct Meshes {
    pub fixed: Vec<MeshInstance>,
    /// Corners of each file, three a triangle: position and normal as f32, little endian.
    pub parts: Vec<Arc<[u8]>>,
    pub bounds: Vec<[[f32; 3]; 2]>,
    pub left_out: Vec<String>,
}

impl Meshes {
    /// Those of a robot; none if it is built in.
    pub fn load(robot: &Robot, model: &RobotModel) -> Self {
        let mut meshes = Self::default();
        let Some(folder) = &robot.folder else {
            return meshes;
        };
        let folders = RobotFolders::of_robot(folder, &robot.urdf);
        let mut known: HashMap<&str, Option<usize>> = HashMap::new();
        let mut reasons = Vec::new();
        for visual in model.meshes() {
            let name = visual.filename.as_str();
            let part = *known.entry(name).or_insert_with(|| {
                let triangles = folders.mesh(name).and_then(|path| open_mesh(&path));
                match triangles.and_then(|triangles| meshes.add(&triangles)) {
                    Ok(part) => Some(part),
                    Err(why) => {
                        reasons.push(format!("mesh {name}: {why}"));
                        None
                    }
                }
            });
            if let Some(part) = part {
                let visual = visual.clone();
                meshes.fixed.push(MeshInstance { visual, part });
            }
        }
        let more = reasons.len().saturating_sub(REASONS);
        reasons.truncate(REASONS);
        if more > 0 {
            reasons.push(format!("{more} more meshes are not drawn either"));
        }
        meshes.left_out = reasons;
        meshes
    }

    fn add(&mut self, triangles: &[[Corner; 3]]) -> Result<usize, String> {
        let all: usize = self.parts.iter().map(|part| part.len()).sum();
        let bytes = size_of_val(triangles);
        if all + bytes > MOST_BYTES {
            return Err(format!("all meshes are more than {} MiB", MOST_BYTES >> 20));
        }
        let corners = triangles.iter().flatten();
        let [mut low, mut high] = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for corner in corners.clone() {
            for axis in 0..3 {
                low[axis] = low[axis].min(corner[axis]);
                high[axis] = high[axis].max(corner[axis]);
            }
        }
        let part: Vec<u8> = corners.flatten().flat_map(|v| v.to_le_bytes()).collect();
        self.parts.push(part.into());
        self.bounds.push([low, high]);
        Ok(self.parts.len() - 1)
    }
}

/// Reads the corners of a description's meshes by their names in it; those that cannot be
/// read have none.
pub(crate) fn mesh_reader(description: &Path) -> impl Fn(&str) -> Vec<[f64; 3]> + use<> {
    let folder = description.parent().unwrap_or(Path::new("")).to_owned();
    let name = Path::new(description.file_name().unwrap_or_default()).to_owned();
    let folders = RobotFolders::of_robot(&folder, &name);
    move |mesh| {
        let triangles = folders.mesh(mesh).and_then(|path| open_mesh(&path));
        let corners = triangles.unwrap_or_default().into_iter().flatten();
        corners.map(|[x, y, z, ..]| [x, y, z].map(f64::from)).collect()
    }
}

/// The triangles of a mesh; the error says why it cannot be drawn.
pub(crate) fn open_mesh(path: &Path) -> Result<Vec<[Corner; 3]>, String> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let kind = KINDS.iter().find(|(known, _)| ending == *known);
    let Some((_, read)) = kind else {
        return Err("only STL, OBJ, DAE and GLB are drawn".into());
    };
    let unreadable = |error: std::io::Error| format!("it cannot be read: {error}");
    let file = std::fs::File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    file.take(LONGEST + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > LONGEST {
        return Err(format!("it is longer than {} MiB", LONGEST >> 20));
    }
    drawn(read(&bytes)?)
}

/// Reads the triangles of a kind of file.
type MeshReader = fn(&[u8]) -> Result<Vec<Triangle>, String>;

/// Endings of files that are drawn.
const KINDS: [(&str, MeshReader); 4] =
    [("stl", stl::read), ("obj", scene_files::obj), ("dae", collada::read), ("glb", glb::read)];
