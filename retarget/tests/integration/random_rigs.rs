//! Robots that nobody built: random trees, axes and limits. The limits hold.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_retarget::{RetargetConfig, Retargeter};
use servodance_types::JointLimits;

use crate::adversarial::endure;
use crate::support::{CONTROL_HZ, Robot};

/// A random rig: limbs with names of body parts or without, turning or sliding
/// about any axis, some of them mimics of others.
fn rig(seed: u64) -> Robot {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut urdf = String::from("<robot name=\"rig\"><link name=\"base\"/>");
    let mut joints: Vec<(String, JointLimits)> = Vec::new();
    let chains: [(&str, &[&str]); 6] = [
        ("left", &["shoulder", "arm", "elbow", "hand"]),
        ("right", &["shoulder", "arm", "elbow", "hand"]),
        ("left", &["hip", "thigh", "knee", "ankle"]),
        ("right", &["hip", "thigh", "knee", "ankle"]),
        ("middle", &["neck", "head"]),
        ("odd", &["a", "b", "c"]),
    ];
    for (side, parts) in chains {
        if rng.random_bool(0.25) {
            continue;
        }
        let mut parent = String::from("base");
        let mut before: Option<String> = None;
        for part in &parts[..rng.random_range(1..=parts.len())] {
            let link = format!("{side}_{part}");
            let joint = format!("{link}_joint");
            let mut number = |most: f64| rng.random_range(-most..most);
            let origin = [number(0.3), number(0.3), number(0.3)];
            let turn = [number(3.0), number(3.0), number(3.0)];
            let axis = [number(1.0), number(1.0), number(1.0) + 1.5];
            let mass = number(1.0).abs();
            let limits = limits(&mut rng);
            let kind = match rng.random_range(0..10) {
                0 => "prismatic",
                1 => "continuous",
                _ => "revolute",
            };
            let mimic = match &before {
                Some(other) if rng.random_bool(0.1) => {
                    format!("<mimic joint=\"{other}\" multiplier=\"-0.5\"/>")
                }
                _ => String::new(),
            };
            let three = |v: [f64; 3]| format!("{:.4} {:.4} {:.4}", v[0], v[1], v[2]);
            urdf += &format!(
                "<link name=\"{link}\"><inertial><mass value=\"{mass:.3}\"/><inertia ixx=\"0\" ixy=\"0\" \
                 ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/></inertial><visual><geometry><box \
                 size=\"0.05 0.06 0.2\"/></geometry></visual></link><joint name=\"{joint}\" \
                 type=\"{kind}\"><origin xyz=\"{}\" rpy=\"{}\"/><parent link=\"{parent}\"/><child \
                 link=\"{link}\"/><axis xyz=\"{}\"/><limit lower=\"{}\" upper=\"{}\" effort=\"3\" \
                 velocity=\"9\"/>{mimic}</joint>",
                three(origin),
                three(turn),
                three(axis),
                limits.lower_rad,
                limits.upper_rad,
            );
            if mimic.is_empty() {
                joints.push((joint.clone(), limits));
                before = Some(joint);
            }
            parent = link;
        }
    }
    urdf += "</robot>";
    Robot { urdf: urdf.leak(), config: RetargetConfig::default(), joints }
}

/// From a hair's breadth to full turns, from sluggish to brisk.
fn limits(rng: &mut ChaCha8Rng) -> JointLimits {
    let lower_rad = rng.random_range(-3.0..0.5);
    let velocity_rad_s = rng.random_range(0.5..12.0);
    JointLimits {
        lower_rad,
        upper_rad: lower_rad + 10f64.powf(rng.random_range(-2.0..0.7)),
        velocity_rad_s,
        acceleration_rad_s2: velocity_rad_s * rng.random_range(3.0..25.0),
    }
}

/// How many rigs moved. Rigs without joints are no robots; all others must run,
/// if only a few find their arms and legs by such names.
fn endured(seeds: std::ops::Range<u64>, cycles: usize) -> usize {
    let mut robots = 0;
    for seed in seeds {
        let robot = rig(seed);
        if robot.joints.is_empty() {
            continue;
        }
        if let Err(error) = Retargeter::new(robot.urdf, &robot.config, &robot.joints, CONTROL_HZ) {
            panic!("rig {seed}: {error}");
        }
        robots += usize::from(endure(&robot, cycles, seed) > 0.02);
    }
    robots
}

#[test]
fn no_random_rig_breaks_a_limit() {
    assert!(endured(0..60, 400) > 40);
}

/// Slow; run with `--run-ignored all`.
#[test]
#[ignore = "a minute long"]
fn random_rigs_break_no_limit_in_a_million_cycles() {
    assert!(endured(1000..1260, 4000) >= 250);
}
