//! An ordinary dance: does the robot show it?

use servodance_retarget::nalgebra::Vector3;
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

use crate::support::{
    CONTROL_HZ, Pose, Robot, dance, dance_pose, follow, follow_at, violations, violations_at,
};

#[test]
fn a_dance_keeps_every_limit_and_the_feet_stay() {
    let robot = Robot::op3();
    let mut retargeter = robot.retargeter();
    let track = follow(&mut retargeter, &dance(30.0));
    assert_eq!(violations(&track, &robot), [0; 4]);
    let model = retargeter.model();
    let feet = ["l_sole", "r_sole"].map(|name| model.link(name).unwrap());
    let places = |positions: &[f64]| {
        let poses = model.link_poses(positions);
        feet.map(|foot| poses[foot].translation.vector)
    };
    // However the body moves, the feet keep their distance and stay level.
    let apart = |positions: &[f64]| {
        let [left, right] = places(positions);
        (left - right).norm()
    };
    let rest = apart(&track[0]);
    for positions in &track {
        assert!((apart(positions) - rest).abs() < 1e-3);
        let poses = model.link_poses(positions);
        let twist = poses[feet[0]].rotation.angle_to(&poses[feet[1]].rotation);
        assert!(twist < 5e-3, "{twist}");
    }
    assert_eq!(retargeter.counts().feet_moved_cycles, 0);
    // The last frame is held until the song's last cycle.
    assert_eq!(retargeter.counts().starved_cycles, 4);
}

/// Angles between the dancer's limbs and the robot's, degrees.
fn direction_errors(track: &[Vec<f64>]) -> Vec<f64> {
    let retargeter = Robot::op3().retargeter();
    let model = retargeter.model();
    let mut errors = Vec::new();
    for k in (20..track.len() - 3).step_by(5) {
        let pose = dance_pose(k as f64 / CONTROL_HZ);
        let positions = &track[k + 3];
        let poses = model.link_poses(positions);
        let root = retargeter.world_from_root(positions);
        let at = |name: &str| {
            let link = model.link(name).unwrap();
            (root * poses[link]).translation.vector
        };
        let across = at("l_sho_roll_link") - at("r_sho_roll_link");
        let yaw = (-across.x).atan2(across.y);
        let unturn =
            servodance_retarget::nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw);
        for (side, letter) in ["l", "r"].into_iter().enumerate() {
            let shoulder = at(&format!("{letter}_sho_roll_link"));
            let elbow = at(&format!("{letter}_el_link"));
            let hand = at(&format!("{letter}_hand"));
            for (robot, human) in
                [(elbow - shoulder, pose.upper_arm[side]), (hand - elbow, pose.forearm[side])]
            {
                errors.push((unturn * robot).angle(&human).to_degrees());
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn every_robot_moves_every_joint() {
    for (name, robot) in Robot::all() {
        let track = follow(&mut robot.retargeter(), &dance(20.0));
        assert_eq!(violations(&track, &robot), [0; 4], "{name}");
        for (joint, (joint_name, _)) in robot.joints.iter().enumerate() {
            let positions = track.iter().map(|row| row[joint]);
            let low = positions.clone().fold(f64::INFINITY, f64::min);
            let high = positions.fold(f64::NEG_INFINITY, f64::max);
            // This dancer neither nods nor leans nor shifts weight, and a forearm
            // that turns about itself shows nothing.
            let still =
                ["tilt", "head_y", "bust", "hip_roll", "ank_roll", "ankle_roll", "elbow_roll"]
                    .iter()
                    .any(|part| joint_name.contains(part));
            assert!(still || high - low > 0.02, "{name}: {joint_name} stands still");
        }
    }
}

#[test]
fn limbs_point_where_the_dancer_s_do() {
    let errors = direction_errors(&follow(&mut Robot::op3().retargeter(), &dance(30.0)));
    let median = errors[errors.len() / 2];
    assert!(median < 8.0, "median {median:.1} degrees");
}

#[test]
fn the_output_is_on_time() {
    // The arm's lift against its own track shifted: the best shift is the delay.
    let robot = Robot::op3();
    let track = follow(&mut robot.retargeter(), &dance(30.0));
    let knee = robot.joints.iter().position(|(n, _)| n == "l_knee").unwrap();
    let wanted = |cycle: f64| -dance_pose(cycle / CONTROL_HZ).pelvis.z;
    let score = |delay: i32| {
        let pairs: Vec<(f64, f64)> =
            (500..2500).map(|k| (track[k + 3][knee], wanted((k as i32 - delay).into()))).collect();
        let n = pairs.len() as f64;
        let mean = pairs.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
        pairs.iter().map(|p| (p.0 - mean.0) * (p.1 - mean.1)).sum::<f64>()
    };
    let delay = (-20..=20).max_by(|a, b| score(*a).total_cmp(&score(*b))).unwrap();
    assert!(delay.abs() <= 2, "{delay} cycles late");
}

#[test]
fn the_mirrored_dance_is_the_mirror_image() {
    let robot = Robot::op3();
    let mut mirrored = robot.retargeter();
    mirrored.set_mirror(true);
    let frames = dance(15.0);
    let straight = follow(&mut robot.retargeter(), &frames);
    let mirrored = follow(&mut mirrored, &frames);
    let index = |name: &str| robot.joints.iter().position(|(n, _)| n == name).unwrap();
    // Axes of the description: which joints change sign in a mirror.
    for (name, sign) in [
        ("sho_pitch", -1.0),
        ("sho_roll", -1.0),
        ("el", -1.0),
        ("hip_pitch", -1.0),
        ("knee", -1.0),
        ("ank_pitch", -1.0),
        ("hip_roll", -1.0),
        ("hip_yaw", -1.0),
    ] {
        let (left, right) = (index(&format!("l_{name}")), index(&format!("r_{name}")));
        let most = straight
            .iter()
            .zip(&mirrored)
            .map(|(a, b)| (a[left] - sign * b[right]).abs())
            .fold(0.0, f64::max);
        assert!(most < 0.02, "{name}: {most} rad apart");
    }
}

/// All at once, the first pose of a dance is a throw of the arms, which tips a robot over.
#[test]
fn a_dance_takes_up_its_size_within_a_second() {
    let robot = Robot::op3();
    let mut retargeter = robot.retargeter();
    let rest = retargeter.rest().to_vec();
    let pose = dance_pose(1.0);
    let frames: Vec<MotionFrame> = (0..60).map(|k| pose.frame(k)).collect();
    let track = follow(&mut retargeter, &frames);
    let away = |time_s: f64| {
        let joints = track[3 + (time_s * CONTROL_HZ) as usize].iter().zip(&rest);
        joints.map(|(now, rest)| (now - rest).powi(2)).sum::<f64>().sqrt()
    };
    assert!(away(0.5) < 0.25 * away(1.2), "{} {}", away(0.5), away(1.2));
    assert!(away(1.2) > 1.5, "{}", away(1.2));
}

#[test]
fn no_amplitude_is_the_rest_pose() {
    let robot = Robot::op3();
    let mut retargeter = robot.retargeter();
    retargeter.set_amplitude(0.0);
    let rest = retargeter.rest().to_vec();
    for positions in follow(&mut retargeter, &dance(5.0)) {
        for (now, rest) in positions.iter().zip(&rest) {
            assert!((now - rest).abs() < 1e-6);
        }
    }
}

#[test]
fn rest_is_taken_up_gently_from_anywhere() {
    let robots = Robot::all();
    let starts = [0.0, 0.3, -0.6];
    for ((name, robot), angle) in robots.iter().flat_map(|r| starts.map(|s| (r, s))) {
        let mut retargeter = robot.retargeter();
        let limits = robot.limits();
        let start: Vec<f64> = limits.iter().map(|limits| limits.clamp_rad(angle)).collect();
        retargeter.seed(&start).unwrap();
        retargeter.push(&dance(0.1)[0]);
        let mut track = vec![start.clone(); 3];
        let mut out = start;
        for cycle in 0..500 {
            let time_s = cycle as f64 / CONTROL_HZ - 6.0;
            retargeter.next(time_s, &mut out).unwrap();
            track.push(out.clone());
        }
        assert_eq!(violations(&track, robot), [0; 4], "{name}");
        for (cycle, pair) in track.windows(2).enumerate() {
            for (joint, (before, after)) in pair[0].iter().zip(&pair[1]).enumerate() {
                let speed = (after - before).abs() * CONTROL_HZ;
                let joint = &robot.joints[joint].0;
                assert!(
                    speed < 1.2,
                    "{name} from {angle}: {joint} at {speed:.2} rad/s in cycle {cycle}"
                );
            }
        }
        for (now, rest) in out.iter().zip(retargeter.rest()) {
            assert!((now - rest).abs() < 0.02, "{name} from {angle}: {now} {rest}");
        }
    }
}

#[test]
fn before_the_first_frame_the_robot_rests() {
    let mut retargeter = Robot::op3().retargeter();
    let rest = retargeter.rest().to_vec();
    let mut out = rest.clone();
    for cycle in 0..100 {
        retargeter.next(cycle as f64 / FRAME_RATE_HZ, &mut out).unwrap();
    }
    for (now, rest) in out.iter().zip(&rest) {
        assert!((now - rest).abs() < 1e-3, "{now} {rest}");
    }
}

#[test]
fn arms_held_overhead_end_up_overhead() {
    let robot = Robot::op3();
    let up = Vector3::z();
    let frames: Vec<_> = (0..160)
        .map(|k| {
            // From hanging, forward and up, in two seconds; then held.
            let angle = (k as f64 / 40.0).min(1.0) * std::f64::consts::PI;
            let mut pose = Pose::standing();
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                let arm = Vector3::new(angle.sin(), sign * 0.1, -angle.cos()).normalize();
                pose.upper_arm[side] = arm;
                pose.forearm[side] = arm;
            }
            pose.frame(k)
        })
        .collect();
    let mut retargeter = robot.retargeter();
    let track = follow(&mut retargeter, &frames);
    assert_eq!(violations(&track, &robot), [0; 4]);
    let poses = retargeter.model().link_poses(track.last().unwrap());
    for letter in ["l", "r"] {
        let at = |part: &str| {
            let link = retargeter.model().link(&format!("{letter}_{part}"));
            poses[link.unwrap()].translation.vector
        };
        let away = (at("el_link") - at("sho_roll_link")).angle(&up).to_degrees();
        assert!(away < 45.0, "{letter}: {away:.0} degrees");
    }
}

/// A dance that asks more of the legs than they can follow: quick squats with
/// quick turns and sways.
fn stomping(seconds: f64) -> Vec<MotionFrame> {
    (0..(seconds * FRAME_RATE_HZ) as usize)
        .map(|k| {
            let time_s = k as f64 / FRAME_RATE_HZ;
            let mut pose = dance_pose(time_s);
            let beat = std::f64::consts::TAU * time_s * 2.2;
            let bend = 0.55 - 0.5 * beat.sin().signum() * beat.sin().abs().sqrt();
            pose.knee = [bend; 2];
            pose.pelvis.y = 0.16 * (beat * 0.7).sin();
            pose.pelvis.z = 0.1 + 0.82 * bend.cos();
            pose.yaw = 0.8 * (beat * 0.9).sin();
            pose.frame(k)
        })
        .collect()
}

#[test]
fn planted_feet_stay_at_every_control_rate() {
    let robots = Robot::all().into_iter();
    for (name, robot) in robots.filter(|(_, robot)| robot.config.stance.stands()) {
        for control_hz in [100.0, 250.0, 500.0] {
            for frames in [dance(10.0), stomping(10.0)] {
                let mut retargeter = robot.retargeter_at(control_hz);
                let track = follow_at(control_hz, &mut retargeter, &frames, |_| ());
                let broken = violations_at(control_hz, &track, &robot);
                assert_eq!(broken, [0; 4], "{name} at {control_hz} Hz");
                let counts = retargeter.counts();
                assert_eq!(
                    (counts.feet_moved_cycles, counts.unbalanced_cycles),
                    (0, 0),
                    "{name} at {control_hz} Hz"
                );
            }
        }
    }
}

/// Counted, not timed: what else runs on the machine does not matter. Two joints
/// are never much work.
#[test]
fn no_cycle_works_much_more_than_the_others() {
    for (name, robot) in Robot::all().into_iter().filter(|(_, r)| r.joints.len() > 2) {
        let mut retargeter = robot.retargeter();
        let (mut before, mut work) = (retargeter.work(), Vec::new());
        follow_at(CONTROL_HZ, &mut retargeter, &dance(20.0), |robot| {
            work.push(robot.work() - before);
            before = robot.work();
        });
        let mean = work.iter().sum::<u64>() as f64 / work.len() as f64;
        work.sort_unstable();
        let [p99, most] = [0.99, 1.0].map(|share| {
            let at = (share * (work.len() - 1) as f64) as usize;
            work[at] as f64 / mean
        });
        println!("{name}: {mean:.0} a cycle, p99 {p99:.2}, most {most:.2} times that");
        assert!(p99 < 2.5 && most < 6.0, "{name}: {p99:.2}, {most:.2}");
    }
}

#[test]
fn a_trunk_on_planted_feet_does_not_make_room_for_an_arm() {
    let mut robot = Robot::read(
        include_str!("../../../configs/g1.toml"),
        include_str!("../../../configs/g1.urdf"),
    );
    robot.config.gain.torso = 0.0;
    let mut retargeter = robot.retargeter();
    let through_the_body = |k: usize| {
        let mut pose = Pose::standing();
        let in_front = (k as f64 / FRAME_RATE_HZ * 3.0).sin();
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let inward = Vector3::new(in_front, -sign, -0.5).normalize();
            (pose.upper_arm[side], pose.forearm[side]) = (inward, inward);
        }
        pose.frame(k)
    };
    let frames: Vec<MotionFrame> = (0..200).map(through_the_body).collect();
    let track = follow(&mut retargeter, &frames);
    assert!(retargeter.counts().guarded_cycles > 50, "{:?}", retargeter.counts());
    for joint in (0..robot.joints.len()).filter(|&joint| robot.joints[joint].0.contains("waist")) {
        let rest = retargeter.rest()[joint];
        let farthest = track.iter().map(|row| (row[joint] - rest).abs()).fold(0.0, f64::max);
        assert!(farthest < 1e-6, "{}: {farthest} rad", robot.joints[joint].0);
    }
}
