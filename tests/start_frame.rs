//! The same dance, begun later, gives nearly the same poses: what a robot shows comes from
//! what the dancer does now, not from how it got there. Joints that turn about the vertical
//! stay within a quarter turn of rest. `servodance bench start-frame` measures both on any
//! motion: see docs/measurements/robots.md.

use servodance_runtime::offline::motion_tracking::track_motion;
use servodance_runtime::robot::{BUILT_IN, Robot};
use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

const CUT: usize = 200;
/// After so long both must show the same.
const SETTLED_S: f64 = 2.0;
const MOST_DEG: f64 = 5.0;
/// Robots whose pose is decided by the dancer alone, by no choice among arms and no feet that
/// stay: after so long they show the same to so much.
const SIMPLE: [&str; 3] = ["neck", "so101", "reachy_mini"];
const SIMPLE_SETTLED_S: f64 = 0.7;
const SIMPLE_MOST_DEG: f64 = 1.0;
/// Half a minute of a dance.
fn dance() -> Vec<MotionFrame> {
    let beats: Vec<DanceBeat> = (0..60)
        .map(|beat| DanceBeat { time_s: f64::from(beat) * 0.5, downbeat: beat % 4 == 0 })
        .collect();
    choreograph(&beats, 30.0, DanceStyle::Hype, 5).frames()
}

fn shown(robot: &Robot, frames: &[MotionFrame]) -> Vec<Vec<f64>> {
    let mut rows = Vec::new();
    track_motion(robot, frames, |_, row| {
        rows.push(row.to_vec());
        Ok(())
    })
    .unwrap();
    rows
}

/// Largest difference of any joint after `settled_s`, degrees, and the joint.
fn difference(robot: &Robot, settled_s: f64) -> (f64, String) {
    let whole = dance();
    let start_s = CUT as f64 / FRAME_RATE_HZ;
    let mut later = whole[CUT..].to_vec();
    for frame in &mut later {
        frame.time_s -= start_s;
    }
    let (all, cut) = (shown(robot, &whole), shown(robot, &later));
    let skipped = (start_s * robot.control_hz).round() as usize;
    let settled = (settled_s * robot.control_hz).round() as usize;
    let mut worst = (0.0, String::new());
    for (one, other) in all[skipped..].iter().zip(&cut).skip(settled) {
        for ((a, b), servo) in one.iter().zip(other).zip(&robot.servos) {
            let apart = (a - b).abs().to_degrees();
            if apart > worst.0 {
                worst = (apart, servo.name.clone());
            }
        }
    }
    worst
}

#[test]
fn a_dance_that_begins_later_gives_the_same_poses() {
    let mut too_far = Vec::new();
    for built_in in BUILT_IN {
        let name = built_in.name;
        let (settled_s, most_deg) = match SIMPLE.contains(&name) {
            true => (SIMPLE_SETTLED_S, SIMPLE_MOST_DEG),
            false => (SETTLED_S, MOST_DEG),
        };
        let (apart_deg, joint) = difference(&Robot::load(name).unwrap(), settled_s);
        if apart_deg > most_deg {
            too_far.push(format!("{name}: {apart_deg} degrees at {joint}"));
        }
    }
    assert!(too_far.is_empty(), "{too_far:?}");
}

#[test]
fn joints_about_the_vertical_stay_within_a_quarter_turn_of_rest() {
    let (frames, mut seen) = (dance(), 0);
    for built_in in BUILT_IN {
        let robot = Robot::load(built_in.name).unwrap();
        let retargeter = robot.retargeter().unwrap();
        let (rest, yaws) = (retargeter.rest(), retargeter.yaw_joints());
        seen += yaws.len();
        for row in shown(&robot, &frames) {
            for &joint in yaws {
                let away_deg = (row[joint] - rest[joint]).abs().to_degrees();
                let servo = &robot.servos[joint].name;
                assert!(away_deg < 90.0 + 1e-6, "{}: {servo} at {away_deg} degrees", robot.name);
            }
        }
    }
    assert!(seen > 10, "{seen} joints turn about the vertical");
}
