//! How long a control cycle of retargeting takes, and what it allocates; for a robot on
//! its feet the correction by a motion sensor included.
//!
//! Every cycle of one motion is timed in several identical passes, and the
//! median of its times counts: what else runs on the machine would otherwise be
//! most of the 99th percentile. Allocations are counted by the allocator, in
//! the thread that retargets, over all cycles of a pass.

use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use serde::Serialize;
use servodance_model::motion::Clip;
use servodance_retarget::{BalanceFeedback, Retargeter};
use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};
use servodance_types::{FRAME_RATE_HZ, ImuState, JointState, MotionFrame};

use servodance_runtime::physics::ServoLoop;
use servodance_runtime::robot::Robot;

const PASSES: usize = 5;
/// Tempo and seed of the dance that is used when no motion is given.
const BEAT_S: f64 = 0.5;
const SEED: u64 = 1;
/// The longest motion that is measured, seconds.
const LONGEST_S: f64 = 600.0;

/// What `bench retarget` prints.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct RetargetBenchReport {
    pub robot: String,
    pub joints: usize,
    pub control_hz: f64,
    pub cycles: usize,
    pub us_mean: f64,
    pub us_p50: f64,
    pub us_p99: f64,
    pub us_max: f64,
    pub allocations: u64,
    /// Whether balance was part of it.
    pub balance: bool,
}

/// The motion of a file, or the choreographer's dance of `seconds`.
/// Fails for: what is wrong with the file.
pub fn motion(file: Option<&Path>, seconds: f64) -> anyhow::Result<Clip> {
    let clip = match file {
        Some(path) => Clip::read_npz(path)?,
        None => {
            let beats: Vec<DanceBeat> = (0..(seconds / BEAT_S) as usize)
                .map(|beat| DanceBeat { time_s: beat as f64 * BEAT_S, downbeat: beat % 4 == 0 })
                .collect();
            choreograph(&beats, seconds, DanceStyle::Groove, SEED)
        }
    };
    let shown = clip.duration_s().min(seconds.min(LONGEST_S));
    let mut clip = clip.resampled(FRAME_RATE_HZ);
    clip.poses.truncate(((shown * FRAME_RATE_HZ) as usize).max(1));
    Ok(clip)
}

/// Retargets `clip` and measures every cycle.
/// Fails for: a motion too short to measure.
pub fn run(robot: &Robot, clip: &Clip) -> anyhow::Result<RetargetBenchReport> {
    let frames: Vec<MotionFrame> = clip.frames();
    let cycles = (frames.len() as f64 / FRAME_RATE_HZ * robot.control_hz) as usize;
    anyhow::ensure!(
        cycles >= 100,
        "{}: {} frames are too few to measure; give at least a second",
        clip.name,
        frames.len()
    );
    let mut times_us = vec![[0.0; PASSES]; cycles];
    let mut allocations = 0;
    for pass in 0..PASSES {
        allocations = allocations.max(one_pass(robot, &frames, &mut times_us, pass)?);
    }
    let mut medians: Vec<f64> = times_us
        .iter_mut()
        .map(|times| {
            times.sort_by(f64::total_cmp);
            times[PASSES / 2]
        })
        .collect();
    medians.sort_by(f64::total_cmp);
    let rank = |share: f64| medians[((cycles as f64 * share).ceil() as usize).clamp(1, cycles) - 1];
    Ok(RetargetBenchReport {
        robot: robot.name.clone(),
        joints: robot.servos.len(),
        control_hz: robot.control_hz,
        cycles,
        us_mean: medians.iter().sum::<f64>() / cycles as f64,
        us_p50: rank(0.5),
        us_p99: rank(0.99),
        us_max: rank(1.0),
        allocations,
        balance: balance(robot, &robot.retargeter()?).is_some(),
    })
}

/// One run over all frames; says how often it allocated.
fn one_pass(
    robot: &Robot,
    frames: &[MotionFrame],
    times_us: &mut [[f64; PASSES]],
    pass: usize,
) -> anyhow::Result<u64> {
    let mut retargeter = robot.retargeter()?;
    let mut targets = retargeter.rest().to_vec();
    let mut waiting = frames.iter().peekable();
    let mut balance = balance(robot, &retargeter);
    let mut states = vec![JointState::default(); targets.len()];
    let mut result = Ok(());
    let counted = allocation_counter::measure(|| {
        for (cycle, times) in times_us.iter_mut().enumerate() {
            let time_s = cycle as f64 * robot.period_s();
            let needed_s = time_s + retargeter.lookahead_s();
            let begin = Instant::now();
            while let Some(frame) = waiting.next_if(|frame| frame.time_s <= needed_s) {
                retargeter.push(frame);
            }
            result = retargeter.next(time_s, &mut targets);
            if let Some(balance) = &mut balance {
                balance.feel(&retargeter, &states);
                balance.correct(&retargeter, Some(&leaning(time_s)), &mut targets);
            }
            times[pass] = begin.elapsed().as_secs_f64() * 1e6;
            for (state, target) in states.iter_mut().zip(&targets) {
                state.position_rad = *target;
            }
        }
    });
    result.context("retargeting failed")?;
    Ok(counted.count_total)
}

fn balance(robot: &Robot, retargeter: &Retargeter) -> Option<BalanceFeedback> {
    let loops = ServoLoop::of_robot(robot, retargeter, &Default::default(), false);
    let legs: Vec<_> = loops.iter().map(ServoLoop::leg_servo).collect();
    let limits: Vec<_> = robot.servos.iter().map(|servo| servo.limits).collect();
    BalanceFeedback::new(retargeter, &legs, &limits)
}

/// What a sensor reads that leans by 6 degrees to and fro once a second.
fn leaning(time_s: f64) -> ImuState {
    let (lean, rate) = (0.1 * (std::f64::consts::TAU * time_s).sin(), 0.6);
    let up = [-lean.sin(), 0.0, lean.cos()];
    ImuState { rate_rad_s: [0.0, rate, 0.0], force_m_s2: up.map(|part| 9.81 * part), up }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_runtime::robot::BUILT_IN;

    #[test]
    fn no_built_in_robot_allocates_in_a_cycle() {
        let clip = motion(None, 5.0).unwrap();
        for built_in in BUILT_IN {
            let figures = run(&Robot::load(built_in.name).unwrap(), &clip).unwrap();
            assert_eq!(figures.allocations, 0, "{}", built_in.name);
            assert!(figures.us_mean > 0.0 && figures.us_p50 <= figures.us_p99);
        }
    }

    #[test]
    fn a_motion_too_short_is_refused() {
        let clip = motion(None, 0.5).unwrap();
        let error = run(&Robot::load("neck").unwrap(), &clip).unwrap_err();
        assert!(error.to_string().contains("too few"), "{error}");
    }
}
