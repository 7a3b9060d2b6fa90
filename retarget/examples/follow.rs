//! Retargets motion and prints joint positions.
//!
//! `follow ROBOT.toml < motion.csv > joints.csv`
//! `follow > joints.csv`: two seconds of waving arms, on the robot of configs/op3.toml
//!
//! Input: one line a frame at 20 Hz, 66 numbers: x, y, z of the 22 joints,
//! metres, y up. Output: a header of joint names, then one line a control cycle
//! in radians, then the pose of the root link (x, y, z, qx, qy, qz, qw).
//! Figures go to standard error.

use std::error::Error;
use std::io::{BufRead, Write};
use std::time::Instant;

use servodance_retarget::{RetargetConfig, Retargeter};
use servodance_types::BodyJoint::*;
use servodance_types::{FRAME_RATE_HZ, JOINT_COUNT, JointLimits, MotionFrame};

const OP3: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/op3.toml");

fn main() -> Result<(), Box<dyn Error>> {
    let (path, frames) = match std::env::args().nth(1) {
        Some(path) => (path, read_motion()?),
        None => (OP3.to_owned(), (0..40).map(waving).collect()),
    };
    let (mut robot, hz) = open(&path)?;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    writeln!(out, "{},x,y,z,qx,qy,qz,qw", robot.model().joint_names().join(","))?;

    let mut positions = robot.rest().to_vec();
    let mut waiting = frames.iter().peekable();
    let mut cycle_us = Vec::new();
    let end_s = frames.len() as f64 / FRAME_RATE_HZ;
    for cycle in 0.. {
        let time_s = f64::from(cycle) / hz;
        if time_s >= end_s {
            break;
        }
        while let Some(frame) = waiting.next_if(|f| f.time_s <= time_s + robot.lookahead_s()) {
            robot.push(frame);
        }
        let begin = Instant::now();
        robot.next(time_s, &mut positions)?;
        cycle_us.push(begin.elapsed().as_secs_f64() * 1e6);
        let root = robot.world_from_root(&positions);
        let (t, q) = (root.translation, root.rotation);
        let numbers = positions
            .iter()
            .copied()
            .chain([t.x, t.y, t.z, q.i, q.j, q.k, q.w])
            .map(|v| format!("{v:.6}"));
        writeln!(out, "{}", numbers.collect::<Vec<_>>().join(","))?;
    }
    cycle_us.sort_by(f64::total_cmp);
    let mean = cycle_us.iter().sum::<f64>() / cycle_us.len().max(1) as f64;
    let p99 = cycle_us.get(cycle_us.len() * 99 / 100).copied();
    eprintln!(
        "{mean:.1} us mean, {:.1} us p99, {:?}, {:?}",
        p99.unwrap_or(0.0),
        robot.counts(),
        robot.torque_report()
    );
    Ok(())
}

/// Reads the parts of a robot file that retargeting needs.
fn open(path: &str) -> Result<(Retargeter, f64), Box<dyn Error>> {
    let file: toml::Table = std::fs::read_to_string(path)?.parse()?;
    let urdf = file.get("urdf").and_then(|v| v.as_str()).ok_or("no key urdf")?;
    let urdf = std::path::Path::new(path).with_file_name(urdf);
    let hz = file.get("control_hz").and_then(|v| v.as_integer()).ok_or("no control_hz")? as f64;
    let config: RetargetConfig = match file.get("retarget") {
        Some(table) => table.clone().try_into()?,
        None => RetargetConfig::default(),
    };
    let mut joints = Vec::new();
    for joint in file.get("joint").and_then(|v| v.as_array()).ok_or("no [[joint]]")? {
        let name = joint.get("name").and_then(|v| v.as_str()).ok_or("joint without name")?;
        let degrees = |key: &str| -> Result<f64, String> {
            let value = joint.get(key);
            let number =
                value.and_then(|v| v.as_float().or_else(|| v.as_integer().map(|i| i as f64)));
            Ok(number.ok_or(format!("{name}: no {key}"))?.to_radians())
        };
        let limits = JointLimits {
            lower_rad: degrees("lower_deg")?,
            upper_rad: degrees("upper_deg")?,
            velocity_rad_s: degrees("velocity_deg_s")?,
            acceleration_rad_s2: degrees("acceleration_deg_s2")?,
        };
        joints.push((name.to_string(), limits));
    }
    let urdf = std::fs::read_to_string(urdf)?;
    Ok((Retargeter::new(&urdf, &config, &joints, hz)?, hz))
}

fn read_motion() -> Result<Vec<MotionFrame>, Box<dyn Error>> {
    let mut frames = Vec::new();
    for (number, line) in std::io::stdin().lock().lines().enumerate() {
        let values: Vec<f32> =
            line?.split(',').map(|v| v.trim().parse()).collect::<Result<_, _>>()?;
        if values.len() != JOINT_COUNT * 3 {
            return Err(format!("line {}: {} numbers, not 66", number + 1, values.len()).into());
        }
        frames.push(MotionFrame {
            time_s: number as f64 / FRAME_RATE_HZ,
            positions: std::array::from_fn(|j| std::array::from_fn(|axis| values[j * 3 + axis])),
            contacts: Default::default(),
        });
    }
    Ok(frames)
}

/// A dancer who stands and moves the arms up and down, once a second.
fn waving(number: u16) -> MotionFrame {
    let time_s = f64::from(number) / FRAME_RATE_HZ;
    let (up, out) = (time_s as f32 * std::f32::consts::TAU).sin_cos();
    let middle = |height| [0.0, height, 0.0];
    let mut positions = [middle(0.0); JOINT_COUNT];
    for (joint, height) in
        [(Pelvis, 0.95), (Spine1, 1.05), (Spine2, 1.2), (Spine3, 1.25), (Neck, 1.5), (Head, 1.6)]
    {
        positions[joint as usize] = middle(height);
    }
    for (joint, aside, height, ahead) in [
        (LeftHip, 0.1, 0.9, 0.0),
        (LeftKnee, 0.1, 0.5, 0.02),
        (LeftAnkle, 0.1, 0.1, 0.0),
        (LeftFoot, 0.1, 0.03, 0.12),
        (LeftCollar, 0.08, 1.4, 0.0),
        (LeftShoulder, 0.18, 1.42, 0.0),
        (LeftElbow, 0.4 + 0.05 * out, 1.42 + 0.2 * up, 0.0),
        (LeftWrist, 0.6 + 0.1 * out, 1.42 + 0.4 * up, 0.05),
    ] {
        positions[joint as usize] = [aside, height, ahead];
        positions[joint.mirrored() as usize] = [-aside, height, ahead];
    }
    MotionFrame { time_s, positions, contacts: Default::default() }
}
