//! What does not change during a dance, for the viewer's page: shapes, joints and bones,
//! as the program hands them out (`runtime/src/viewer/scene.rs`); a test holds the two
//! together.

use crate::robot_track::RobotTrack;
use crate::robots::WebRobot;
use serde_json::{Value, json};
use servodance_retarget::nalgebra::Isometry3;
use servodance_retarget::{RobotModel, Shape};
use servodance_types::BodyJoint;

/// Thickness of a link without shapes, metres.
const STICK_M: f64 = 0.008;

/// The scene as JSON, with the sizes of a row of the track.
pub fn scene(robot: &WebRobot, track: &RobotTrack) -> Value {
    let joints = robot.joints.iter().map(|(name, limits)| {
        json!({
            "name": name,
            "lower_rad": limits.lower_rad,
            "upper_rad": limits.upper_rad,
            "velocity_rad_s": limits.velocity_rad_s,
        })
    });
    let bones = BodyJoint::ALL.into_iter().filter_map(|joint| {
        let parent = joint.parent()?;
        Some([parent as usize, joint as usize])
    });
    json!({
        "robot": robot.name,
        "joints": joints.collect::<Vec<_>>(),
        "links": track.model().link_names(),
        "shapes": shapes(track.model()),
        "bones": bones.collect::<Vec<_>>(),
        "row": track.row(),
        "rate_hz": track.rate_hz(),
        "lookahead_s": track.lookahead_s(),
    })
}

/// Shapes fixed to links; a stick to every link that has none. The built-in robots have
/// no meshes.
fn shapes(model: &RobotModel) -> Vec<Value> {
    let visuals = model.visuals();
    let shown = visuals.iter().map(|visual| {
        let mut shape = match visual.shape {
            Shape::Box { size_m } => json!({ "box": size_m }),
            Shape::Cylinder { radius_m, length_m } => json!({ "cylinder": [radius_m, length_m] }),
            Shape::Sphere { radius_m } => json!({ "sphere": radius_m }),
        };
        shape["link"] = json!(visual.link);
        shape["pose"] = json!(pose_array(&visual.pose_in_link));
        shape["rgba"] = json!(visual.rgba);
        shape
    });
    let poses = model.link_poses(&[]);
    let bare = |link: &usize| !visuals.iter().any(|visual| visual.link == *link);
    let sticks = model.segments().iter().filter(|(_, to)| bare(to)).map(|(from, to)| {
        let end: [f64; 3] = (poses[*from].inverse() * poses[*to]).translation.vector.into();
        json!({ "link": from, "stick": end, "radius": STICK_M })
    });
    shown.chain(sticks).collect()
}

fn pose_array(pose: &Isometry3<f64>) -> [f64; 7] {
    let ([x, y, z], turn) = (pose.translation.vector.into(), pose.rotation.coords);
    [x, y, z, turn.x, turn.y, turn.z, turn.w]
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_runtime::robot::Robot;
    use servodance_runtime::viewer::Scene;

    #[test]
    fn scenes_are_those_of_the_program() {
        for name in servodance_robots::names() {
            let robot = WebRobot::built_in(name).unwrap();
            let here = scene(&robot, &RobotTrack::new(&robot).unwrap());
            let loaded = Robot::load(name).unwrap();
            let there = Scene {
                robot: loaded.name.clone(),
                model: loaded.retargeter().unwrap().model().clone(),
                meshes: Default::default(),
                joints: loaded.joint_limits(),
                styles: Vec::new(),
                control_hz: loaded.control_hz,
                waits: false,
                takes_songs: true,
                speaker: false,
                recording_s: None,
            };
            let there = there.json();
            for key in ["robot", "joints", "links", "shapes", "bones"] {
                assert_eq!(here[key], there[key], "{name}: {key}");
            }
        }
    }
}
