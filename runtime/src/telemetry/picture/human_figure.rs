//! The human dancer as a figure.

use super::stick_figure::{Limb, Side, StickFigure};
use servodance_types::{BodyJoint, JOINT_COUNT, Point3};

impl From<BodyJoint> for Side {
    fn from(joint: BodyJoint) -> Self {
        match joint.name().split_once('_') {
            Some(("left", _)) => Self::Left,
            Some(("right", _)) => Self::Right,
            _ => Self::Middle,
        }
    }
}

impl StickFigure {
    /// The human as bones between joints (metres, y up); y up becomes z up, and
    /// the body is turned to face x, as a robot does.
    pub fn dancer(positions: &[Point3; JOINT_COUNT]) -> Self {
        let at = |joint: BodyJoint| positions[joint as usize].map(f64::from);
        let (left, right) = (at(BodyJoint::LeftHip), at(BodyJoint::RightHip));
        let heading_rad = (right[2] - left[2]).atan2(left[0] - right[0]);
        let (sin, cos) = heading_rad.sin_cos();
        let turned = |[x, up, z]: [f64; 3]| [z * cos + x * sin, x * cos - z * sin, up];
        let limb = |joint: BodyJoint| {
            Some(Limb {
                from: turned(at(joint.parent()?)),
                to: turned(at(joint)),
                radius_m: if joint == BodyJoint::Head { 0.085 } else { 0.045 },
                side: joint.into(),
            })
        };
        let pelvis = turned(at(BodyJoint::Pelvis));
        let lowest = positions.iter().map(|p| f64::from(p[1]));
        Self {
            limbs: BodyJoint::ALL.into_iter().filter_map(limb).collect(),
            dots: Vec::new(),
            height_m: 1.65,
            floor_m: lowest.fold(f64::INFINITY, f64::min).min(0.0),
            center: [pelvis[0], pelvis[1]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dancer_who_faces_away_is_turned_to_the_viewer() {
        let mut positions = [[0.0, 1.0, 0.0]; JOINT_COUNT];
        positions[BodyJoint::LeftHip as usize] = [-0.1, 1.0, 0.0]; // facing -z
        positions[BodyJoint::RightHip as usize] = [0.1, 1.0, 0.0];
        positions[BodyJoint::LeftFoot as usize] = [-0.1, 0.0, -0.2]; // toes ahead
        let figure = StickFigure::dancer(&positions);
        let foot = figure.limbs.iter().find(|limb| limb.to[2] == 0.0).expect("the foot");
        assert!((foot.to[0] - 0.2).abs() < 1e-6, "ahead is +x: {foot:?}");
        assert!((foot.to[1] - 0.1).abs() < 1e-6, "left is +y: {foot:?}");
    }
}
