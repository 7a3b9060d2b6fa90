//! Kinds of body, made from parts: each is known again and shows a dance in its own way;
//! what cannot show one is refused.

use crate::rigs::Rig;
use servodance_retarget::{BodyKind, DraftOptions, RobotModel, guess_body, no_meshes};
use servodance_runtime::physics::TrialDance;
use servodance_runtime::robot::{Robot, new_robot};
use servodance_training::choreography::trial_dance;

const X: &str = "<axis xyz=\"1 0 0\"/>";
const Y: &str = "<axis xyz=\"0 1 0\"/>";
const Z: &str = "<axis xyz=\"0 0 1\"/>";

/// A pan, a lift and an elbow, bent as table arms are.
fn table_arm() -> Rig {
    Rig::new()
        .joint("revolute", "pan", "base", "0 0 0.05", Z)
        .joint("revolute", "lift", "pan_link", "0 0 0.05", Y)
        .joint("revolute", "elbow", "lift_link", "0 0 0.2", Y)
        .joint("revolute", "wrist", "elbow_link", "0.15 0 0", Y)
        .joint("fixed", "gripper", "wrist_link", "0.1 0 0", "")
}

/// Four legs of three joints; `names` of the corners front left, front right, hind left,
/// hind right.
fn four_legged(names: [&str; 4]) -> Rig {
    legs_at(names, [0.2, 0.1])
}

/// The same with legs that begin so far ahead and aside of the middle, metres.
fn legs_at(names: [&str; 4], [ahead, aside]: [f64; 2]) -> Rig {
    let mut rig = Rig::new();
    let corners = [(ahead, aside), (ahead, -aside), (-ahead, aside), (-ahead, -aside)];
    for (name, (x, y)) in names.iter().zip(corners) {
        let part = |part: &str| format!("{name}_{part}");
        let link = |part: &str| format!("{name}_{part}_link");
        rig = rig
            .joint("revolute", &part("one"), "base", &format!("{x} {y} 0"), X)
            .joint("revolute", &part("two"), &link("one"), &format!("0 {} 0", y * 0.4), Y)
            .joint("revolute", &part("three"), &link("two"), "0 0 -0.2", Y)
            .joint("fixed", &part("end"), &link("three"), "0 0 -0.2", "");
    }
    rig
}

#[test]
fn a_lone_arm_leans_and_reaches() {
    let (robot, _, track, said) = table_arm().dance();
    assert_eq!(robot.retarget.kind, BodyKind::Arm, "{said:?}");
    let spans = crate::rigs::spans(&robot, &track);
    for joint in ["pan", "lift", "elbow"] {
        assert!(crate::rigs::moved(&spans, joint) > 0.1, "{joint}: {spans:?}");
    }
    // Its end stays over the table on which its base stands.
    let names: Vec<&str> = robot.servos.iter().map(|servo| servo.name.as_str()).collect();
    let model = RobotModel::new(&robot.urdf_xml, &names).unwrap();
    let end = model.link("gripper_link").unwrap();
    let lowest = track.iter().map(|row| model.link_poses(row)[end].translation.z);
    assert!(lowest.fold(f64::INFINITY, f64::min) > 0.0);
}

/// The feet stay where they are while the trunk moves over them.
fn stands_on_four(rig: Rig) {
    let (robot, _, track, said) = rig.dance();
    assert_eq!(robot.retarget.kind, BodyKind::Quadruped, "{said:?}");
    assert!(robot.retarget.stance.stands(), "{said:?}");
    let names: Vec<&str> = robot.servos.iter().map(|servo| servo.name.as_str()).collect();
    let model = RobotModel::new(&robot.urdf_xml, &names).unwrap();
    let retargeter = robot.retargeter().unwrap();
    let feet: Vec<usize> = ["a", "b", "c", "d"]
        .iter()
        .map(|corner| model.link(&format!("{corner}_end_link")))
        .map(|link| link.unwrap())
        .collect();
    let world = |row: &[f64]| {
        let root = retargeter.world_from_root(row);
        let poses = model.link_poses(row);
        let places = feet.iter().map(|&foot| (root * poses[foot]).translation.vector);
        (root.translation.vector, places.collect::<Vec<_>>())
    };
    let (root_at_rest, at_rest) = world(retargeter.rest());
    let (mut slid_m, mut moved_m) = (0.0_f64, 0.0_f64);
    for row in &track {
        let (root, places) = world(row);
        moved_m = moved_m.max((root - root_at_rest).norm());
        for (place, rest) in places.iter().zip(&at_rest) {
            slid_m = slid_m.max((place - rest).norm());
        }
    }
    assert!(moved_m > 0.02, "the trunk moved by {moved_m} m only");
    assert!(slid_m < 0.01, "a foot slid by {slid_m} m");
}

#[test]
fn four_legs_stand_while_the_trunk_moves() {
    stands_on_four(four_legged(["a", "b", "c", "d"]));
}

#[test]
fn corners_are_known_by_name_and_by_place() {
    let named = four_legged(["FL", "FR", "RL", "RR"]).urdf();
    let body = guess_body(&named, &no_meshes).unwrap();
    assert_eq!((body.kind, body.confidence), (BodyKind::Quadruped, "high"));
    // The same corners turned round: what is called front is front.
    let turned = guess_body(&four_legged(["RR", "RL", "FR", "FL"]).urdf(), &no_meshes).unwrap();
    assert_eq!((turned.forward, body.forward), ("-x", "x"));
    assert_eq!(turned.parts.left_hand.as_deref(), Some("FL_end_link"));
    assert_eq!(body.parts.right_sole.as_deref(), Some("RR_end_link"));
}

/// Drafted by trying how much of a dance it stands in the simulated world.
fn drafted_in_the_world(description: &str) -> Robot {
    let folder = tempfile::tempdir().unwrap();
    let urdf = folder.path().join("rig.urdf");
    std::fs::write(&urdf, description).unwrap();
    let out = folder.path().join("rig.toml");
    let dances = [TrialDance { clip: trial_dance(), wild: false }];
    new_robot(&urdf, &out, false, DraftOptions::default(), &trial_dance(), &dances).unwrap();
    Robot::load(&out.display().to_string()).unwrap()
}

#[test]
fn a_fallen_quadruped_is_not_drafted() {
    let robot = drafted_in_the_world(&four_legged(["a", "b", "c", "d"]).urdf());
    assert!(robot.retarget.stance.stands(), "it falls in its world");
}

/// As Mors and Pupper: with all of its movement it would slip or tip, with a part it dances.
#[test]
fn a_quadruped_that_cannot_stand_all_dances_less() {
    let robot = drafted_in_the_world(&legs_at(["a", "b", "c", "d"], [0.12, 0.04]).urdf());
    assert!(robot.retarget.stance.stands(), "it falls in its world");
    let torso = robot.retarget.gain.torso;
    assert!((0.1..0.9).contains(&torso), "{torso} of the trunk's movement");
}

/// Two legs below a mast of so many metres.
fn legs_below_a_mast(height_m: f64) -> Rig {
    let mut rig = Rig::new().joint("fixed", "mast", "base", &format!("0 0 {height_m}"), "");
    for (side, y) in [("left", 0.08), ("right", -0.08)] {
        let part = |part: &str| format!("{side}_{part}");
        let link = |part: &str| format!("{side}_{part}_link");
        rig = rig
            .joint("revolute", &part("hip_yaw"), "base", &format!("0 {y} 0"), Z)
            .joint("revolute", &part("hip_roll"), &link("hip_yaw"), "0 0 0", X)
            .joint("revolute", &part("hip_pitch"), &link("hip_roll"), "0 0 0", Y)
            .joint("revolute", &part("knee"), &link("hip_pitch"), "0 0 -0.2", Y)
            .joint("revolute", &part("ankle_pitch"), &link("knee"), "0 0 -0.2", Y)
            .joint("revolute", &part("ankle_roll"), &link("ankle_pitch"), "0 0 0", X)
            .joint("fixed", &part("foot"), &link("ankle_roll"), "0 0 -0.04", "");
    }
    rig
}

#[test]
fn legs_alone_that_leave_no_margin_dance_a_little() {
    let robot = drafted_in_the_world(&legs_below_a_mast(3.8).urdf());
    assert!(robot.retarget.stance.stands(), "it falls in its world");
    let torso = robot.retarget.gain.torso;
    assert!((0.1..0.2).contains(&torso), "{torso} of the pelvis's movement");
}

#[test]
fn a_body_without_masses_is_hung() {
    let rig = legs_below_a_mast(0.2).urdf();
    assert!(drafted_in_the_world(&rig).retarget.stance.stands(), "with masses it stands");
    let robot = drafted_in_the_world(&rig.replace("mass value=\"0.2\"", "mass value=\"0\""));
    assert!(!robot.retarget.stance.stands(), "what it stands cannot be tried");
}

#[test]
fn antennas_make_a_head() {
    let rig = Rig::new()
        .joint("revolute", "yaw", "base", "0 0 0.1", Z)
        .joint("revolute", "left_antenna", "yaw_link", "0 0.05 0.1", X)
        .joint("fixed", "left_tip", "left_antenna_link", "0 0 0.1", "")
        .joint("revolute", "right_antenna", "yaw_link", "0 -0.05 0.1", X)
        .joint("fixed", "right_tip", "right_antenna_link", "0 0 0.1", "");
    let (robot, _, track, said) = rig.dance();
    assert_eq!(robot.retarget.kind, BodyKind::Head, "{said:?}");
    let spans = crate::rigs::spans(&robot, &track);
    assert!(crate::rigs::moved(&spans, "left_antenna") > 0.1, "{spans:?}");
}

/// The base's heading at each moment of a dance, radians.
fn headings(robot: &Robot, track: &[Vec<f64>]) -> Vec<f64> {
    let retargeter = robot.retargeter().unwrap();
    let heading = |row: &Vec<f64>| retargeter.world_from_root(row).rotation.euler_angles().2;
    track.iter().map(heading).collect()
}

fn span(values: &[f64]) -> f64 {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
}

#[test]
fn a_base_on_wheels_turns_on_the_spot() {
    let cart = Rig::new().wheel("wheel_left", "0 0.1").wheel("wheel_right", "0 -0.1");
    let cart = cart.joint("continuous", "caster_wheel", "base", "-0.1 0 -0.1", Y);
    let (robot, _, track, said) = cart.dance();
    assert_eq!(robot.retarget.kind, BodyKind::Wheeled, "{said:?}");
    assert_eq!(robot.servos.len(), 2, "{said:?}");
    for row in &track {
        assert!((row[0] + row[1]).abs() < 1e-6, "it rolls away: {row:?}");
    }
    // 0.1 m from the middle on a radius of 0.05 m: a wheel turns twice as far as the base.
    let turned = span(&headings(&robot, &track));
    let rolled = span(&track.iter().map(|row| row[1]).collect::<Vec<f64>>());
    assert!(turned > 0.2, "it turned by {turned} rad only");
    assert!((rolled - 2.0 * turned).abs() < 1e-6, "{rolled} {turned}");
}

#[test]
fn wheels_below_a_body_turn_where_they_are_given() {
    let rig = || {
        let pan = Rig::new().joint("revolute", "head_pan", "base", "0 0 0.3", Z);
        let tilt = pan.joint("revolute", "head_tilt", "head_pan_link", "0 0 0.05", Y);
        tilt.wheel("wheel_left", "0 0.1").wheel("wheel_right", "0 -0.1")
    };
    let (robot, _, track, said) = rig().dance();
    assert_eq!((robot.retarget.kind, robot.servos.len()), (BodyKind::Head, 2), "{said:?}");
    assert!(said.iter().any(|line| line.contains("--wheels")), "{said:?}");
    assert!(span(&headings(&robot, &track)) < 1e-12);
    let options = DraftOptions { wheels: true, ..Default::default() };
    let (robot, _, track, _) = rig().dance_as(options);
    assert_eq!((robot.retarget.kind, robot.servos.len()), (BodyKind::Head, 4));
    assert!(span(&headings(&robot, &track)) > 0.2);
    let spans = crate::rigs::spans(&robot, &track);
    assert!(crate::rigs::moved(&spans, "head_pan") > 0.05, "{spans:?}");
}

#[test]
fn wheels_start_where_they_are() {
    let cart = Rig::new().wheel("wheel_left", "0 0.1").wheel("wheel_right", "0 -0.1");
    let (robot, ..) = cart.dance();
    let mut retargeter = robot.retargeter().unwrap();
    retargeter.seed(&[1.2, -0.7]).unwrap();
    assert_eq!(retargeter.rest(), [1.2, -0.7]);
    // Too near to the end of their range to turn the base to both sides, they roll a little.
    let limits = robot.servos[0].limits;
    retargeter.seed(&[limits.upper_rad - 0.01, 0.0]).unwrap();
    let room = limits.upper_rad - retargeter.rest()[0];
    assert!(room > 1.0 && room < 1.5, "{room}");
}

#[test]
fn what_cannot_show_a_dance_is_refused_with_the_reason() {
    let mut fingers = Rig::new();
    for finger in ["a", "b", "c", "d"] {
        let at = format!("0 {} 0", f64::from(finger.as_bytes()[0]) * 0.02);
        let link = format!("{finger}_one_link");
        fingers = fingers.joint("revolute", &format!("{finger}_one"), "base", &at, Y).joint(
            "revolute",
            &format!("{finger}_two"),
            &link,
            "0 0 0.04",
            Y,
        );
    }
    let cart = Rig::new().joint("continuous", "wheel_left", "base", "0 0.2 0", Y).joint(
        "continuous",
        "wheel_right",
        "base",
        "0 -0.2 0",
        Y,
    );
    let folder = tempfile::tempdir().unwrap();
    let unicycle = Rig::new().wheel("wheel", "0 0");
    let why = ["can show a dance", "can show a dance", "no shape tells the radius"];
    for (rig, why) in [fingers, unicycle, cart].into_iter().zip(why) {
        let urdf = folder.path().join("thing.urdf");
        std::fs::write(&urdf, rig.urdf()).unwrap();
        let out = folder.path().join("thing.toml");
        let refused = new_robot(&urdf, &out, false, DraftOptions::default(), &trial_dance(), &[])
            .unwrap_err();
        assert!(refused.to_string().contains(why), "{refused}");
        assert!(!out.exists());
    }
    // Whoever says what it is decides, but must be able to.
    let urdf = folder.path().join("arm.urdf");
    std::fs::write(&urdf, table_arm().urdf()).unwrap();
    let out = folder.path().join("arm.toml");
    let options = DraftOptions { kind: Some(BodyKind::Quadruped), ..Default::default() };
    let refused = new_robot(&urdf, &out, false, options, &trial_dance(), &[]).unwrap_err();
    assert!(refused.to_string().contains("it is no quadruped"), "{refused}");
}

#[test]
fn rods_loops_and_joints_without_a_motor_rest() {
    let model = r#"<mujoco><worldbody><body name="base">
        <body name="head"><joint name="turn" axis="0 0 1" range="-60 60"/>
          <body name="lamp" pos="0 0 .1"><joint name="rod" axis="0 1 0"/></body></body>
        <body name="crank" pos=".1 0 0"><joint name="push" axis="0 1 0" range="-60 60"/>
          <body name="link" pos="0 0 .1"><joint name="swing" axis="0 1 0" range="-60 60"/></body></body>
      </body></worldbody>
      <actuator><position joint="turn"/><position joint="push"/><position joint="swing"/></actuator>
      <equality><connect body1="link" body2="base" anchor="0 0 0"/></equality></mujoco>"#;
    let (urdf, found) = servodance_retarget::urdf_from_mjcf(model).unwrap();
    for joint in ["rod", "push", "swing"] {
        let fixed = format!("name=\"{joint}\" type=\"fixed\"");
        assert!(urdf.contains(&fixed), "{joint}: {urdf}");
        assert!(found.iter().any(|f| f.subject == joint || f.message.contains(joint)), "{found:?}");
    }
    assert!(urdf.contains("name=\"turn\" type=\"revolute\""), "{urdf}");
}
