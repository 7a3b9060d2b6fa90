//! Motion that no dancer makes: the limits hold all the same.

use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_types::MotionFrame;

use crate::support::{Pose, Robot, dance, follow, violations};

fn noise(rng: &mut ChaCha8Rng, frames: &mut [MotionFrame], amount: f32) {
    for frame in frames {
        for value in frame.positions.iter_mut().flatten() {
            *value += rng.random_range(-amount..amount);
        }
    }
}

#[test]
fn noise_of_every_size_breaks_no_limit() {
    for (name, robot) in Robot::all() {
        for (seed, amount) in [(1, 0.01), (2, 0.1), (3, 1.0), (4, 100.0)] {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut frames = dance(20.0);
            noise(&mut rng, &mut frames, amount);
            let track = follow(&mut robot.retargeter(), &frames);
            let broken = violations(&track, &robot);
            assert_eq!(broken, [0; 4], "{name}, noise {amount}");
        }
    }
}

#[test]
fn holes_nan_and_teleports_are_approached_and_counted() {
    let robot = Robot::op3();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut frames = dance(60.0);
    for frame in &mut frames {
        match rng.random_range(0..20) {
            0 => frame.positions[3][1] = f32::NAN,
            1 => frame.positions[20] = [1e30; 3],
            2 => frame.positions[18][0] += 3.0,
            3 => frame.time_s += 100.0,
            4 => frame.time_s = f64::INFINITY,
            5 => frame.positions = [[0.0; 3]; 22],
            _ => {}
        }
    }
    let mut retargeter = robot.retargeter();
    let track = follow(&mut retargeter, &frames);
    assert_eq!(violations(&track, &robot), [0; 4]);
    let counts = retargeter.counts();
    assert!(counts.unusable_frames > 0 && counts.teleports > 0, "{counts:?}");
}

#[test]
fn live_changes_of_style_break_no_limit() {
    let robot = Robot::op3();
    let mut retargeter = robot.retargeter();
    let frames = dance(10.0);
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut out = retargeter.rest().to_vec();
    let mut track = vec![out.clone(); 3];
    for cycle in 0..1000 {
        if cycle % 5 == 0 {
            retargeter.push(&frames[cycle / 5]);
        }
        if cycle % 50 == 0 {
            retargeter.set_amplitude(rng.random_range(-1.0..2.0));
            retargeter.set_mirror(rng.random());
        }
        retargeter.next(cycle as f64 * 0.01, &mut out).unwrap();
        track.push(out.clone());
    }
    assert_eq!(violations(&track, &robot), [0; 4]);
}

#[test]
fn any_start_inside_the_limits_is_led_on_smoothly() {
    let robot = Robot::op3();
    let frames = dance(5.0);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..20 {
        let start: Vec<f64> =
            robot.limits().iter().map(|l| rng.random_range(l.lower_rad..l.upper_rad)).collect();
        let mut retargeter = robot.retargeter();
        retargeter.seed(&start).unwrap();
        let mut track = follow(&mut retargeter, &frames);
        track[0].clone_from(&start);
        track[1].clone_from(&start);
        track[2].clone_from(&start);
        assert_eq!(violations(&track, &robot), [0; 4]);
        let counts = retargeter.counts();
        assert_eq!(counts.cycles, 500);
    }
}

#[test]
fn a_start_that_is_not_a_number_is_refused() {
    let mut retargeter = Robot::op3().retargeter();
    let mut start = retargeter.rest().to_vec();
    start[3] = f64::NAN;
    let message = retargeter.seed(&start).unwrap_err().to_string();
    assert!(message.contains("l_sho_roll"), "{message}");
    assert!(retargeter.seed(&start[1..]).is_err());
}

/// Everything at once: calm dance, noise of every size, NaN, mirror and
/// amplitude changed at any time. Says how far from rest a joint came at most.
pub fn endure(robot: &Robot, cycles: usize, seed: u64) -> f64 {
    let mut retargeter = robot.retargeter();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let calm = dance(100.0);
    let (mut amount, mut farthest) = (0.0, 0.0_f64);
    let mut window = vec![retargeter.rest().to_vec(); 4];
    for cycle in 0..cycles {
        if cycle % 500 == 0 {
            amount = *[0.02, 3.0, 0.0, 0.3].get(cycle / 500 % 4).unwrap_or(&0.0);
            retargeter.set_mirror(rng.random());
            retargeter.set_amplitude(rng.random_range(0.3..1.0));
        }
        if cycle % 5 == 0 {
            let mut frames = [calm[cycle / 5 % calm.len()]];
            frames[0].time_s = (cycle / 5) as f64 / servodance_types::FRAME_RATE_HZ;
            if amount > 0.0 {
                noise(&mut rng, &mut frames, amount);
            }
            if rng.random_range(0..50) == 0 {
                frames[0].positions[7][1] = f32::NAN;
            }
            retargeter.push(&frames[0]);
        }
        window.rotate_left(1);
        let time_s = cycle as f64 * 0.01 - retargeter.lookahead_s();
        retargeter.next(time_s, &mut window[3]).unwrap();
        for (position, rest) in window[3].iter().zip(retargeter.rest()) {
            farthest = farthest.max((position - rest).abs());
        }
        assert_eq!(violations(&window, robot), [0; 4], "seed {seed}, cycle {cycle}");
    }
    println!("{:?}\n{:?}", retargeter.counts(), retargeter.torque_report());
    farthest
}

/// Slow; run with `--run-ignored all`: a million cycles for each robot.
#[test]
#[ignore = "minutes long"]
fn a_million_hostile_cycles_break_no_limit() {
    for (name, robot) in Robot::all() {
        println!("{name}");
        endure(&robot, 1_000_000, 99);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_floats_break_no_limit(
        values in prop::collection::vec(prop::num::f32::ANY, 22 * 3 * 12),
        times in prop::collection::vec(prop::num::f64::ANY, 12),
        ask in prop::collection::vec(prop::num::f64::ANY, 100),
    ) {
        let robot = Robot::op3();
        let mut retargeter = robot.retargeter();
        let mut out = retargeter.rest().to_vec();
        let mut track = vec![out.clone(); 3];
        for (k, ask) in ask.into_iter().enumerate() {
            if k < 12 {
                let mut frame = Pose::standing().frame(k);
                if k % 2 == 0 {
                    frame.time_s = times[k];
                }
                for (point, chunk) in frame.positions.iter_mut().zip(values[k * 66..].chunks(3)) {
                    point.copy_from_slice(chunk);
                }
                retargeter.push(&frame);
            }
            let time_s = if k % 3 == 0 { ask } else { k as f64 * 0.01 };
            retargeter.next(time_s, &mut out).unwrap();
            track.push(out.clone());
        }
        prop_assert_eq!(violations(&track, &robot), [0; 4]);
    }
}
