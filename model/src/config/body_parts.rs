//! The body parts that have a codebook each, and what their encoders see.

use crate::motion::representation::{CONTACTS_AT, JOINTS_AT, STEPS_AT};

/// Names of the body parts that a codebook can be for.
const PARTS: [&str; 8] =
    ["whole", "lower", "upper", "trunk", "left_leg", "right_leg", "left_arm", "right_arm"];

/// Which of the 137 numbers the encoder of a part sees; the error lists the
/// parts that there are.
pub fn part_channels(part: &str) -> Result<Vec<usize>, String> {
    let known = || format!("part `{part}` is unknown; expected one of: {}", PARTS.join(", "));
    channels(part).ok_or_else(known)
}

/// Which of the 137 numbers the codes of a part are made of without an encoder network: the
/// positions of its own joints, and with the pelvis the root's numbers. No joint is in two of
/// the five parts of a body; the error is that of [`part_channels`].
pub fn position_channels(part: &str) -> Result<Vec<usize>, String> {
    let positions = JOINTS_AT..STEPS_AT;
    let channels = part_channels(part)?;
    let moves_root = channels.contains(&STEPS_AT);
    let is_own =
        |channel: &usize| positions.contains(channel) || moves_root && *channel < JOINTS_AT;
    Ok(channels.into_iter().filter(is_own).collect())
}

/// Which of the 137 numbers the encoder of a part sees; the same table in
/// Python is `part_channels` in `model/reference/config.py`.
fn channels(part: &str) -> Option<Vec<usize>> {
    const LEGS: [usize; 9] = [0, 1, 2, 4, 5, 7, 8, 10, 11];
    let (joints, contacts): (Vec<usize>, Vec<usize>) = match part {
        "whole" => ((0..22).collect(), vec![0, 1, 2, 3]),
        "lower" => (LEGS.to_vec(), vec![0, 1, 2, 3]),
        "upper" => ((0..22).filter(|j| !LEGS.contains(j)).collect(), vec![]),
        "trunk" => (vec![0, 1, 2, 3, 6, 9, 12, 13, 14, 15, 16, 17], vec![]),
        "left_leg" => (vec![4, 7, 10], vec![0, 1]),
        "right_leg" => (vec![5, 8, 11], vec![2, 3]),
        "left_arm" => (vec![18, 20], vec![]),
        "right_arm" => (vec![19, 21], vec![]),
        _ => return None,
    };
    let mut channels = Vec::new();
    // Whatever touches the floor also knows how the root moves.
    if !contacts.is_empty() || joints.contains(&0) {
        channels.extend(0..JOINTS_AT);
    }
    let triple = |at: usize| at..at + 3;
    for joint in joints.iter().filter(|&&j| j > 0) {
        channels.extend(triple(JOINTS_AT + 3 * (joint - 1)));
    }
    for joint in &joints {
        channels.extend(triple(STEPS_AT + 3 * joint));
    }
    channels.extend(contacts.iter().map(|c| CONTACTS_AT + c));
    Some(channels)
}
