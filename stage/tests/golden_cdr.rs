//! The bytes of the ROS 2 messages are those that independent readers and
//! writers have: `stage/reference/cdr.py` made and checked the files.

use servodance_stage::ros2::{TopicType, joint_state, pose_array};

const JOINT_STATE: &[u8] = include_bytes!("../reference/joint_state.cdr");
const POSE_ARRAY: &[u8] = include_bytes!("../reference/pose_array.cdr");
const HASHES: &str = include_str!("../reference/hashes.txt");

#[test]
fn joint_states_are_those_of_an_independent_writer() {
    let names = ["head_pan", "l_sho_pitch", "r"];
    let message = joint_state(12.25, "base_link", names.into_iter())
        .f64s([0.5, -1.25, 3.0].into_iter())
        .f64s([0.0, 2.0, -0.125].into_iter())
        .f64s([0.75, 0.0, -0.5].into_iter())
        .finish();
    assert_eq!(message, JOINT_STATE);
}

#[test]
fn positions_alone_are_a_joint_state_with_empty_sequences() {
    let names = ["head_pan"];
    let message =
        joint_state(-0.5, "", names.into_iter()).f64s([1.0].into_iter()).u32(0).u32(0).finish();
    let golden = include_bytes!("../reference/joint_command.cdr");
    assert_eq!(message, golden);
}

#[test]
fn a_skeleton_is_that_of_an_independent_writer() {
    let points = (0..22).map(f64::from).map(|i| [i, 0.5 * i, -i]);
    assert_eq!(pose_array(3.5, "stage", points), POSE_ARRAY);
}

#[test]
fn the_hashes_of_the_types_are_those_of_the_definitions() {
    for message in [TopicType::JointState, TopicType::PoseArray] {
        let line = format!("{} {}", message.wire_name(), message.hash());
        assert!(HASHES.lines().any(|l| l == line), "{line}");
    }
}
