//! The 22 joints of the human body: SMPL without hands.

/// Number of joints in a frame of human motion.
pub const JOINT_COUNT: usize = 22;

macro_rules! body_joints {
    ($($variant:ident $name:literal $parent:expr;)*) => {
        /// A joint of the 22-joint human skeleton (SMPL order without hands, parents
        /// before children); the index of the arrays `[T; JOINT_COUNT]`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u8)]
        #[allow(missing_docs)] // the variant names are the documentation
        pub enum BodyJoint { $($variant),* }

        crate::named!(BodyJoint { $($variant $name),* });

        impl BodyJoint {
            /// The parent joint in the skeleton; `None` for the pelvis.
            pub const fn parent(self) -> Option<BodyJoint> {
                use BodyJoint::*;
                match self { $($variant => $parent),* }
            }
        }
    };
}

body_joints! {
    Pelvis "pelvis" None;
    LeftHip "left_hip" Some(Pelvis);
    RightHip "right_hip" Some(Pelvis);
    Spine1 "spine1" Some(Pelvis);
    LeftKnee "left_knee" Some(LeftHip);
    RightKnee "right_knee" Some(RightHip);
    Spine2 "spine2" Some(Spine1);
    LeftAnkle "left_ankle" Some(LeftKnee);
    RightAnkle "right_ankle" Some(RightKnee);
    Spine3 "spine3" Some(Spine2);
    LeftFoot "left_foot" Some(LeftAnkle);
    RightFoot "right_foot" Some(RightAnkle);
    Neck "neck" Some(Spine3);
    LeftCollar "left_collar" Some(Spine3);
    RightCollar "right_collar" Some(Spine3);
    Head "head" Some(Neck);
    LeftShoulder "left_shoulder" Some(LeftCollar);
    RightShoulder "right_shoulder" Some(RightCollar);
    LeftElbow "left_elbow" Some(LeftShoulder);
    RightElbow "right_elbow" Some(RightShoulder);
    LeftWrist "left_wrist" Some(LeftElbow);
    RightWrist "right_wrist" Some(RightElbow);
}

impl BodyJoint {
    /// The joint on the other side of the body; a middle joint is its own mirror.
    pub fn mirrored(self) -> BodyJoint {
        let (side, part) = self.name().split_once('_').unwrap_or_default();
        let other_side = if side == "left" { "right" } else { "left" };
        Self::from_name(&format!("{other_side}_{part}")).unwrap_or(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_come_before_children() {
        for joint in BodyJoint::ALL {
            if let Some(parent) = joint.parent() {
                assert!((parent as usize) < joint as usize, "{}", joint.name());
            }
        }
    }

    #[test]
    fn mirror_twice_is_identity() {
        for joint in BodyJoint::ALL {
            assert_eq!(joint.mirrored().mirrored(), joint);
        }
        assert_eq!(BodyJoint::LeftWrist.mirrored(), BodyJoint::RightWrist);
        assert_eq!(BodyJoint::Neck.mirrored(), BodyJoint::Neck);
    }
}
