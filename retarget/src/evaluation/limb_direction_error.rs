//! How alike robot and dancer look: angles between their limbs, degrees.
//!
//! Arms are compared in the heading of the chest, legs in that of the pelvis:
//! a robot that stands, or hangs on a stand, cannot turn with the dancer.

use crate::config::{RetargetConfig, RetargetError};
use crate::kinematics::{BodyMap, RobotModel};
use k::nalgebra::{Isometry3, Rotation3, Vector3};
use servodance_types::BodyJoint::{self, *};
use servodance_types::MotionFrame;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // the names say it
pub enum LimbSegment {
    UpperArm,
    Forearm,
    Thigh,
    Shank,
}

impl LimbSegment {
    /// Whether it is of an arm.
    pub fn is_arm(self) -> bool {
        matches!(self, LimbSegment::UpperArm | LimbSegment::Forearm)
    }
}

/// Compares one robot with dancers.
#[derive(Clone, Debug)]
pub struct LimbDirectionError {
    model: RobotModel,
    arms: LimbPair,
    legs: LimbPair,
}

#[derive(Clone, Debug)]
struct LimbPair {
    /// Left and right, at the trunk: robot and dancer, for the heading.
    across: Option<[usize; 2]>,
    dancer_across: [BodyJoint; 2],
    bones: Vec<SegmentMatch>,
}

#[derive(Clone, Copy, Debug)]
struct SegmentMatch {
    segment: LimbSegment,
    links: [usize; 2],
    joints: [BodyJoint; 2],
}

impl LimbPair {
    /// Of the links and joints at the top, middle and end of both limbs.
    fn new(
        segments: [LimbSegment; 2],
        links: [[Option<usize>; 3]; 2],
        joints: [[BodyJoint; 3]; 2],
    ) -> Self {
        let mut bones = Vec::new();
        for (links, joints) in links.iter().zip(&joints) {
            for (half, segment) in segments.into_iter().enumerate() {
                if let (Some(from), Some(to)) = (links[half], links[half + 1]) {
                    bones.push(SegmentMatch {
                        segment,
                        links: [from, to],
                        joints: [joints[half], joints[half + 1]],
                    });
                }
            }
        }
        Self {
            across: links[0][0].zip(links[1][0]).map(<[usize; 2]>::from),
            dancer_across: [joints[0][0], joints[1][0]],
            bones,
        }
    }
}

impl LimbDirectionError {
    /// For a robot whose driven joints are `joints`.
    /// Fails where [`Retargeter::new`](crate::Retargeter::new) does.
    pub fn new(
        urdf_xml: &str,
        config: &RetargetConfig,
        joints: &[&str],
    ) -> Result<Self, RetargetError> {
        let model = RobotModel::configured(urdf_xml, joints, config)?;
        let map = match config.kind.is_human_like() {
            true => BodyMap::new(&model, config)?,
            false => BodyMap::default(),
        };
        Ok(Self {
            model,
            arms: LimbPair::new(
                [LimbSegment::UpperArm, LimbSegment::Forearm],
                map.arms.map(|arm| [arm.shoulder, arm.elbow, arm.hand]),
                [[LeftShoulder, LeftElbow, LeftWrist], [RightShoulder, RightElbow, RightWrist]],
            ),
            legs: LimbPair::new(
                [LimbSegment::Thigh, LimbSegment::Shank],
                map.legs.map(|leg| [leg.hip, leg.knee, leg.ankle]),
                [[LeftHip, LeftKnee, LeftAnkle], [RightHip, RightKnee, RightAnkle]],
            ),
        })
    }

    /// Gives the angle in degrees of every
    /// segment that robot and dancer both
    /// have, the robot standing as
    /// [`Retargeter::world_from_root`](crate::retargeter::Retargeter::world_from_root)
    /// says.
    pub fn compare(
        &self,
        world_from_root: &Isometry3<f64>,
        positions_rad: &[f64],
        frame: &MotionFrame,
        mut see: impl FnMut(LimbSegment, f64),
    ) {
        self.directions(world_from_root, positions_rad, frame, |segment, shown, wanted| {
            see(segment, shown.angle(&wanted).to_degrees());
        });
    }

    /// The same segments as they point: the robot's and the dancer's, metres.
    pub fn directions(
        &self,
        world_from_root: &Isometry3<f64>,
        positions_rad: &[f64],
        frame: &MotionFrame,
        mut see: impl FnMut(LimbSegment, Vector3<f64>, Vector3<f64>),
    ) {
        let poses = self.model.link_poses(positions_rad);
        let robot = |link: usize| (world_from_root * poses[link]).translation.vector;
        let dancer = |joint: BodyJoint| {
            let [x, y, z] = frame.positions[joint as usize].map(f64::from);
            Vector3::new(z, x, y)
        };
        for pair in [&self.arms, &self.legs] {
            let robot_turn = pair.across.map_or_else(Rotation3::identity, |[left, right]| {
                unturn(robot(left) - robot(right))
            });
            let [left, right] = pair.dancer_across;
            let dancer_turn = unturn(dancer(left) - dancer(right));
            for bone in &pair.bones {
                let ([from, to], [start, end]) = (bone.links, bone.joints);
                let shown = robot_turn * (robot(to) - robot(from));
                let wanted = dancer_turn * (dancer(end) - dancer(start));
                if shown.norm() > 1e-6 && wanted.norm() > 1e-6 {
                    see(bone.segment, shown, wanted);
                }
            }
        }
    }
}

/// Takes the heading out of a body whose left side is this way.
fn unturn(left: Vector3<f64>) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), -(-left.x).atan2(left.y))
}
