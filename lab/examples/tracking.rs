//! How well a robot shows real dances, and what its limits cost.
//!
//! `cargo run --release -p servodance-lab --example tracking ROBOT CLIP.npz...`
//!
//! Follows every clip twice: as `servodance retarget` does, and free of velocity,
//! acceleration and jerk limits. Prints a table of median angles between the
//! dancer's and the robot's limbs, degrees, a row a clip, then quartiles over
//! the clips. Arms are compared in the heading of the chest, legs in that of the
//! pelvis.

use std::path::Path;

use anyhow::Context;
use servodance_model::motion::Clip;
use servodance_retarget::LimbSegment;
use servodance_runtime::offline::motion_tracking::{TrackedMotion, track_motion};
use servodance_runtime::robot::Robot;
use servodance_types::FRAME_RATE_HZ;

/// Times the limits: far beyond what any dance asks for.
const FREE: f64 = 100.0;
/// The fastest rise of acceleration that a robot file can give, seconds.
const LEAST_RISE_S: f64 = 0.002;

const HEADER: &str = "| clip | upper arms | forearms | arms | arms, free | legs | all limbs | \
                      jerk, rad/s^3 | broken limits |";

fn main() -> anyhow::Result<()> {
    let mut args = std::env::args().skip(1);
    let name = args.next().context("usage: tracking ROBOT CLIP.npz...")?;
    let robot = Robot::load(&name)?;
    let free = freed(&robot);
    println!("{HEADER}\n|---|---|---|---|---|---|---|---|---|");
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for path in args {
        let clip = Clip::read_npz(Path::new(&path))?.resampled(FRAME_RATE_HZ);
        let frames = clip.frames();
        let limited = track_motion(&robot, &frames, |_, _| Ok(()))?;
        let unlimited = track_motion(&free, &frames, |_, _| Ok(()))?;
        let row = figures(&limited, &unlimited);
        let broken = limited.violations;
        let broken = broken.position + broken.velocity + broken.acceleration;
        println!("{} {broken} |", line(&clip.name, &row));
        columns.resize(row.len(), Vec::new());
        for (column, value) in columns.iter_mut().zip(row) {
            column.push(value);
        }
    }
    for column in &mut columns {
        column.sort_by(f64::total_cmp);
    }
    for (name, share) in [("first quartile", 0.25), ("median", 0.5), ("third quartile", 0.75)] {
        let row: Vec<f64> = columns.iter().map(|c| TrackedMotion::quantile(c, share)).collect();
        println!("{} |", line(name, &row));
    }
    Ok(())
}

/// The robot without limits on rates.
fn freed(robot: &Robot) -> Robot {
    let mut free = robot.clone();
    for servo in &mut free.servos {
        servo.limits.velocity_rad_s *= FREE;
        servo.limits.acceleration_rad_s2 *= FREE;
    }
    free.retarget.jerk_rise_s = LEAST_RISE_S;
    free.retarget.jerk_deg_s3.clear();
    free
}

fn figures(limited: &TrackedMotion, free: &TrackedMotion) -> Vec<f64> {
    let median = |of: &TrackedMotion, pick: &dyn Fn(LimbSegment) -> bool| {
        of.median_deg(pick).unwrap_or(f64::NAN)
    };
    vec![
        median(limited, &|s| s == LimbSegment::UpperArm),
        median(limited, &|s| s == LimbSegment::Forearm),
        median(limited, &|s| s.is_arm()),
        median(free, &|s| s.is_arm()),
        median(limited, &|s| !s.is_arm()),
        median(limited, &|_| true),
        limited.jerk_rms_rad_s3,
    ]
}

fn line(name: &str, row: &[f64]) -> String {
    let cells: Vec<String> = row
        .iter()
        .enumerate()
        .map(|(column, value)| match column {
            6 => format!("{value:.0}"),
            _ => format!("{value:.1}"),
        })
        .collect();
    format!("| {name} | {} |", cells.join(" | "))
}
