//! The two messages of a robot that others want: its joints and a skeleton.

use super::cdr::CdrWriter;

/// `sensor_msgs/msg/JointState` without its numbers: time in seconds, frame and
/// joint names. Three sequences of floats follow: positions, velocities, efforts.
pub fn joint_state<'a>(
    time_s: f64,
    frame: &str,
    names: impl ExactSizeIterator<Item = &'a str>,
) -> CdrWriter {
    let mut cdr = CdrWriter::new();
    cdr.header(time_s, frame);
    cdr.u32(names.len() as u32);
    for name in names {
        cdr.string(name);
    }
    cdr
}

/// `geometry_msgs/msg/PoseArray` of points that are not turned: metres, in the
/// axes of the frame.
pub fn pose_array(
    time_s: f64,
    frame: &str,
    points: impl ExactSizeIterator<Item = [f64; 3]>,
) -> Vec<u8> {
    let mut cdr = CdrWriter::new();
    cdr.header(time_s, frame);
    cdr.u32(points.len() as u32);
    for point in points {
        for value in point {
            cdr.f64(value);
        }
        for value in [0.0, 0.0, 0.0, 1.0] {
            cdr.f64(value);
        }
    }
    cdr.finish()
}
