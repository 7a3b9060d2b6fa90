//! Shapes for viewers, as ROS 2's `visualization_msgs/Marker` tells them: the human as lines
//! between its joints, the beat as a ball that appears for a moment.

use super::link_frames::{MOTION_FRAME, WORLD_FRAME};
use servodance_stage::ros2::CdrWriter;
use servodance_types::{BodyJoint, MotionFrame};

const LINE_LIST: u32 = 5;
const SPHERE: u32 = 2;
const LIMB_M: f64 = 0.045;
const BEAT_M: f64 = 0.12;
/// Where the beat's ball is: before the robot, metres.
const BEAT_AT: [f64; 3] = [0.5, 0.0, 0.06];
const BEAT_NS: u32 = 150_000_000;
const HUMAN_COLOUR: [f32; 4] = [1.0, 0.69, 0.4, 1.0];
const BEAT_COLOUR: [f32; 4] = [0.84, 0.25, 0.27, 1.0];

struct Marker<'a> {
    frame: &'a str,
    shape: u32,
    at: [f64; 3],
    size_m: [f64; 3],
    colour: [f32; 4],
    /// How long it is shown; zero until the next one.
    lifetime_ns: u32,
    points: Vec<[f64; 3]>,
}

/// The human: y up becomes z up.
pub fn human(time_s: f64, frame: &MotionFrame) -> Vec<u8> {
    let turned = |joint: BodyJoint| {
        let [left, up, forward] = frame.positions[joint as usize];
        [forward, left, up].map(f64::from)
    };
    let bones = BodyJoint::ALL.into_iter().filter_map(|joint| Some([joint.parent()?, joint]));
    let marker = Marker {
        frame: MOTION_FRAME,
        shape: LINE_LIST,
        at: [0.0; 3],
        size_m: [LIMB_M, 0.0, 0.0],
        colour: HUMAN_COLOUR,
        lifetime_ns: 0,
        points: bones.flatten().map(turned).collect(),
    };
    marker.message(time_s)
}

/// A beat of the music.
pub fn beat(time_s: f64) -> Vec<u8> {
    let marker = Marker {
        frame: WORLD_FRAME,
        shape: SPHERE,
        at: BEAT_AT,
        size_m: [BEAT_M; 3],
        colour: BEAT_COLOUR,
        lifetime_ns: BEAT_NS,
        points: Vec::new(),
    };
    marker.message(time_s)
}

impl Marker<'_> {
    fn message(&self, time_s: f64) -> Vec<u8> {
        let mut cdr = CdrWriter::new();
        // Namespace, id, shape, action: add or change.
        cdr.header(time_s, self.frame).string("servodance").u32(0).u32(self.shape).u32(0);
        for value in self.at.iter().chain(&[0.0, 0.0, 0.0, 1.0]).chain(&self.size_m) {
            cdr.f64(*value);
        }
        for part in self.colour {
            cdr.u32(part.to_bits());
        }
        cdr.u32(0).u32(self.lifetime_ns).u8(0);
        cdr.u32(self.points.len() as u32);
        for value in self.points.iter().flatten() {
            cdr.f64(*value);
        }
        // No colours of points, no texture (its name, header, format, data, coordinates), no
        // text, no mesh (its name, file and data, materials).
        cdr.u32(0).string("").header(0.0, "").string("").u32(0).u32(0);
        cdr.string("").string("").string("").u32(0).u8(0);
        cdr.finish()
    }
}
