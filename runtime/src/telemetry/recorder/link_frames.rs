//! Where the links are, as ROS 2's `/tf` and `/tf_static` tell it: each link in the frame of
//! its parent, the root in the world. Frames have the names of the links.

use servodance_retarget::RobotModel;
use servodance_retarget::nalgebra::Isometry3;
use servodance_stage::ros2::CdrWriter;

/// The frame that all others hang on, and that of the human's motion.
pub const WORLD_FRAME: &str = "world";
pub const MOTION_FRAME: &str = "stage";
/// The human stands at the robot's left, so that neither hides the other: metres.
const BESIDE_M: f64 = 0.9;
/// Joints are turned by this to see which links move, radians.
const NUDGE_RAD: f64 = 0.1;

/// The frames of a robot's links.
#[derive(Debug)]
pub struct LinkFrames {
    root: String,
    moving: Vec<LinkFrame>,
    fixed: Vec<LinkFrame>,
}

#[derive(Debug)]
struct LinkFrame {
    parent: usize,
    child: usize,
    names: [String; 2],
}

impl LinkFrames {
    /// The frames of this robot, which has so many joints.
    pub fn new(model: &RobotModel, joints: usize) -> Self {
        let names = model.link_names();
        let is_child = |link: usize| model.segments().iter().any(|(_, child)| *child == link);
        let root = (0..names.len()).find(|link| !is_child(*link)).unwrap_or_default();
        let frames = model.segments().iter().map(|&(parent, child)| LinkFrame {
            parent,
            child,
            names: [names[parent].clone(), names[child].clone()],
        });
        let [still, nudged] =
            [0.0, NUDGE_RAD].map(|angle_rad| model.link_poses(&vec![angle_rad; joints]));
        let (moving, fixed) = frames.partition(|frame| {
            let [before, after] = [&still, &nudged].map(|poses| frame.parent_from_child(poses));
            (before.inverse() * after).rotation.angle() > 1e-9
                || (before.translation.vector - after.translation.vector).norm() > 1e-9
        });
        Self { root: names.get(root).cloned().unwrap_or_default(), moving, fixed }
    }

    /// `/tf`: the root in the world, and each link that moves; `poses` are those of the links
    /// in the root's frame.
    pub fn moving(
        &self,
        time_s: f64,
        world_from_root: &Isometry3<f64>,
        poses: &[Isometry3<f64>],
    ) -> Vec<u8> {
        // A robot whose root has this name already stands in a frame of its own.
        let floats = self.root != WORLD_FRAME;
        let mut cdr = CdrWriter::new();
        cdr.u32(self.moving.len() as u32 + u32::from(floats));
        if floats {
            transform(&mut cdr, time_s, [WORLD_FRAME, &self.root], world_from_root);
        }
        for frame in &self.moving {
            transform(&mut cdr, time_s, frame.names(), &frame.parent_from_child(poses));
        }
        cdr.finish()
    }

    /// `/tf_static`: links that are fixed to their parents, and the human's place.
    pub fn fixed(&self, time_s: f64, poses: &[Isometry3<f64>]) -> Vec<u8> {
        let mut cdr = CdrWriter::new();
        cdr.u32(self.fixed.len() as u32 + 1);
        let beside = Isometry3::translation(0.0, BESIDE_M, 0.0);
        transform(&mut cdr, time_s, [WORLD_FRAME, MOTION_FRAME], &beside);
        for frame in &self.fixed {
            transform(&mut cdr, time_s, frame.names(), &frame.parent_from_child(poses));
        }
        cdr.finish()
    }
}

impl LinkFrame {
    fn names(&self) -> [&str; 2] {
        [&self.names[0], &self.names[1]]
    }

    fn parent_from_child(&self, poses: &[Isometry3<f64>]) -> Isometry3<f64> {
        poses[self.parent].inverse() * poses[self.child]
    }
}

fn transform(cdr: &mut CdrWriter, time_s: f64, names: [&str; 2], pose: &Isometry3<f64>) {
    let [parent, child] = names;
    cdr.header(time_s, parent).string(child);
    let (at, turn) = (&pose.translation.vector, &pose.rotation.coords);
    for value in [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w] {
        cdr.f64(value);
    }
}
