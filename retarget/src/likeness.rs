//! How alike robot and dancer look: angles between their limbs, degrees.
//!
//! Compared in the trunk's heading, since a robot on a stand cannot turn.

use k::nalgebra::{Rotation3, Vector3};
use servodance_types::BodyJoint::{self, *};
use servodance_types::MotionFrame;

use crate::body::BodyMap;
use crate::{RetargetConfig, RetargetError, RobotModel};

/// Compares one robot with dancers.
#[derive(Clone, Debug)]
pub struct Likeness {
    model: RobotModel,
    /// Link indices of both shoulders, for the heading.
    across: Option<[usize; 2]>,
    up: Vector3<f64>,
    forward: Vector3<f64>,
    segments: Vec<([usize; 2], [BodyJoint; 2])>,
}

impl Likeness {
    /// For a robot whose driven joints are `joints`.
    ///
    /// # Errors
    /// As [`crate::Retargeter::new`].
    pub fn new(
        urdf_xml: &str,
        config: &RetargetConfig,
        joints: &[&str],
    ) -> Result<Self, RetargetError> {
        let model = RobotModel::configured(urdf_xml, joints, config)?;
        let map = BodyMap::new(&model, config)?;
        let upright = crate::retargeter::upright_rotation(config)?;
        let human = [
            ([LeftShoulder, LeftElbow, LeftWrist], 0),
            ([RightShoulder, RightElbow, RightWrist], 1),
        ];
        let mut segments = Vec::new();
        for (points, side) in human {
            let arm = map.arms[side];
            let links = [arm.shoulder, arm.elbow, arm.hand];
            for half in 0..2 {
                if let (Some(from), Some(to)) = (links[half], links[half + 1]) {
                    segments.push(([from, to], [points[half], points[half + 1]]));
                }
            }
        }
        Ok(Self {
            model,
            across: map.arms[0]
                .shoulder
                .zip(map.arms[1].shoulder)
                .map(<[usize; 2]>::from),
            up: upright.inverse() * Vector3::z(),
            forward: upright.inverse() * Vector3::x(),
            segments,
        })
    }

    /// Appends the angle of every arm segment that robot and dancer both have.
    pub fn compare(&self, positions_rad: &[f64], frame: &MotionFrame, out_deg: &mut Vec<f64>) {
        let points = self.model.link_points(positions_rad);
        let left = self.up.cross(&self.forward);
        let robot = |link: usize| {
            let p = Vector3::from(points[link]);
            Vector3::new(p.dot(&self.forward), p.dot(&left), p.dot(&self.up))
        };
        let human = |joint: BodyJoint| {
            let [x, y, z] = frame.positions[joint as usize].map(f64::from);
            Vector3::new(z, x, y)
        };
        let robot_turn = self
            .across
            .map_or_else(Rotation3::identity, |[left, right]| {
                unturn(robot(left) - robot(right))
            });
        let human_turn = unturn(human(LeftShoulder) - human(RightShoulder));
        for ([from, to], [start, end]) in &self.segments {
            let shown = robot_turn * (robot(*to) - robot(*from));
            let wanted = human_turn * (human(*end) - human(*start));
            if shown.norm() > 1e-6 && wanted.norm() > 1e-6 {
                out_deg.push(shown.angle(&wanted).to_degrees());
            }
        }
    }
}

/// Takes the heading out of a body whose left side is this way.
fn unturn(left: Vector3<f64>) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), -(-left.x).atan2(left.y))
}
