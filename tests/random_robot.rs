//! Descriptions that nobody designed: random trees, axes, limits and names,
//! some with the defects of real files.

use rand::Rng;
use rand::seq::IndexedRandom;
use std::fmt::Write;

const NAMES: [&str; 18] = [
    "left_shoulder_pitch",
    "right_shoulder_pitch",
    "left_shoulder_roll",
    "right_shoulder_roll",
    "left_elbow",
    "right_elbow",
    "l_wrist",
    "r_wrist",
    "head_pan",
    "head_tilt",
    "waist_yaw",
    "LHipPitch",
    "RHipPitch",
    "left_knee",
    "right_knee",
    "left_ankle",
    "wheel_left",
    "finger",
];

/// A URDF with up to `most` moving joints. With `clean` it has none of the
/// defects that are refused.
pub fn urdf(rng: &mut impl Rng, most: usize, clean: bool) -> String {
    let joints = rng.random_range(1..=most);
    let mut text = String::from("<robot name=\"random\">");
    for link in 0..=joints {
        let _ = write!(text, "<link name=\"link_{link}\">");
        if rng.random_bool(0.7) {
            let mass = rng.random_range(0.01..2.0);
            let _ = write!(
                text,
                "<inertial><origin xyz=\"{}\"/><mass value=\"{mass}\"/><inertia ixx=\"0.1\" \
                 ixy=\"0\" ixz=\"0\" iyy=\"0.1\" iyz=\"0\" izz=\"0.1\"/></inertial>",
                vector(rng, 0.1)
            );
        }
        if rng.random_bool(0.5) {
            let radius = rng.random_range(0.0..0.08);
            let _ = write!(
                text,
                "<visual><origin xyz=\"{}\" rpy=\"{}\"/><geometry><cylinder radius=\"{radius}\" \
                 length=\"0.1\"/></geometry></visual>",
                vector(rng, 0.1),
                vector(rng, 3.0)
            );
        }
        text.push_str("</link>");
    }
    for joint in 1..=joints {
        // Mostly chains, as robots are.
        let parent = match rng.random_bool(0.7) {
            true => joint - 1,
            false => rng.random_range(0..joint),
        };
        write_joint(rng, &mut text, joint, parent, clean);
    }
    text.push_str("</robot>");
    text
}

fn write_joint(rng: &mut impl Rng, text: &mut String, joint: usize, parent: usize, clean: bool) {
    let name = match rng.random_bool(0.6) {
        true => format!("{}_{joint}", NAMES.choose(rng).unwrap_or(&"joint")),
        false => format!("joint_{joint}"),
    };
    let kinds = ["revolute", "revolute", "revolute", "continuous", "prismatic", "fixed"];
    // The first one moves, or nothing would.
    let kind = if joint == 1 { "revolute" } else { kinds.choose(rng).unwrap_or(&"fixed") };
    let low: f64 = rng.random_range(-4.0..0.5);
    let high = low + rng.random_range(0.05..5.0);
    let (low, high) = match rng.random_range(0..20) {
        0 if !clean => (high, low),
        1 => (0.0, 0.0),
        _ => (low, high),
    };
    let axis = match rng.random_range(0..30) {
        0 if !clean => "0 0 0".to_owned(),
        1..=20 => ["1 0 0", "0 1 0", "0 0 1", "0 -1 0"].choose(rng).unwrap_or(&"1 0 0").to_string(),
        _ => format!("{} 0.4", vector(rng, 1.0).rsplit_once(' ').map_or("1 1", |(xy, _)| xy)),
    };
    let velocity = ["0", "2.5", "5", "100", "0.2"].choose(rng).unwrap_or(&"1");
    let _ = write!(
        text,
        "<joint name=\"{name}\" type=\"{kind}\"><origin xyz=\"{}\" rpy=\"{}\"/>\
         <parent link=\"link_{parent}\"/><child link=\"link_{joint}\"/><axis xyz=\"{axis}\"/>\
         <limit lower=\"{low}\" upper=\"{high}\" effort=\"3\" velocity=\"{velocity}\"/>",
        vector(rng, 0.3),
        if rng.random_bool(0.3) { vector(rng, 1.6) } else { "0 0 0".into() },
    );
    if !clean && joint > 1 && rng.random_bool(0.1) {
        let _ = write!(
            text,
            "<mimic joint=\"joint_1\" multiplier=\"{}\"/>",
            rng.random_range(-2.0..2.0)
        );
    }
    text.push_str("</joint>");
}

fn vector(rng: &mut impl Rng, size: f64) -> String {
    let mut part = || rng.random_range(-size..size);
    format!("{:.4} {:.4} {:.4}", part(), part(), part())
}
