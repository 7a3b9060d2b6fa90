//! A robot, a dancer and a judge that knows nothing of the solver.

use std::f64::consts::TAU;

use servodance_retarget::nalgebra::{Rotation3, Vector3};
use servodance_retarget::{RetargetConfig, Retargeter};
use servodance_types::BodyJoint::{self, *};
use servodance_types::{FRAME_RATE_HZ, JOINT_COUNT, JointLimits, MotionFrame};

pub const CONTROL_HZ: f64 = 100.0;

/// A robot file's parts.
pub struct Robot {
    pub urdf: &'static str,
    pub config: RetargetConfig,
    pub joints: Vec<(String, JointLimits)>,
}

impl Robot {
    pub fn op3() -> Self {
        Self::read(
            include_str!("../../../configs/op3.toml"),
            include_str!("../../../configs/op3.urdf"),
        )
    }

    /// Every robot of `configs/`, by name.
    pub fn all() -> [(&'static str, Self); 4] {
        [
            ("op3", Self::op3()),
            (
                "torso13",
                Self::read(
                    include_str!("../../../configs/torso13.toml"),
                    include_str!("../../../configs/torso13.urdf"),
                ),
            ),
            (
                "neck",
                Self::read(
                    include_str!("../../../configs/neck.toml"),
                    include_str!("../../../configs/neck.urdf"),
                ),
            ),
            (
                "lite22",
                Self::read(
                    include_str!("../../../configs/lite22.toml"),
                    include_str!("../../../configs/lite22.urdf"),
                ),
            ),
        ]
    }

    pub fn read(toml: &str, urdf: &'static str) -> Self {
        let file: toml::Table = toml.parse().expect("robot file");
        let joints = file["joint"].as_array().expect("joints");
        let limits = |joint: &toml::Value| {
            let degrees = |key: &str| joint[key].as_float().expect("a number").to_radians();
            JointLimits {
                lower_rad: degrees("lower_deg"),
                upper_rad: degrees("upper_deg"),
                velocity_rad_s: degrees("velocity_deg_s"),
                acceleration_rad_s2: degrees("acceleration_deg_s2"),
            }
        };
        Self {
            urdf,
            config: file["retarget"].clone().try_into().expect("[retarget]"),
            joints: joints
                .iter()
                .map(|joint| (joint["name"].as_str().expect("a name").into(), limits(joint)))
                .collect(),
        }
    }

    pub fn retargeter(&self) -> Retargeter {
        self.retargeter_at(CONTROL_HZ)
    }

    pub fn retargeter_at(&self, control_hz: f64) -> Retargeter {
        Retargeter::new(self.urdf, &self.config, &self.joints, control_hz).expect("usable")
    }

    /// The jerk limit that the configuration promises.
    pub fn jerk_rad_s3(&self, joint: usize) -> f64 {
        let (name, limits) = &self.joints[joint];
        match self.config.jerk_deg_s3.get(name) {
            Some(degrees) => degrees.to_radians(),
            None => limits.acceleration_rad_s2 / self.config.jerk_rise_s,
        }
    }

    pub fn limits(&self) -> Vec<JointLimits> {
        self.joints.iter().map(|(_, limits)| *limits).collect()
    }
}

/// Positions of all control cycles, three at rest before the first.
pub fn follow(robot: &mut Retargeter, frames: &[MotionFrame]) -> Vec<Vec<f64>> {
    follow_at(CONTROL_HZ, robot, frames, |_| ())
}

/// The same at another rate; `each` sees the robot after every cycle.
pub fn follow_at(
    control_hz: f64,
    robot: &mut Retargeter,
    frames: &[MotionFrame],
    mut each: impl FnMut(&Retargeter),
) -> Vec<Vec<f64>> {
    let mut out = robot.rest().to_vec();
    let mut track = vec![out.clone(); 3];
    let mut waiting = frames.iter().peekable();
    let cycles = (frames.len() as f64 / FRAME_RATE_HZ * control_hz) as usize;
    for cycle in 0..cycles {
        let time_s = cycle as f64 / control_hz;
        // By count, not by time: hostile frames carry hostile times.
        let due = ((time_s + robot.lookahead_s()) * FRAME_RATE_HZ + 1e-9) as usize + 1;
        while frames.len() - waiting.len() < due.min(frames.len()) {
            robot.push(waiting.next().expect("counted"));
        }
        robot.next(time_s, &mut out).expect("right length");
        each(robot);
        track.push(out.clone());
    }
    track
}

/// Limits broken by a track, by their definition alone: positions, first, second
/// and third differences.
pub fn violations(track: &[Vec<f64>], robot: &Robot) -> [usize; 4] {
    violations_at(CONTROL_HZ, track, robot)
}

pub fn violations_at(control_hz: f64, track: &[Vec<f64>], robot: &Robot) -> [usize; 4] {
    let mut broken = [0; 4];
    for (joint, limit) in robot.limits().iter().enumerate() {
        let p: Vec<f64> = track.iter().map(|row| row[joint]).collect();
        let inside = limit.lower_rad - 1e-9..=limit.upper_rad + 1e-9;
        broken[0] += p.iter().filter(|p| !inside.contains(p)).count();
        let most = [limit.velocity_rad_s, limit.acceleration_rad_s2, robot.jerk_rad_s3(joint)];
        let mut rate = p;
        for (broken, most) in broken[1..].iter_mut().zip(most) {
            rate = rate.windows(2).map(|r| (r[1] - r[0]) * control_hz).collect();
            // NaN is not allowed, either.
            *broken += rate.iter().filter(|r| r.is_nan() || r.abs() > most).count();
        }
    }
    broken
}

/// Bone directions of a dancer in robot axes (x forward, y left, z up).
#[derive(Clone, Copy)]
pub struct Pose {
    pub pelvis: Vector3<f64>,
    pub yaw: f64,
    pub upper_arm: [Vector3<f64>; 2],
    pub forearm: [Vector3<f64>; 2],
    /// Thigh and shank angle, forward and backward.
    pub knee: [f64; 2],
}

impl Pose {
    pub fn standing() -> Self {
        let down = -Vector3::z();
        Self {
            pelvis: Vector3::new(0.0, 0.0, 0.95),
            yaw: 0.0,
            upper_arm: [down; 2],
            forearm: [down; 2],
            knee: [0.1; 2],
        }
    }

    pub fn frame(&self, index: usize) -> MotionFrame {
        let mut points = [Vector3::zeros(); JOINT_COUNT];
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.yaw);
        let mut put = |joint: BodyJoint, from: BodyJoint, offset: Vector3<f64>| {
            points[joint as usize] = points[from as usize] + turn * offset;
        };
        let v = Vector3::new;
        put(Pelvis, Pelvis, turn.inverse() * self.pelvis);
        for (joint, from, up) in [
            (Spine1, Pelvis, 0.12),
            (Spine2, Spine1, 0.14),
            (Spine3, Spine2, 0.06),
            (Neck, Spine3, 0.21),
            (Head, Neck, 0.1),
        ] {
            put(joint, from, v(0.0, 0.0, up));
        }
        let sides = [
            (
                1.0,
                [LeftHip, LeftKnee, LeftAnkle, LeftFoot],
                [LeftCollar, LeftShoulder, LeftElbow, LeftWrist],
            ),
            (
                -1.0,
                [RightHip, RightKnee, RightAnkle, RightFoot],
                [RightCollar, RightShoulder, RightElbow, RightWrist],
            ),
        ];
        for (side, (sign, leg, arm)) in sides.into_iter().enumerate() {
            let bend = self.knee[side];
            put(leg[0], Pelvis, v(0.0, sign * 0.09, -0.04));
            put(leg[1], leg[0], v(bend.sin(), 0.0, -bend.cos()) * 0.4);
            put(leg[2], leg[1], v(-bend.sin(), 0.0, -bend.cos()) * 0.42);
            put(leg[3], leg[2], v(0.12, 0.0, -0.06));
            put(arm[0], Spine3, v(0.0, sign * 0.06, 0.12));
            put(arm[1], arm[0], v(0.0, sign * 0.12, 0.02));
            put(arm[2], arm[1], self.upper_arm[side] * 0.26);
            put(arm[3], arm[2], self.forearm[side] * 0.25);
        }
        MotionFrame {
            time_s: index as f64 / FRAME_RATE_HZ,
            positions: points.map(|p| [p.y as f32, p.z as f32, p.x as f32]),
            contacts: Default::default(),
        }
    }
}

/// A dance at 110 beats a minute: arms swing out and up, knees bend, the body
/// sways and turns.
pub fn dance_pose(time_s: f64) -> Pose {
    let beat = TAU * time_s * 110.0 / 60.0;
    let slow = beat / 4.0;
    let mut pose = Pose::standing();
    let bend = 0.35 - 0.1 * beat.cos();
    pose.knee = [bend; 2];
    pose.pelvis = Vector3::new(0.0, 0.05 * (beat / 2.0).sin(), 0.04 + 0.06 + 0.82 * bend.cos());
    pose.yaw = 0.3 * slow.sin();
    for (side, sign) in [(0, 1.0), (1, -1.0)] {
        let lift = 0.2 + 0.7 * (slow + sign * 0.8).sin();
        let ahead = 0.5 * (beat / 2.0 + sign).sin();
        let upper = Vector3::new(ahead.sin(), sign * lift.cos(), lift.sin() * ahead.cos());
        pose.upper_arm[side] = upper.normalize();
        let fore = lift + 0.5 * (beat / 2.0).sin();
        let direction = Vector3::new(ahead.sin(), sign * fore.cos(), fore.sin());
        pose.forearm[side] = direction.normalize();
    }
    pose
}

pub fn dance(seconds: f64) -> Vec<MotionFrame> {
    (0..(seconds * FRAME_RATE_HZ) as usize)
        .map(|k| dance_pose(k as f64 / FRAME_RATE_HZ).frame(k))
        .collect()
}
