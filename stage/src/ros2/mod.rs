//! ROS 2 topics as its Zenoh middleware (`rmw_zenoh_cpp`) has them: messages in
//! CDR, the keys they lie under, what is attached, and the signs of life by
//! which `ros2 topic list` finds them.
//!
//! Facts from the middleware's design document (github.com/ros2/rmw_zenoh,
//! `docs/design.md`) and REP 2016 for the hashes of types; the bytes are checked
//! by independent readers in `stage/reference/`.

mod cdr;
mod message;
mod topic;

pub use cdr::{CdrReader, CdrWriter};
pub use message::{joint_state, pose_array};
pub use topic::{Attachment, Node, Topic, TopicType, ros_word};
