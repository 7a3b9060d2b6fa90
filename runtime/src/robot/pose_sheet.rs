//! A picture of robots in four poses beside the human in the same: what a robot makes of
//! rest, arms out, arms up and bent knees, to see at a glance that its parts are right.

use crate::robot::Robot;
use crate::robot::meshes::{Meshes, SurfacePoint};
use crate::telemetry::picture::robot_figure::meshed_figure;
use crate::telemetry::picture::{ContactSheet, PoseRow, StickFigure};
use servodance_model::motion::skeleton::BONE_LENGTH_M;
use servodance_types::BodyJoint::{self, *};
use servodance_types::{FRAME_RATE_HZ, JOINT_COUNT, MotionFrame};

const POSES: [&str; 4] = ["rest", "arms out", "arms up", "knees bent"];
/// So long a pose is held, seconds: every joint has arrived.
const HELD_S: f64 = 4.0;
/// Height and width of a figure in its cell are drawn alike up to this ratio.
const WIDEST: f64 = 1.5;
/// Points that a robot's meshes are drawn with.
const DOTS: usize = 6000;
/// Letters of a label.
const LABEL: usize = 32;

/// The picture of the robots, a row each, as PNG bytes. Fails where a robot cannot be
/// retargeted to.
pub fn pose_sheet(robots: &[Robot]) -> anyhow::Result<Vec<u8>> {
    let rows: anyhow::Result<Vec<PoseRow>> = robots.iter().map(row).collect();
    ContactSheet {
        title: "the human and the robot in the same pose".into(),
        subtitle: format!("{}; left is orange, right is blue", POSES.join(", ")),
        bars: None,
        rows: rows?,
    }
    .png()
}

fn row(robot: &Robot) -> anyhow::Result<PoseRow> {
    let humans: Vec<MotionFrame> = (0..POSES.len()).map(human).collect();
    let model = robot.retargeter()?.model().clone();
    let surface = Meshes::load(robot, &model).surface(DOTS);
    let mut shown = Vec::new();
    for human in &humans {
        shown.push(held(robot, human, &surface)?);
    }
    let tall = shown
        .iter()
        .map(StickFigure::extent_m)
        .fold([0.0_f64; 2], |most, extent| [most[0].max(extent[0]), most[1].max(extent[1])]);
    let height_m = tall[0].max(tall[1] / WIDEST).max(1e-3);
    let mut figures = Vec::new();
    for (human, mut robot) in humans.iter().zip(shown) {
        robot.height_m = height_m;
        figures.extend([StickFigure::dancer(&human.positions), robot]);
    }
    let config = &robot.retarget;
    let cut = |text: String| text.chars().take(LABEL).collect::<String>();
    Ok(PoseRow {
        label: vec![
            cut(robot.name.clone()),
            format!("{}, {} servos", config.kind.name(), robot.servos.len()),
            format!("forward {}, up {}", config.forward, config.up),
            cut(format!("head: {}", config.body.head.as_deref().unwrap_or("none"))),
            cut(format!("left hand: {}", config.body.left_hand.as_deref().unwrap_or("none"))),
            cut(format!("left sole: {}", config.body.left_sole.as_deref().unwrap_or("none"))),
        ],
        figures,
    })
}

/// The robot after it has seen the human hold a pose.
fn held(
    robot: &Robot,
    human: &MotionFrame,
    surface: &[SurfacePoint],
) -> anyhow::Result<StickFigure> {
    let mut retargeter = robot.retargeter()?;
    let mut positions = retargeter.rest().to_vec();
    let ahead_s = retargeter.lookahead_s() + HELD_S;
    for frame in 0..=(ahead_s * FRAME_RATE_HZ) as usize {
        retargeter.push(&MotionFrame { time_s: frame as f64 / FRAME_RATE_HZ, ..*human });
    }
    for cycle in 0..(HELD_S * robot.control_hz) as usize {
        retargeter.next(cycle as f64 * robot.period_s(), &mut positions)?;
    }
    let root = retargeter.world_from_root(&positions);
    Ok(meshed_figure(retargeter.model(), &root, &positions, surface))
}

/// The human in one of the [`POSES`]: x left, y up, z forward, metres.
pub(crate) fn human(pose: usize) -> MotionFrame {
    let (arm, knee, shank) = match pose {
        1 => ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, -1.0, 0.0]),
        2 => ([0.25, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, -1.0, 0.0]),
        3 => ([0.15, -1.0, 0.0], [0.0, -0.85, 0.55], [0.0, -0.85, -0.55]),
        _ => ([0.15, -1.0, 0.0], [0.0, -1.0, 0.0], [0.0, -1.0, 0.0]),
    };
    let way = |joint: BodyJoint| -> [f64; 3] {
        match joint {
            LeftHip | RightHip => [0.6, -0.8, 0.0],
            LeftKnee | RightKnee => knee,
            LeftAnkle | RightAnkle => shank,
            LeftFoot | RightFoot => [0.0, -0.3, 0.95],
            LeftCollar | RightCollar => [0.8, 0.6, 0.0],
            LeftShoulder | RightShoulder => [1.0, 0.0, 0.0],
            LeftElbow | RightElbow | LeftWrist | RightWrist => arm,
            _ => [0.0, 1.0, 0.0],
        }
    };
    let mut positions = [[0.0_f32; 3]; JOINT_COUNT];
    for joint in BodyJoint::ALL {
        let Some(parent) = joint.parent() else { continue };
        let [x, y, z] = way(joint);
        let side = if joint.name().starts_with("right") { -1.0 } else { 1.0 };
        let length = BONE_LENGTH_M[joint as usize] / (x * x + y * y + z * z).sqrt();
        let from = positions[parent as usize];
        positions[joint as usize] = [
            from[0] + (x * side * length) as f32,
            from[1] + (y * length) as f32,
            from[2] + (z * length) as f32,
        ];
    }
    let lowest = positions.iter().map(|at| at[1]).fold(f32::INFINITY, f32::min);
    positions.iter_mut().for_each(|at| at[1] -= lowest);
    MotionFrame { time_s: 0.0, positions, contacts: Default::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raised_arms_of_the_human_are_raised_arms_of_the_robot() {
        let robot = Robot::load("torso13").unwrap();
        let [rest, up] = [0, 2].map(|pose| held(&robot, &human(pose), &[]).unwrap());
        let highest = |figure: &StickFigure| {
            figure.limbs.iter().map(|limb| limb.to[2]).fold(f64::NEG_INFINITY, f64::max)
        };
        assert!(highest(&up) > highest(&rest) + 0.1, "{} {}", highest(&up), highest(&rest));
        let png = pose_sheet(&[robot]).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
    }
}
