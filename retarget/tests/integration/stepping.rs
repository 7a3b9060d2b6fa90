//! A robot that steps: its feet follow the dancer's and do not skate.

use servodance_retarget::nalgebra::Vector3;
use servodance_retarget::{Retargeter, Stance};
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

use crate::support::{CONTROL_HZ, Robot, dance_pose, violations};

fn stepping() -> Robot {
    let mut robot = Robot::op3();
    robot.config.stance = Stance::Stepping;
    robot
}

/// Marching on the spot, a step every 0.8 s, with swinging arms.
fn march(seconds: f64) -> Vec<MotionFrame> {
    (0..(seconds * FRAME_RATE_HZ) as usize)
        .map(|k| {
            let time_s = k as f64 / FRAME_RATE_HZ;
            let mut pose = dance_pose(time_s);
            let step = (time_s / 1.6 * std::f64::consts::TAU).sin();
            pose.yaw = 0.0;
            pose.knee = [0.35 + step.max(0.0), 0.35 + (-step).max(0.0)];
            pose.pelvis = Vector3::new(0.0, -0.06 * step, 0.1 + 0.82 * 0.35_f64.cos());
            pose.frame(k)
        })
        .collect()
}

/// Places of both soles in the world, and which of them stand.
fn soles(robot: &Retargeter, positions: &[f64]) -> ([Vector3<f64>; 2], [bool; 2]) {
    let model = robot.model();
    let root = robot.world_from_root(positions);
    let poses = model.link_poses(positions);
    let at = |name: &str| {
        let link = model.link(name).expect("a sole");
        (root * poses[link]).translation.vector
    };
    let down = robot.feet_down().expect("on its feet");
    (["l_sole", "r_sole"].map(at), down)
}

#[test]
fn stepping_feet_follow_the_dancer_and_do_not_skate() {
    let robot = stepping();
    let mut retargeter = robot.retargeter();
    let frames = march(40.0);
    let mut waiting = frames.iter().peekable();
    let mut out = retargeter.rest().to_vec();
    let mut track = vec![out.clone(); 3];
    let (mut last, mut last_down) = soles(&retargeter, &out);
    let (mut contact, mut skating, mut lifted) = (0, 0, [0.0_f64; 2]);
    for cycle in 0..(40.0 * CONTROL_HZ) as usize {
        let time_s = cycle as f64 / CONTROL_HZ;
        while let Some(frame) = waiting.next_if(|f| f.time_s <= time_s + retargeter.lookahead_s()) {
            retargeter.push(frame);
        }
        retargeter.next(time_s, &mut out).unwrap();
        track.push(out.clone());
        let (now, down) = soles(&retargeter, &out);
        for side in 0..2 {
            lifted[side] = lifted[side].max(now[side].z);
            if down[side] && last_down[side] {
                contact += 1;
                // 2 cm a second: what an eye sees sliding.
                let speed = (now[side] - last[side]).xy().norm() * CONTROL_HZ;
                skating += usize::from(speed > 0.02);
            }
        }
        (last, last_down) = (now, down);
    }
    assert_eq!(violations(&track, &robot), [0; 4]);
    let counts = retargeter.counts();
    // Of 49 lifts balance refuses about every other one: the weight has to be over the other
    // foot before this one leaves, and it comes from where the last step left it.
    assert!(counts.steps > 20, "{counts:?}");
    assert!(counts.steps + counts.refused_steps > 45, "{counts:?}");
    assert!(lifted.iter().all(|z| *z > 0.005), "{lifted:?}");
    assert!(skating as f64 <= 0.05 * contact as f64, "{skating} of {contact} contact cycles");
    assert_eq!(counts.unbalanced_cycles, 0, "{counts:?}");
}

#[test]
fn a_stepping_robot_needs_legs() {
    let torso = Robot::all().into_iter().find(|(name, _)| *name == "torso13");
    let (_, mut torso) = torso.expect("built in");
    torso.config.stance = Stance::Stepping;
    let refused = Retargeter::new(torso.urdf, &torso.config, &torso.joints, CONTROL_HZ);
    let message = refused.err().expect("refused").to_string();
    assert!(message.contains("stepping"), "{message}");
}
