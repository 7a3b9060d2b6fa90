//! Robots made to look like public ones whose names misled (docs/measurements/robots.md): a
//! letter that is no side, a part called after its neighbour, a wheel called a leg.

use crate::rigs::Rig;
use servodance_retarget::{BodyGuess, BodyKind, guess_body, no_meshes};

const X: &str = "<axis xyz=\"1 0 0\"/>";
const Y: &str = "<axis xyz=\"0 1 0\"/>";
const Z: &str = "<axis xyz=\"0 0 1\"/>";

fn guess(text: &str) -> BodyGuess {
    guess_body(text, &no_meshes).expect("something that can dance")
}

/// One joint after the other, each called `name` and its number from 1.
pub fn chain(mut rig: Rig, carrier: &str, name: &str, joints: &[(&str, &str)]) -> Rig {
    let mut last = carrier.to_owned();
    for (index, (at, axis)) in joints.iter().enumerate() {
        let joint = format!("{name}{}", index + 1);
        rig = rig.joint("revolute", &joint, &last, at, axis);
        last = format!("{joint}_link");
    }
    rig
}

/// As Vega: the `l1` of `R_arm_l1` counts links, and `L_rf_j1` is a ring finger.
#[test]
fn a_letter_behind_a_side_is_another() {
    let mut rig = Rig::new().joint("revolute", "head_j1", "base", "0 0 0.5", Z);
    for (side, y) in [("L", 0.2), ("R", -0.2)] {
        let at = format!("0 {y} 0.4");
        let arm = [
            (at.as_str(), Y),
            ("0 0 0", Z),
            ("0.17 0 0", X),
            ("0.11 0 0", Y),
            ("0.2 0 0", X),
            ("0.1 0 0", Y),
        ];
        rig = chain(rig, "base", &format!("{side}_arm_l"), &arm);
        for (finger, across) in [("ff", 0.03), ("mf", 0.01), ("rf", -0.01), ("lf", -0.03)] {
            let at = format!("0.1 {across} 0");
            let joints = [(at.as_str(), Y), ("0.03 0 0", Y)];
            rig =
                chain(rig, &format!("{side}_arm_l6_link"), &format!("{side}_{finger}_j"), &joints);
        }
    }
    let body = guess(&rig.urdf());
    assert_eq!((body.kind, body.forward, body.up), (BodyKind::UpperBody, "x", "z"));
    assert_eq!(body.parts.left_elbow.as_deref(), Some("L_arm_l4_link"));
    assert_eq!(body.parts.right_elbow.as_deref(), Some("R_arm_l4_link"));
    assert_eq!(body.parts.right_shoulder.as_deref(), Some("R_arm_l2_link"));
}

/// As Wolfgang in a student's hands: what the hip turns is called `l_knee`.
#[test]
fn the_knee_is_what_a_joint_called_knee_turns() {
    let mut rig = Rig::new();
    for (side, letter, y) in [("L", "l", 0.06), ("R", "r", -0.06)] {
        let joint = |part: &str| format!("{side}{part}");
        let link = |part: &str| format!("{side}{part}_link");
        rig = rig
            .joint("revolute", &joint("HipYaw"), "base", &format!("0 {y} 0"), Z)
            .joint("revolute", &joint("HipRoll"), &link("HipYaw"), "-0.04 0 -0.04", X)
            .joint("revolute", &joint("HipPitch"), &link("HipRoll"), "0.06 0 0", Y)
            .joint("revolute", &joint("Knee"), &link("HipPitch"), "0 0 -0.17", Y)
            .joint("revolute", &joint("AnklePitch"), &link("Knee"), "0 0 -0.17", Y)
            .joint("revolute", &joint("AnkleRoll"), &link("AnklePitch"), "-0.06 0 0", X)
            .renamed(&link("HipPitch"), &format!("{letter}_knee"))
            .renamed(&link("Knee"), &format!("lower_leg_{letter}"));
    }
    let body = guess(&rig.urdf());
    assert_eq!(body.kind, BodyKind::Biped);
    assert_eq!(body.parts.left_hip.as_deref(), Some("l_knee"));
    assert_eq!(body.parts.left_knee.as_deref(), Some("lower_leg_l"));
    assert_eq!(body.parts.right_knee.as_deref(), Some("lower_leg_r"));
}

/// As a kit's upper body on four Mecanum wheels, two of which count as the left leg.
#[test]
fn two_legs_of_one_joint_on_one_side_are_wheels() {
    let mut rig = Rig::new().joint("revolute", "HEAD_JOINT0", "base", "0 0 0.1", Z);
    for (side, y) in [("L", 0.05), ("R", -0.05)] {
        let at = format!("0 {y} 0.1");
        let arm = [(at.as_str(), Y), ("0 0 0", X), ("0 0 -0.05", Y), ("0 0 -0.05", Z)];
        rig = chain(rig, "base", &format!("{side}ARM_JOINT"), &arm);
        for (wheel, x) in [("0", 0.06), ("1", -0.06)] {
            let name = format!("{side}LEG_JOINT{wheel}");
            rig = rig.joint("continuous", &name, "base", &format!("{x} {y} -0.06"), Y);
        }
    }
    let body = guess(&rig.urdf());
    assert_eq!(body.kind, BodyKind::UpperBody);
    assert_eq!((body.parts.left_hip, body.parts.right_hip), (None, None));
}

/// As the planar walker of Gym: `leg` and `leg_left`.
#[test]
fn a_leg_without_a_side_is_the_other_leg() {
    let mut rig = Rig::new();
    for (side, y) in [("", -0.1), ("_left", 0.1)] {
        let name = |part: &str| format!("{part}{side}");
        let link = |part: &str| format!("{part}{side}_link");
        rig = rig
            .joint("revolute", &name("thigh"), "base", &format!("0 {y} 0"), Y)
            .joint("revolute", &name("leg"), &link("thigh"), "0 0 -0.4", Y)
            .joint("revolute", &name("foot"), &link("leg"), "0 0 -0.4", Y);
    }
    let body = guess(&rig.urdf());
    assert_eq!((body.kind, body.forward), (BodyKind::Biped, "x"));
    assert_eq!(body.parts.head, None);
    assert_eq!(body.parts.left_knee.as_deref(), Some("leg_left_link"));
    assert_eq!(body.parts.right_knee.as_deref(), Some("leg_link"));
}

/// As a student's robot on wheels that are called nothing: two arms and no head.
#[test]
fn several_short_chains_alike_are_no_head() {
    let mut rig = Rig::new();
    for (side, y) in [("left", 0.2), ("right", -0.2)] {
        let at = format!("0 {y} 0.5");
        rig = chain(rig, "base", &format!("{side}_arm_"), &[(&at, Y), ("0 0 -0.2", Y)]);
    }
    for (index, at) in ["0.2 0.2 0", "0.2 -0.2 0", "-0.2 0.2 0", "-0.2 -0.2 0"].iter().enumerate() {
        rig = rig.joint("continuous", &format!("turn_{index}"), "base", at, Y);
    }
    let body = guess(&rig.urdf());
    assert_eq!((body.kind, body.parts.head), (BodyKind::UpperBody, None));
}

/// As a student's biped from Vietnam: the sides are at the ends of the words.
#[test]
fn sides_are_read_in_other_languages() {
    let mut rig = Rig::new();
    for (side, x) in [("trai", 0.11), ("phai", -0.11)] {
        let name = |part: &str| format!("{part}{side}");
        let link = |part: &str| format!("{part}{side}_link");
        rig = rig
            .joint("revolute", &name("eo"), "base", &format!("{x} 0 -0.03"), Z)
            .joint("revolute", &name("xoaychan"), &link("eo"), "0 0 -0.07", Y)
            .joint("revolute", &name("dui"), &link("xoaychan"), "0 0 -0.03", X)
            .joint("revolute", &name("ongchan"), &link("dui"), "0 0 -0.26", X)
            .joint("revolute", &name("banhxe"), &link("ongchan"), "0 0 -0.28", X);
    }
    let body = guess(&rig.urdf());
    assert_eq!((body.kind, body.forward), (BodyKind::Biped, "-y"));
    assert_eq!(body.parts.left_knee.as_deref(), Some("ongchantrai_link"));
    assert_eq!(body.parts.right_knee.as_deref(), Some("ongchanphai_link"));
}

/// As a student's Pupper: one hind leg is drawn where a front leg begins.
#[test]
fn a_leg_stands_at_the_corner_of_its_name() {
    let mut rig = Rig::new();
    for (leg, x, y) in
        [("LF", 0.07, 0.04), ("RF", 0.07, -0.04), ("LH", -0.13, 0.04), ("RH", 0.07, -0.04)]
    {
        let name = |part: &str| format!("{leg}_{part}");
        let link = |part: &str| format!("{leg}_{part}_link");
        let thigh = if leg == "RH" { "-0.17 -0.03 0" } else { "0.03 0 0" };
        rig = rig
            .joint("revolute", &name("HIP"), "base", &format!("{x} {y} 0"), X)
            .joint("revolute", &name("THIGH"), &link("HIP"), thigh, Y)
            .joint("revolute", &name("SHANK"), &link("THIGH"), "-0.03 0 -0.12", Y)
            .joint("fixed", &name("TOE"), &link("SHANK"), "0.03 0 -0.11", "");
    }
    let body = guess(&rig.urdf());
    assert_eq!((body.kind, body.forward), (BodyKind::Quadruped, "x"));
    assert_eq!(body.parts.right_sole.as_deref(), Some("RH_TOE_link"));
    assert_eq!(body.parts.right_hand.as_deref(), Some("RF_TOE_link"));
}

/// As a student's hexapod: left feet end 1.4 mm below right ones.
#[test]
fn six_legs_need_not_end_quite_level() {
    let mut rig = Rig::new();
    for (side, sign, down) in [("l", 1.0, -0.0126), ("r", -1.0, -0.0112)] {
        for (number, x) in [(1, 0.078), (2, 0.0), (3, -0.078)] {
            let name = |part: &str| format!("{part}_{side}{number}");
            let link = |part: &str| format!("{part}_{side}{number}_link");
            let at = |y: f64, z: f64| format!("0 {} {z}", sign * y);
            let hip = format!("{x} {} 0", sign * 0.06);
            rig = rig
                .joint("revolute", &name("coxa"), "base", &hip, Z)
                .joint("revolute", &name("femur"), &link("coxa"), &at(0.05, down), X)
                .joint("revolute", &name("tibia"), &link("femur"), &at(0.07, 0.0), X);
        }
    }
    let body = guess(&rig.urdf());
    assert_eq!(body.kind, BodyKind::Quadruped);
    assert_eq!(body.parts.left_hip.as_deref().map(|hip| hip.contains("_l3_")), Some(true));
    assert_eq!(body.parts.right_shoulder.as_deref().map(|top| top.contains("_r1_")), Some(true));
}

/// As a small palletizer: three joints, and no name says arm.
#[test]
fn three_joints_that_bend_twice_are_an_arm() {
    let joints = [("0 0 0.12", Z), ("0.03 0 0", Y), ("0 0 0.12", Y)];
    assert_eq!(guess(&chain(Rig::new(), "base", "joint", &joints).urdf()).kind, BodyKind::Arm);
    let neck = [("0 0 0.12", Z), ("0 0 0.03", Y), ("0 0 0.03", X)];
    assert_eq!(guess(&chain(Rig::new(), "base", "joint", &neck).urdf()).kind, BodyKind::Head);
}

/// As a MuJoCo model of TurtleBot3: a wheel and its joint share their name, and the motor
/// means the joint.
#[test]
fn a_body_and_its_joint_may_share_a_name() {
    let wheel = |side: &str, y: f64| {
        format!(
            "<body name=\"wheel_{side}\" pos=\"0 {y} 0.03\"><joint name=\"wheel_{side}\" \
             axis=\"0 1 0\"/><geom type=\"sphere\" size=\"0.03\"/></body>"
        )
    };
    let motor = |side: &str| format!("<velocity joint=\"wheel_{side}\"/>");
    let text = format!(
        "<mujoco><worldbody><body name=\"base\"><freejoint/><geom type=\"box\" size=\".1 .1 .02\"/>\
         {}{}</body></worldbody><actuator>{}{}</actuator></mujoco>",
        wheel("left", 0.08),
        wheel("right", -0.08),
        motor("left"),
        motor("right")
    );
    assert_eq!(guess(&text).kind, BodyKind::Wheeled);
}

/// As Vizzy: a shoulder and a wrist move by abduction, as hips do.
#[test]
fn a_shoulder_that_abducts_is_no_leg() {
    let mut rig = Rig::new().joint("revolute", "waist", "base", "0 0 0.5", Z);
    for (side, y) in [("l", 0.2), ("r", -0.2)] {
        let name = |part: &str| format!("{side}_{part}");
        let link = |part: &str| format!("{side}_{part}_link");
        rig = rig
            .joint("revolute", &name("shoulder_flection"), "waist_link", &format!("0 {y} 0.4"), Y)
            .joint("revolute", &name("shoulder_abduction"), &link("shoulder_flection"), "0 0 0", X)
            .joint("revolute", &name("elbow_flection"), &link("shoulder_abduction"), "0 0 -0.2", Y)
            .joint("revolute", &name("wrist_abduction"), &link("elbow_flection"), "0 0 -0.2", X);
    }
    let body = guess(&rig.urdf());
    assert_eq!((body.kind, body.parts.left_hip), (BodyKind::UpperBody, None));
    assert_eq!(body.parts.left_elbow.as_deref(), Some("l_elbow_flection_link"));
    assert_eq!(body.parts.right_shoulder.as_deref(), Some("r_shoulder_abduction_link"));
}

/// As a student's biped: the parts of its legs are called shoulder, thigh and bicep.
#[test]
fn a_leg_with_words_of_an_arm_is_no_arm_too() {
    let mut rig = Rig::new();
    for (side, y) in [("bl", 0.1), ("br", -0.1)] {
        let name = |part: &str| format!("{side}_{part}");
        rig = rig
            .joint("revolute", &name("shoulder_to_base"), "base", &format!("0 {y} -0.05"), X)
            .renamed(&name("shoulder_to_base_link"), &name("shoulder"))
            .joint("revolute", &name("thigh_to_shoulder"), &name("shoulder"), "0 0 -0.03", Y)
            .renamed(&name("thigh_to_shoulder_link"), &name("thigh"))
            .joint("revolute", &name("bicep_to_thigh"), &name("thigh"), "0 0 -0.15", Y)
            .renamed(&name("bicep_to_thigh_link"), &name("bicep"));
    }
    let body = guess(&rig.urdf());
    assert_eq!((body.kind, body.parts.left_shoulder), (BodyKind::Biped, None));
    assert_eq!(body.parts.right_knee.as_deref(), Some("br_bicep"));
}

/// As Agibot G1: `right_left_1` is the left finger of the right hand.
#[test]
fn fingers_of_both_sides_leave_the_arms_theirs() {
    let mut rig = Rig::new().joint("revolute", "head", "base", "0 0 0.5", Z);
    for (side, y) in [("left", 0.2), ("right", -0.2)] {
        let at = format!("0 {y} 0.4");
        let arm = [(at.as_str(), Y), ("0 0 0", X), ("0 0 -0.2", Y), ("0 0 -0.2", Z)];
        rig = chain(rig, "base", &format!("{side}_joint"), &arm);
        // The joint of one finger is called after the gripper.
        for (finger, joint, across) in [("left", "gripper", 0.03), ("right", "right_1", -0.03)] {
            let joint = format!("{side}_{joint}");
            rig = rig
                .joint(
                    "revolute",
                    &joint,
                    &format!("{side}_joint4_link"),
                    &format!("0 {across} 0"),
                    X,
                )
                .renamed(&format!("{joint}_link"), &format!("{side}_{finger}_1_link"));
        }
    }
    let body = guess(&rig.urdf());
    assert_eq!(body.kind, BodyKind::UpperBody);
    assert_eq!(body.parts.chest.as_deref(), Some("base"));
    assert_eq!(body.parts.left_elbow.as_deref(), Some("left_joint3_link"));
    assert_eq!(body.parts.right_elbow.as_deref(), Some("right_joint3_link"));
}

/// One arm says its side, the other one is called otherwise: they mirror each other.
#[test]
fn the_other_arm_is_where_the_first_is_mirrored() {
    let arm = |y: f64| [(format!("0 {y} 0.4"), Y), ("0 0 0".into(), X), ("0 0 -0.2".into(), Y)];
    let mut rig = Rig::new().joint("revolute", "head", "base", "0 0 0.5", Z);
    for (name, y) in [("left_arm", 0.2), ("second_boom", -0.2)] {
        let joints = arm(y);
        let joints = joints.each_ref().map(|(at, axis)| (at.as_str(), *axis));
        rig = chain(rig, "base", name, &joints);
    }
    let body = guess(&rig.urdf());
    assert_eq!(body.kind, BodyKind::UpperBody);
    assert_eq!(body.parts.right_elbow.as_deref(), Some("second_boom3_link"));
}

/// Sides in two or three letters, as makers of robots and of ships write them.
#[test]
fn sides_are_read_in_their_short_forms() {
    for [left, right] in [["lt", "rt"], ["Lft", "Rgt"], ["sx", "dx"], ["port", "stbd"]] {
        let mut rig = Rig::new();
        // Facing -x: only the names tell which side is the left one.
        for (side, y) in [(left, -0.1), (right, 0.1)] {
            let name = |part: &str| format!("{side}_{part}");
            let link = |part: &str| format!("{side}_{part}_link");
            rig = rig
                .joint("revolute", &name("hip"), "base", &format!("0 {y} 0"), X)
                .joint("revolute", &name("thigh"), &link("hip"), "0 0 -0.02", Y)
                .joint("revolute", &name("knee"), &link("thigh"), "0 0 -0.2", Y)
                .joint("revolute", &name("ankle"), &link("knee"), "0 0 -0.2", Y);
        }
        let body = guess(&rig.urdf());
        assert_eq!((body.kind, body.forward), (BodyKind::Biped, "-x"), "{left}");
        assert_eq!(body.parts.left_knee, Some(format!("{left}_knee_link")));
    }
}

/// As a student's robot of open parts: what the head's joint turns is called after the camera.
#[test]
fn a_camera_that_the_heads_joint_turns_is_the_head() {
    let body = guess(
        &Rig::new()
            .joint("revolute", "head_yaw", "base", "0 0 0.1", Z)
            .renamed("head_yaw_link", "sts3250_6")
            .joint("revolute", "head_pitch", "sts3250_6", "0 0 0.03", Y)
            .renamed("head_pitch_link", "camera_enclosure")
            .urdf(),
    );
    assert_eq!(body.parts.head.as_deref(), Some("camera_enclosure"));
}
