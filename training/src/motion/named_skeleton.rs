//! A skeleton whose joints have names of their own, as the 22 joints.

use std::collections::BTreeMap;

use servodance_types::{BodyJoint, JOINT_COUNT};

use servodance_model::motion::vec3::{Vec3, add, lerp, norm, scale, sub};
use servodance_model::motion::{Pose, skeleton};

/// Which joint of the file a body joint is, where the guess is to be corrected.
pub type GivenNames = BTreeMap<BodyJoint, String>;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct FileJoint {
    pub name: String,
    pub parent: Option<usize>,
    pub offset: Vec3,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum JointSource {
    Joint(usize),
    /// Along the way between two joints of the file.
    Between(Vec<usize>, f64),
}

/// Which joint of the file each body joint is.
#[derive(Clone, Debug, PartialEq)]
pub struct JointMapping {
    pub(super) sources: Vec<JointSource>,
    /// Of the file's joints.
    pub(super) names: Vec<String>,
}

impl JointMapping {
    /// `body joint: joint of the file`, a line each.
    pub fn lines(&self) -> Vec<String> {
        let named = BodyJoint::ALL.iter().zip(&self.sources);
        named
            .map(|(joint, source)| {
                let from = match source {
                    JointSource::Joint(at) => self.names[*at].clone(),
                    JointSource::Between(way, share) => {
                        let end = |at: Option<&usize>| at.map_or("", |at| &self.names[*at]);
                        let (first, last) = (end(way.first()), end(way.last()));
                        format!("{:.0} % of the way from {first} to {last}", share * 100.0)
                    }
                };
                format!("{}: {from}", joint.name())
            })
            .collect()
    }

    pub(super) fn pose(&self, points: &[Vec3]) -> [Vec3; JOINT_COUNT] {
        let at = |source: &JointSource| match source {
            JointSource::Joint(at) => points[*at],
            JointSource::Between(way, share) => along(way, *share, points),
        };
        std::array::from_fn(|joint| at(&self.sources[joint]))
    }
}

/// The point at a share of the length of a way through points.
fn along(way: &[usize], share: f64, points: &[Vec3]) -> Vec3 {
    let step = |pair: &[usize]| norm(sub(points[pair[1]], points[pair[0]]));
    let length: f64 = way.windows(2).map(step).sum();
    let mut left = share * length;
    for pair in way.windows(2) {
        let part = step(pair);
        if left <= part && part > 0.0 {
            return lerp(points[pair[0]], points[pair[1]], left / part);
        }
        left -= part;
    }
    way.last().map_or([0.0; 3], |last| points[*last])
}

pub(super) fn lies_along_z(poses: &[Pose]) -> bool {
    let mut sum = [0.0; 3];
    for pose in poses {
        let at = |joint: BodyJoint| pose[joint as usize].map(f64::from);
        let feet = scale(add(at(BodyJoint::LeftAnkle), at(BodyJoint::RightAnkle)), 0.5);
        sum = add(sum, sub(at(BodyJoint::Head), feet));
    }
    sum[2].abs() > 2.0 * sum[1].abs() && sum[2] > 0.0
}

/// Bodies that stand along z, turned to stand along y.
pub(super) fn stand_up(poses: &mut [Pose]) {
    for point in poses.iter_mut().flatten() {
        let [x, y, z] = *point;
        *point = [x, z, -y];
    }
}

/// Y up and the usual leg length. Fails with the frame whose position is not finite.
pub(super) fn settle(poses: &mut [Pose]) -> Result<(), String> {
    if lies_along_z(poses) {
        stand_up(poses);
    }
    let size = skeleton::leg_scale(poses) as f32;
    for value in poses.iter_mut().flatten().flatten() {
        *value *= size;
    }
    let finite = |pose: &Pose| pose.iter().flatten().all(|v| v.is_finite());
    match poses.iter().position(|pose| !finite(pose)) {
        Some(frame) => Err(format!("frame {frame}: a position is not finite")),
        None => Ok(()),
    }
}
