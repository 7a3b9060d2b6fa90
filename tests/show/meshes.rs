//! Meshes of a robot's description: drawn from its own folder, and from nowhere
//! else.

use servodance_retarget::DraftOptions;
use servodance_runtime::robot::Robot;
use servodance_runtime::robot::{Meshes, Overrides, new_robot};
use servodance_training::choreography::trial_dance;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A cube of this edge as binary STL.
fn cube(edge: f32) -> Vec<u8> {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { edge } else { 0.0 });
    let sides =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
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
        let home = Self { folder: tempfile::tempdir().expect("a folder") };
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

    /// The same where the user names a description, seen from the robot file.
    fn meshes_of(&self, urdf: &str, filename: &str) -> Meshes {
        self.write_description(&format!("robot/{urdf}"), filename);
        let toml = include_str!("../../configs/neck.toml");
        self.write("robot/robot.toml", toml.as_bytes());
        let named = Overrides::from_user(&[format!("urdf={urdf}")]).expect("a key");
        let file = self.at("robot/robot.toml");
        meshes_with(&file, &named)
    }

    /// A neck whose head is this mesh.
    fn write_description(&self, path: &str, filename: &str) {
        let mesh = format!("<mesh filename=\"{filename}\" scale=\"0.001 0.001 0.002\"/>");
        let text = include_str!("../../configs/neck.urdf");
        let text = text.replace("<box size=\"0.09 0.1 0.08\"/>", &mesh);
        self.write(path, text.as_bytes());
    }
}

fn meshes_with(file: &Path, overrides: &Overrides) -> Meshes {
    let robot = Robot::load_with(file.to_str().expect("text"), overrides).expect("a robot");
    let model = robot.retargeter().expect("a retargeter").model().clone();
    Meshes::load(&robot, &model)
}

#[test]
fn a_mesh_in_the_robots_folder_is_drawn() {
    let home = Home::new();
    let absolute = format!("file://{}", home.at("robot/meshes/head.stl").display());
    for name in ["../meshes/head.stl", "package://neck_description/meshes/head.stl", &absolute] {
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
    assert!(home.meshes_of(urdf, mesh).fixed.is_empty(), "no package yet");
    assert_eq!(home.meshes_of(urdf, "../meshes/face.stl").fixed.len(), 1, "a folder of meshes");
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
    std::os::unix::fs::symlink(home.at("strange/head.stl"), home.at("robot/meshes/link.stl"))
        .expect("a link");
    let whole = cube(60.0);
    home.write("robot/meshes/cut.stl", &whole[..whole.len() - 9]);
    home.write("robot/meshes/head.dae", b"<COLLADA/>");
    home.write("robot/meshes/head.ply", b"ply");
    for (name, why) in [
        ("../../strange/head.stl", "outside the robot's folder"),
        ("package://../strange/head.stl", "outside the robot's folder"),
        ("package://x/../../strange/head.stl", "outside the robot's folder"),
        ("../meshes/link.stl", "outside the robot's folder"),
        (&outside, "outside the robot's folder"),
        ("file:///etc/passwd", "outside the robot's folder"),
        ("http://example.org/head.stl", "not a file of the robot"),
        ("../meshes/gone.stl", "no such file"),
        ("../meshes/cut.stl", "cut off"),
        ("../meshes/head.dae", "no COLLADA"),
        ("../meshes/head.ply", "only STL, OBJ, DAE and GLB"),
        ("../meshes", "no file"),
    ] {
        let meshes = home.meshes(name);
        assert!(meshes.fixed.is_empty() && meshes.parts.is_empty(), "{name}");
        let [line] = &meshes.left_out[..] else {
            panic!("{name}: {:?}", meshes.left_out);
        };
        assert!(line.contains(name) && line.contains(why), "{line}");
    }
}

#[test]
fn a_new_robot_file_brings_what_is_drawn_of_a_description_elsewhere() {
    let home = Home::new();
    for folder in ["ros/neck_description/urdf", "ros/neck_description/meshes"] {
        std::fs::create_dir_all(home.at(folder)).expect("a folder");
    }
    home.write("ros/neck_description/package.xml", b"<package/>");
    home.write("ros/neck_description/meshes/face.stl", &cube(60.0));
    let urdf = home.at("ros/neck_description/urdf/neck.urdf");
    let toml = home.at("robot/my robot.toml");
    for (mesh, drawn) in [
        ("package://neck_description/meshes/face.stl", true),
        ("../meshes/face.stl", true),
        ("../../../strange/head.stl", false),
        ("../meshes/face.dae", false),
    ] {
        home.write_description("ros/neck_description/urdf/neck.urdf", mesh);
        let new = new_robot(&urdf, &toml, true, DraftOptions::default(), &trial_dance(), &[])
            .expect("a robot file");
        let left = format!("not copied: mesh {mesh}: ");
        let said = new.lines.iter().any(|line| line.starts_with(&left));
        assert_eq!(said, !drawn, "{:?}", new.lines);
        // The folder goes where the description is not.
        let moved = tempfile::tempdir().expect("a folder");
        for file in new.files.iter().rev() {
            let target = moved.path().join(file.file_name().expect("a name"));
            std::fs::rename(file, target).expect("moved");
        }
        let meshes = meshes_with(&moved.path().join("my robot.toml"), &Overrides::default());
        assert_eq!(meshes.fixed.len(), usize::from(drawn), "{meshes:?}");
        if drawn {
            assert_eq!(meshes.bounds, [[[0.0; 3], [60.0; 3]]]);
        }
    }
}

#[test]
fn a_new_robot_file_from_mjcf_brings_its_meshes_and_leaves_those_where_they_are_that_are_beside_it()
{
    let home = Home::new();
    let mjcf = r#"<mujoco><compiler meshdir="assets"/>
        <asset><mesh name="head" file="head.stl" scale="0.001 0.001 0.001"/></asset>
        <worldbody><body name="base"><inertial pos="0 0 0" mass="1"/>
        <body name="head" pos="0 0 0.1"><joint name="pan" axis="0 0 1" range="-60 60"/>
        <joint name="tilt" axis="0 1 0" range="-40 40"/><inertial pos="0 0 0.05" mass="0.2"/>
        <geom type="mesh" mesh="head"/></body></body></worldbody></mujoco>"#;
    for (folder, copies) in [("mujoco", true), ("robot", false)] {
        std::fs::create_dir_all(home.at(&format!("{folder}/assets"))).expect("a folder");
        home.write(&format!("{folder}/assets/head.stl"), &cube(60.0));
        home.write(&format!("{folder}/neck.xml"), mjcf.as_bytes());
        let (model, toml) = (home.at(&format!("{folder}/neck.xml")), home.at("robot/new.toml"));
        let new = new_robot(&model, &toml, true, DraftOptions::default(), &trial_dance(), &[])
            .expect("a robot file");
        let said = new.lines.iter().any(|line| line.starts_with("copied: 1 meshes to "));
        assert_eq!(said, copies, "{:?}", new.lines);
        let meshes = meshes_with(&toml, &Overrides::default());
        assert_eq!(meshes.bounds, [[[0.0; 3], [60.0; 3]]], "{:?}", meshes.left_out);
    }
}
