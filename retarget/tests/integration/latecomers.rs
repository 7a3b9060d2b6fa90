//! Several robots, one dancer: who comes late moves like those who were there,
//! if it is told what is usual for the dancer.

use crate::support::{CONTROL_HZ, Robot, dance};
use servodance_retarget::PostureReader;
use servodance_types::{BodyJoint, FRAME_RATE_HZ, MotionFrame, Posture};
use std::f64::consts::TAU;

const LATE_S: f64 = 8.0;
const END_S: f64 = 14.0;

/// A dance with nods, and the posture that goes with each frame.
fn led() -> Vec<(MotionFrame, Posture)> {
    let mut reader = PostureReader::default();
    let nod = |mut frame: MotionFrame| {
        let phase = TAU * (frame.time_s - LATE_S) / 1.1;
        frame.positions[BodyJoint::Head as usize][2] += 0.05 * phase.cos() as f32;
        (frame, reader.read(&frame))
    };
    dance(END_S + 1.0).into_iter().map(nod).collect()
}

/// Positions of every cycle from `start_s` to the end.
fn track(robot: &Robot, start_s: f64, mirror: bool, told: bool) -> Vec<Vec<f64>> {
    let mut retargeter = robot.retargeter();
    retargeter.set_mirror(mirror);
    let first = (start_s * FRAME_RATE_HZ) as usize;
    for (frame, posture) in led().iter().skip(first) {
        match told {
            true => retargeter.push_with_posture(frame, posture),
            false => retargeter.push(frame),
        }
    }
    let cycles = (start_s * CONTROL_HZ) as usize..(END_S * CONTROL_HZ) as usize;
    let mut out = retargeter.rest().to_vec();
    let each = cycles.map(|cycle| {
        let time_s = cycle as f64 / CONTROL_HZ;
        retargeter.next(time_s, &mut out).expect("right length");
        out.clone()
    });
    each.collect()
}

/// Largest difference of a joint, radians, `after_s` after the late one began.
fn apart_rad(robot: &Robot, mirror: bool, told: bool, after_s: f64) -> f64 {
    let early = track(robot, 0.0, mirror, told);
    let late = track(robot, LATE_S, mirror, told);
    let cycles = ((END_S - LATE_S - after_s) * CONTROL_HZ) as usize;
    let pairs = early.iter().rev().zip(late.iter().rev()).take(cycles);
    let joints = pairs.flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()));
    joints.fold(0.0, f64::max)
}

#[test]
fn who_is_told_what_is_usual_moves_like_the_others_within_seconds() {
    // Arms that can show the same in two ways (torso13) may choose the other one:
    // that is not what is learned of the dancer.
    let [op3, _, neck, _] = Robot::all();
    for (name, robot) in [op3, neck] {
        for mirror in [false, true] {
            let apart = apart_rad(&robot, mirror, true, 2.0);
            assert!(apart < 0.02, "{name}, mirror {mirror}: {apart} rad");
        }
    }
}

#[test]
fn who_is_not_told_holds_its_head_otherwise_until_the_dancer_has_been_seen() {
    let [_, _, (_, neck), _] = Robot::all();
    let [told, untold] = [true, false].map(|told| apart_rad(&neck, false, told, 1.0));
    assert!(untold > 0.03 && told < 0.5 * untold, "{untold} rad, told {told} rad");
    let settled = apart_rad(&neck, false, false, 2.0);
    assert!(settled < 0.02, "{settled} rad");
}
