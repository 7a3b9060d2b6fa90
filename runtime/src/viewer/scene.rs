//! What does not change while viewers watch: the robot's shapes, joints, limits and
//! the requests it takes. Viewers get the scene once, as JSON.

use crate::control::idle::IdleStyle;
use crate::robot::{Meshes, Robot};
use crate::telemetry::pose_array::pose_array;
use clap::ValueEnum;
use serde_json::{Value, json};
use servodance_retarget::{RobotModel, Shape};
use servodance_types::{BodyJoint, JointLimits};

/// Thickness of a link without shapes, metres.
const STICK_M: f64 = 0.008;

#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct Scene {
    pub robot: String,
    pub model: RobotModel,
    pub meshes: Meshes,
    pub joints: Vec<(String, JointLimits)>,
    pub styles: Vec<String>,
    /// Whether a loudspeaker beside the robot plays the music: pages are silent then, at first.
    pub speaker: bool,
    /// Control cycles a second.
    pub control_hz: f64,
    /// Whether somebody must say `start`, and may say it again.
    pub waits: bool,
    /// Whether songs can be added, to be danced next.
    pub takes_songs: bool,
    /// First and last moment of a recording, seconds of music.
    pub recording_s: Option<[f64; 2]>,
}

impl Scene {
    /// The scene of a robot that is driven, with its meshes if a page shows them.
    pub fn of_robot(robot: &Robot, styles: Vec<String>, has_page: bool) -> anyhow::Result<Self> {
        let model = robot.retargeter()?.model().clone();
        let meshes = match has_page {
            true => Meshes::load(robot, &model),
            false => Meshes::default(),
        };
        Ok(Self {
            robot: robot.name.clone(),
            model,
            meshes,
            joints: robot.joint_limits(),
            styles,
            control_hz: robot.control_hz,
            waits: false,
            takes_songs: true,
            speaker: false,
            recording_s: None,
        })
    }

    /// The scene for viewers: see docs/show.md.
    pub fn json(&self) -> Value {
        let joints = self.joints.iter().map(|(name, limits)| {
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
        let idle = IdleStyle::value_variants().iter();
        json!({
            "robot": self.robot,
            "version": env!("CARGO_PKG_VERSION"),
            "control_hz": self.control_hz,
            "waits": self.waits,
            "takes_songs": self.takes_songs,
            "speaker": self.speaker,
            "recording_s": self.recording_s,
            "joints": joints.collect::<Vec<_>>(),
            "links": self.model.link_names(),
            "shapes": self.shapes(),
            "bones": bones.collect::<Vec<_>>(),
            "human_joints": BodyJoint::ALL.map(BodyJoint::name),
            "styles": self.styles,
            "idle": idle.collect::<Vec<_>>(),
        })
    }

    /// Where each link is in the world: x, y, z, then the quaternion x, y, z, w.
    #[cfg(any(feature = "view", feature = "stage"))]
    pub(crate) fn link_poses(
        &self,
        seen: &super::snapshot::Snapshot,
    ) -> impl Iterator<Item = [f64; 7]> {
        let positions: Vec<f64> = seen.joints.iter().map(|j| j.position_rad).collect();
        let world_from_root = crate::telemetry::pose_array::pose_from_array(seen.now.root);
        let poses = self.model.link_poses(&positions).into_iter();
        poses.map(move |root_from_link| pose_array(&(world_from_root * root_from_link)))
    }

    /// Shapes and meshes fixed to links; a stick to every link that has neither.
    pub(crate) fn shapes(&self) -> Vec<Value> {
        let visuals = self.model.visuals();
        let shown = visuals.iter().map(|visual| {
            let mut shape = match visual.shape {
                Shape::Box { size_m } => json!({ "box": size_m }),
                Shape::Cylinder { radius_m, length_m } => {
                    json!({ "cylinder": [radius_m, length_m] })
                }
                Shape::Sphere { radius_m } => json!({ "sphere": radius_m }),
            };
            shape["link"] = json!(visual.link);
            shape["pose"] = json!(pose_array(&visual.pose_in_link));
            shape["rgba"] = json!(visual.rgba);
            shape
        });
        let meshes = self.meshes.fixed.iter().map(|fixed| {
            let visual = &fixed.visual;
            json!({
                "mesh": fixed.part,
                "bounds": self.meshes.bounds[fixed.part],
                "scale": visual.scale,
                "link": visual.link,
                "pose": pose_array(&visual.pose_in_link),
                "rgba": visual.rgba,
            })
        });
        let with_mesh = |link| self.meshes.fixed.iter().any(|f| f.visual.link == link);
        let with_shape = |link| visuals.iter().any(|visual| visual.link == link);
        let bare = |link: &usize| !with_shape(*link) && !with_mesh(*link);
        let poses = self.model.link_poses(&[]);
        let sticks = self.model.segments().iter().filter(|(_, to)| bare(to));
        let sticks = sticks.map(|(from, to)| {
            let end = poses[*from].inverse() * poses[*to];
            let end: [f64; 3] = end.translation.vector.into();
            json!({ "link": from, "stick": end, "radius": STICK_M })
        });
        shown.chain(meshes).chain(sticks).collect()
    }
}
