//! Meshes of a robot's description: drawn from its own folder, and from nowhere
//! else.

use servodance::robot::Robot;
use servodance::show::Meshes;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A cube of this edge as binary STL.
fn cube(edge: f32) -> Vec<u8> {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { edge } else { 0.0 });
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let mut bytes = vec![b' '; 80];
    bytes.extend(12_u32.to_le_bytes());
    for [a, b, c, d] in sides {
        for triangle in [[a, b, c], [a, c, d]] {
            bytes.extend([0; 12]);
            for value in triangle.into_iter().flat_map(corner) {
                bytes.extend(value.to_le_bytes());
            }
            bytes.extend([0; 2]);
        }
    }
    bytes
}

/// A neck whose head is a mesh of this name, in a folder of its own with a
/// stranger's beside it.
struct Home {
    folder: TempDir,
}

impl Home {
    fn new() -> Self {
        let home = Self {
            folder: tempfile::tempdir().expect("a folder"),
        };
        for folder in ["robot/urdf", "robot/meshes", "strange"] {
            std::fs::create_dir_all(home.at(folder)).expect("a folder");
        }
        home.write("robot/meshes/head.stl", &cube(60.0));
        home.write("strange/head.stl", &cube(1.0));
        home
    }

    fn at(&self, path: &str) -> PathBuf {
        self.folder.path().join(path)
    }

    fn write(&self, path: &str, bytes: &[u8]) {
        std::fs::write(self.at(path), bytes).expect("a file");
    }

    fn meshes(&self, filename: &str) -> Meshes {
        self.meshes_of("urdf/neck.urdf", filename)
    }

    /// The same where the description is elsewhere, seen from the robot file.
    fn meshes_of(&self, urdf: &str, filename: &str) -> Meshes {
        let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
        let read = |file: &str| std::fs::read_to_string(configs.join(file)).expect("a config");
        let toml = read("neck.toml").replace("neck.urdf", urdf);
        let mesh = format!("<mesh filename=\"{filename}\" scale=\"0.001 0.001 0.002\"/>");
        let text = read("neck.urdf").replace("<box size=\"0.09 0.1 0.08\"/>", &mesh);
        self.write("robot/robot.toml", toml.as_bytes());
        self.write(&format!("robot/{urdf}"), text.as_bytes());
        let file = self.at("robot/robot.toml");
        let robot = Robot::load(file.to_str().expect("text")).expect("a robot");
        let model = robot.retargeter().expect("a retargeter").model().clone();
        Meshes::load(&robot, &model)
    }
}

#[test]
fn a_mesh_in_the_robots_folder_is_drawn() {
    let home = Home::new();
    let absolute = format!("file://{}", home.at("robot/meshes/head.stl").display());
    for name in [
        "../meshes/head.stl",
        "package://neck_description/meshes/head.stl",
        &absolute,
    ] {
        let meshes = home.meshes(name);
        assert!(meshes.left_out.is_empty(), "{name}: {:?}", meshes.left_out);
        let [fixed] = &meshes.fixed[..] else {
            panic!("{name}: {:?}", meshes.fixed);
        };
        assert_eq!(fixed.visual.scale, [0.001, 0.001, 0.002]);
        assert_eq!(meshes.bounds, [[[0.0; 3], [60.0; 3]]]);
        // Twelve triangles, three corners, a position and a normal.
        assert_eq!(meshes.parts[0].len(), 12 * 3 * 6 * 4);
    }
}

#[test]
fn a_description_elsewhere_brings_the_meshes_of_its_package() {
    let home = Home::new();
    for folder in ["ros/neck_description/urdf", "ros/neck_description/meshes"] {
        std::fs::create_dir_all(home.at(folder)).expect("a folder");
    }
    home.write("ros/neck_description/meshes/face.stl", &cube(60.0));
    let urdf = "../ros/neck_description/urdf/neck.urdf";
    let mesh = "package://neck_description/meshes/face.stl";
    assert!(
        home.meshes_of(urdf, mesh).fixed.is_empty(),
        "no package yet"
    );
    home.write("ros/neck_description/package.xml", b"<package/>");
    assert_eq!(home.meshes_of(urdf, mesh).fixed.len(), 1);
    assert_eq!(home.meshes_of(urdf, "../meshes/face.stl").fixed.len(), 1);
    let strange = home.meshes_of(urdf, "../../../strange/head.stl");
    assert!(strange.left_out[0].contains("outside"), "{strange:?}");
}

#[test]
fn what_is_outside_missing_or_damaged_is_left_out_and_said() {
    let home = Home::new();
    let outside = format!("file://{}", home.at("strange/head.stl").display());
    std::os::unix::fs::symlink(
        home.at("strange/head.stl"),
        home.at("robot/meshes/link.stl"),
    )
    .expect("a link");
    let whole = cube(60.0);
    home.write("robot/meshes/cut.stl", &whole[..whole.len() - 9]);
    home.write("robot/meshes/head.dae", b"<COLLADA/>");
    for (name, why) in [
        ("../../strange/head.stl", "outside the robot's folder"),
        (
            "package://../strange/head.stl",
            "outside the robot's folder",
        ),
        (
            "package://x/../../strange/head.stl",
            "outside the robot's folder",
        ),
        ("../meshes/link.stl", "outside the robot's folder"),
        (&outside, "outside the robot's folder"),
        ("file:///etc/passwd", "outside the robot's folder"),
        ("http://example.org/head.stl", "not a file of the robot"),
        ("../meshes/gone.stl", "no such file"),
        ("../meshes/cut.stl", "cut off"),
        ("../meshes/head.dae", "only STL"),
        ("../meshes", "only STL"),
    ] {
        let meshes = home.meshes(name);
        assert!(meshes.fixed.is_empty() && meshes.parts.is_empty(), "{name}");
        let [line] = &meshes.left_out[..] else {
            panic!("{name}: {:?}", meshes.left_out);
        };
        assert!(line.contains(name) && line.contains(why), "{line}");
    }
}
