//! The control cycle does not allocate: counted by the allocator itself.

use servodance_retarget::{RetargetConfig, Retargeter};
use servodance_types::{JointLimits, MotionFrame};

fn joints(toml: &str) -> (RetargetConfig, Vec<(String, JointLimits)>) {
    let file: toml::Table = toml.parse().expect("robot file");
    let joints = file["joint"].as_array().expect("joints").iter();
    let joints = joints.map(|joint| {
        let degrees = |key: &str| joint[key].as_float().expect("a number").to_radians();
        let limits = JointLimits {
            lower_rad: degrees("lower_deg"),
            upper_rad: degrees("upper_deg"),
            velocity_rad_s: degrees("velocity_deg_s"),
            acceleration_rad_s2: degrees("acceleration_deg_s2"),
        };
        (joint["name"].as_str().expect("a name").to_string(), limits)
    });
    let config = file["retarget"].clone().try_into().expect("[retarget]");
    (config, joints.collect())
}

#[test]
fn the_control_cycle_does_not_allocate() {
    let (config, joints) = joints(include_str!("../../configs/op3.toml"));
    let urdf = include_str!("../../configs/op3.urdf");
    let mut robot = Retargeter::new(urdf, &config, &joints, 100.0).expect("usable");
    let mut out = robot.rest().to_vec();
    let counted = allocation_counter::measure(|| {
        for cycle in 0..2000_u32 {
            if cycle % 5 == 0 {
                let swing = (f64::from(cycle) * 0.05).sin() as f32;
                let mut frame = MotionFrame {
                    time_s: f64::from(cycle) * 0.01,
                    positions: [[0.0; 3]; 22],
                    contacts: Default::default(),
                };
                for (joint, point) in frame.positions.iter_mut().enumerate() {
                    let side = if joint % 2 == 0 { -1.0 } else { 1.0 };
                    *point = [side * 0.1 * joint as f32, 1.0 - 0.1 * joint as f32, swing];
                }
                robot.push(&frame);
            }
            robot.next(f64::from(cycle) * 0.01, &mut out).expect("length");
        }
    });
    assert_eq!(counted.count_total, 0);
}
