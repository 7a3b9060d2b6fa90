//! One trial in the simulated world as a JSON file, for another engine to play:
//! `sim/reference/mujoco_world.py` reads it.

use std::path::Path;

use serde_json::{Value, json};
use servodance_runtime::physics::{ServoLoop, StandingTrial, TrialOptions, TrialReport};
use servodance_runtime::robot::Robot;
use servodance_types::{LinkMotion, MotionFrame, Placement, RigidLink};

/// Dances `frames` and writes links, servos, commands and what became of the robot.
pub fn dump(
    robot: &Robot,
    options: TrialOptions,
    frames: &[MotionFrame],
    path: &Path,
) -> anyhow::Result<TrialReport> {
    let trial = StandingTrial::new(robot, options)?;
    let links: Vec<Value> = trial.links().iter().map(link).collect();
    let servos: Vec<Value> = trial.servos().iter().map(servo).collect();
    let (mut cycles, mut start, mut steps, mut dt_s) = (Vec::new(), None, 0, 0.0);
    let report = trial.run(frames, |_, commands, world| {
        let root = world.root();
        let first = start.is_none();
        let start = start.get_or_insert(root);
        if first {
            start.at_m = world.start_m();
            dt_s = world.dt_s();
            steps = (robot.period_s() / dt_s).round() as usize;
        }
        let up = root.rotation[2];
        cycles.push(json!({
            "commands": commands,
            "tilt": [up[0].atan2(up[2]), up[1].atan2(up[2])],
            "load_n": world.mean_foot_force_n(),
        }));
    })?;
    let world = &options.world;
    let text = json!({
        "links": links,
        "servos": servos,
        "world": {"friction": world.friction, "tilt_rad": world.tilt_rad, "dt_s": dt_s},
        "start": start.as_ref().map(placement),
        "period_s": robot.period_s(),
        "steps": steps,
        "push_ns": options.push_ns,
        "push_at": StandingTrial::push_cycle(frames.len(), robot.period_s()),
        "fell_s": report.fell_s,
        "cycles": cycles,
    });
    std::fs::write(path, text.to_string())?;
    Ok(report)
}

fn placement(at: &Placement) -> Value {
    json!({"rotation": at.rotation, "at_m": at.at_m})
}

fn servo(servo: &ServoLoop) -> Value {
    json!({
        "kp": servo.kp,
        "damping_nm_s": servo.damping_nm_s,
        "limit_nm": servo.limit_nm,
        "armature_kg_m2": servo.mechanics.armature_kg_m2,
        "friction_nm": servo.mechanics.friction_nm,
        "play_rad": servo.mechanics.play_rad,
    })
}

fn link(link: &RigidLink) -> Value {
    let motion = match link.motion {
        LinkMotion::Fixed => json!("Fixed"),
        LinkMotion::Revolute(axis) => json!({"Revolute": axis}),
        LinkMotion::Prismatic(axis) => json!({"Prismatic": axis}),
    };
    let drive = link
        .drive
        .map(|drive| json!({"joint": drive.joint, "scale": drive.scale, "offset": drive.offset}));
    let touch: Vec<Value> = link
        .touch
        .iter()
        .map(|point| json!({"at_m": point.at_m, "radius_m": point.radius_m, "foot": point.foot}))
        .collect();
    json!({
        "name": link.name,
        "parent": link.parent,
        "origin": placement(&link.origin),
        "motion": motion,
        "drive": drive,
        "mass_kg": link.mass_kg,
        "com_m": link.com_m,
        "inertia_kg_m2": link.inertia_kg_m2,
        "touch": touch,
    })
}
