//! Robots made to look like public ones whose parts were once taken wrong
//! (docs/measurements/robots.md): each part is where a person sees it.

use crate::rigs::Rig;
use servodance_retarget::{
    BodyGuess, BodyKind, ConfigDraft, DraftOptions, Retargeter, draft_config, guess_body, no_meshes,
};
use servodance_types::JointLimits;

const X: &str = "<axis xyz=\"1 0 0\"/>";
const Y: &str = "<axis xyz=\"0 1 0\"/>";
const Z: &str = "<axis xyz=\"0 0 1\"/>";

fn guess(rig: &Rig) -> BodyGuess {
    guess_body(&rig.urdf(), &no_meshes).expect("something that can dance")
}

/// A leg of six joints below `base`, its foot without a sole yet.
fn leg(rig: Rig, side: &str, y: f64) -> Rig {
    let part = |part: &str| format!("{side}_{part}");
    let link = |part: &str| format!("{side}_{part}_link");
    rig.joint("revolute", &part("hip_yaw"), "base", &format!("0 {y} 0"), Z)
        .joint("revolute", &part("hip_roll"), &link("hip_yaw"), "0 0 0", X)
        .joint("revolute", &part("hip_pitch"), &link("hip_roll"), "0 0 0", Y)
        .joint("revolute", &part("knee"), &link("hip_pitch"), "0 0 -0.2", Y)
        .joint("revolute", &part("ankle_pitch"), &link("knee"), "0 0 -0.2", Y)
        .joint("revolute", &part("ankle_roll"), &link("ankle_pitch"), "0 0 0", X)
}

fn two_legs(more: impl Fn(Rig, &str, f64) -> Rig) -> Rig {
    let rig = leg(Rig::new(), "left", 0.1);
    let rig = leg(more(rig, "left", 0.1), "right", -0.1);
    more(rig, "right", -0.1)
}

/// As iCub: patches of skin, bumpers and toes lie farther out than the sole.
#[test]
fn a_sole_is_the_plainest_of_its_name() {
    let body = guess(&two_legs(|rig, side, y| {
        let ankle = format!("{side}_ankle_roll_link");
        let ahead = |x: f64, part: f64| format!("{x} {} -0.06", y * part);
        rig.joint("fixed", &format!("{side}_sole_skin_8"), &ankle, &ahead(0.15, 0.1), "")
            .joint("fixed", &format!("{side}_foot_bumper"), &ankle, &ahead(0.12, 0.3), "")
            .joint("fixed", &format!("{side}_sole"), &ankle, "0.02 0 -0.06", "")
            .joint("fixed", &format!("{side}_sole_skin_0"), &ankle, &ahead(-0.1, 0.2), "")
    }));
    assert_eq!(body.kind, BodyKind::Biped);
    assert_eq!(body.parts.left_sole.as_deref(), Some("left_sole_link"));
    assert_eq!(body.parts.right_sole.as_deref(), Some("right_sole_link"));
    assert_eq!(body.parts.left_knee.as_deref(), Some("left_knee_link"));
}

/// As an arm of six joints that carries a gripper of linked fingers.
#[test]
fn fingers_at_the_end_of_an_arm_are_no_arms() {
    let mut rig = Rig::new();
    let mut last = "base".to_owned();
    for (index, axis) in [Z, Y, Y, Z, Y, Z].iter().enumerate() {
        let name = format!("joint{}", index + 1);
        rig = rig.joint("revolute", &name, &last, "0 0 0.14", axis);
        last = format!("{name}_link");
    }
    for (finger, y) in [("one", 0.03), ("two", -0.03)] {
        let knuckle = format!("gripper_{finger}");
        rig = rig.joint("revolute", &knuckle, &last, &format!("0 {y} 0.05"), X).joint(
            "revolute",
            &format!("tip_{finger}"),
            &format!("{knuckle}_link"),
            "0 0 0.04",
            X,
        );
    }
    assert_eq!(guess(&rig).kind, BodyKind::Arm);
}

/// As Stretch: a telescope whose sections are called `arm_l0` to `arm_l3`, a wrist, and a head
/// on a mast.
#[test]
fn a_telescope_is_no_arm() {
    let rig = Rig::new()
        .joint("fixed", "mast", "base", "0 0 0.2", "")
        .joint("prismatic", "lift", "mast_link", "0 0 0.5", Z)
        .joint("prismatic", "arm_l3", "lift_link", "0 -0.1 0", Y)
        .joint("prismatic", "arm_l2", "arm_l3_link", "0 -0.01 0", Y)
        .joint("prismatic", "arm_l1", "arm_l2_link", "0 -0.01 0", Y)
        .joint("revolute", "wrist_yaw", "arm_l1_link", "0.08 0 0", Z)
        .joint("revolute", "wrist_pitch", "wrist_yaw_link", "0 0 -0.03", Y)
        .joint("revolute", "wrist_roll", "wrist_pitch_link", "0.02 0 0", X)
        .joint("revolute", "head_pan", "mast_link", "0 0 1.0", Z)
        .joint("revolute", "head_tilt", "head_pan_link", "0.04 0 0", Y);
    let body = guess(&rig);
    assert_eq!((body.kind, body.forward, body.up), (BodyKind::Head, "x", "z"));
    assert_eq!(body.parts.head.as_deref(), Some("head_tilt_link"));
    assert_eq!(body.parts.left_shoulder, None);
}

/// As ARX Lift: both arms and the camera are mounted ahead of the lift.
#[test]
fn arms_mounted_ahead_do_not_lay_the_robot_down() {
    let mut rig = Rig::new().joint("prismatic", "lift", "base", "0 0 0.9", Z);
    for (side, y) in [("left", 0.2), ("right", -0.2)] {
        let part = |part: &str| format!("{side}_{part}");
        let link = |part: &str| format!("{side}_{part}_link");
        rig = rig
            .joint("revolute", &part("arm_1"), "lift_link", &format!("0.35 {y} 0"), Z)
            .joint("revolute", &part("arm_2"), &link("arm_1"), "0 0 0.05", Y)
            .joint("revolute", &part("arm_3"), &link("arm_2"), "-0.26 0 0", Y)
            .joint("revolute", &part("arm_4"), &link("arm_3"), "0.24 0 0.05", Y)
            .joint("revolute", &part("arm_5"), &link("arm_4"), "0.07 0 0", Z);
    }
    let rig = rig.joint("revolute", "head_yaw", "lift_link", "0.5 0 0", Z).joint(
        "revolute",
        "head_pitch",
        "head_yaw_link",
        "0.05 0 0",
        Y,
    );
    let body = guess(&rig);
    assert_eq!((body.kind, body.forward, body.up), (BodyKind::UpperBody, "x", "z"));
}

/// As Elf 2 of BXI (shoulders are `shld`) and JVRC-1 (the R of `WAIST_R` is roll).
#[test]
fn an_arm_begins_where_its_side_does() {
    let rig = two_legs(|rig, _, _| rig).joint("revolute", "WAIST_Y", "base", "0 0 0.1", Z);
    let mut rig = rig.joint("revolute", "WAIST_R", "WAIST_Y_link", "0 0 0", X);
    for (side, y) in [("l", 0.2), ("r", -0.2)] {
        let part = |part: &str| format!("{side}_{part}");
        let link = |part: &str| format!("{side}_{part}_link");
        rig = rig
            .joint("revolute", &part("joint_1"), "WAIST_R_link", &format!("0 {y} 0.3"), Y)
            .joint("revolute", &part("shld_x"), &link("joint_1"), "0 0 0", X)
            .joint("revolute", &part("elb_y"), &link("shld_x"), "0 0 -0.24", Y)
            .joint("revolute", &part("elb_z"), &link("elb_y"), "0 0 -0.2", Z);
    }
    let body = guess(&rig);
    assert_eq!(body.kind, BodyKind::Humanoid);
    assert_eq!(body.parts.chest.as_deref(), Some("WAIST_R_link"));
    assert_eq!(body.parts.left_shoulder.as_deref(), Some("l_shld_x_link"));
    assert_eq!(body.parts.right_elbow.as_deref(), Some("r_elb_y_link"));
}

/// A leg of three joints that begins at `at` of the base and ends `down` of its knee.
fn insect_leg(rig: Rig, name: &str, at: &str, down: &str) -> Rig {
    let part = |part: &str| format!("leg_{name}_{part}");
    let link = |part: &str| format!("leg_{name}_{part}_link");
    rig.joint("revolute", &part("coxa"), "base", at, Z)
        .joint("revolute", &part("femur"), &link("coxa"), "0 0 -0.04", Y)
        .joint("revolute", &part("tibia"), &link("femur"), "0 0 -0.06", Y)
        .joint("fixed", &part("tip"), &link("tibia"), down, "")
}

/// As a spider with a leg ahead, one behind and one at each side.
#[test]
fn four_legs_in_a_diamond_are_a_quadruped() {
    let places = [("a", "0.05 0"), ("b", "0 0.05"), ("c", "-0.05 0"), ("d", "0 -0.05")];
    let body =
        guess(&places.iter().fold(Rig::new(), |rig, (name, xy)| {
            insect_leg(rig, name, &format!("{xy} 0"), "0 0 -0.1")
        }));
    assert_eq!((body.kind, body.forward), (BodyKind::Quadruped, "x"));
    assert_eq!(body.parts.right_hand.as_deref(), Some("leg_a_tip_link"));
    assert_eq!(body.parts.left_hand.as_deref(), Some("leg_b_tip_link"));
}

/// As PhantomX: of six legs the first and last pairs dance, whichever way the body lies.
#[test]
fn six_legs_dance_as_four() {
    let along = [("lf", 0.12, 0.06), ("rf", 0.12, -0.06), ("lm", 0.0, 0.1), ("rm", 0.0, -0.1)];
    let places = along.into_iter().chain([("lr", -0.12, 0.06), ("rr", -0.12, -0.06)]);
    for across in [false, true] {
        let body = guess(&places.clone().fold(Rig::new(), |rig, (name, x, y)| {
            let at = if across { format!("{} {x} 0", -y) } else { format!("{x} {y} 0") };
            insect_leg(rig, name, &at, "0 0 -0.1")
        }));
        assert_eq!(
            (body.kind, body.forward),
            (BodyKind::Quadruped, ["x", "y"][usize::from(across)])
        );
        assert_eq!(body.parts.left_hand.as_deref(), Some("leg_lf_tip_link"));
        assert_eq!(body.parts.right_ankle.as_deref(), Some("leg_rr_tip_link"));
    }
}

/// As Pupper 3 exported from its drawing: at zero the right legs are turned by 90 degrees.
#[test]
fn four_legs_by_name_need_not_stand_at_zero() {
    let places = [("front_l", "0.1 0.1"), ("front_r", "0.1 -0.1"), ("back_l", "-0.1 0.1")];
    let places = places.into_iter().chain([("back_r", "-0.1 -0.1")]);
    let body = guess(&places.fold(Rig::new(), |rig, (name, xy)| {
        let down = if name.ends_with('r') { "0 0 -0.15" } else { "0 0.15 0" };
        insect_leg(rig, name, &format!("{xy} 0"), down)
    }));
    assert_eq!((body.kind, body.forward), (BodyKind::Quadruped, "x"));
    assert_eq!(body.parts.left_hand.as_deref(), Some("leg_front_l_tip_link"));
    assert_eq!(body.parts.right_ankle.as_deref(), Some("leg_back_r_tip_link"));
}

/// A chain of six joints whose names say no more than `prefix`.
fn plain_arm(rig: Rig, prefix: &str, at: &str) -> Rig {
    let mut last = "base".to_owned();
    [Z, Y, Z, Y, Z, Y].iter().enumerate().fold(rig, |rig, (index, axis)| {
        let name = format!("{prefix}joint{}", index + 1);
        let origin = if index == 0 { at } else { "0 0 0.14" };
        let rig = rig.joint("revolute", &name, &last, origin, axis);
        last = format!("{name}_link");
        rig
    })
}

/// As a pair of xArms: names say which is the left one, so the robot looks the other way.
#[test]
fn sides_of_chains_alike_are_as_their_names_say() {
    let body = guess(&plain_arm(plain_arm(Rig::new(), "L_", "0 0 0.1"), "R_", "0 1 0.1"));
    assert_eq!((body.kind, body.forward), (BodyKind::UpperBody, "-x"));
    assert!(body.parts.left_elbow.is_some_and(|link| link.starts_with("L_")));
}

/// As HSR: the fingers of one hand are called left and right, and a camera looks at them.
#[test]
fn fingers_of_two_joints_are_no_arms() {
    let mut rig = plain_arm(Rig::new(), "arm_", "0 0 0.1");
    rig = rig.joint("fixed", "hand_palm", "arm_joint6_link", "0 0 0.06", "");
    rig = rig.joint("fixed", "hand_camera", "arm_joint6_link", "0.05 0 0.08", "");
    for (side, y) in [("l", 0.02), ("r", -0.02)] {
        let part = |part: &str| format!("hand_{side}_{part}");
        rig = rig
            .joint("revolute", &part("proximal"), "hand_palm_link", &format!("0 {y} 0"), X)
            .joint(
                "revolute",
                &part("distal"),
                &format!("hand_{side}_proximal_link"),
                "0 0 0.04",
                X,
            )
            .joint("fixed", &part("tip"), &format!("hand_{side}_distal_link"), "0 0 0.03", "");
    }
    let rig = rig.joint("revolute", "head_pan", "base", "0 0 0.9", Z);
    let body = guess(&rig.joint("revolute", "head_tilt", "head_pan_link", "0 0 0.02", Y));
    assert_eq!(body.kind, BodyKind::Arm);
    assert_eq!(body.parts.left_hand.as_deref(), Some("hand_palm_link"));
}

/// As ToddlerBot: gears turn and rods swing beside the knee, after three joints of the hip.
#[test]
fn gears_beside_a_knee_do_not_end_the_leg() {
    let body = guess(&two_legs(|rig, side, _| {
        let part = |part: &str| format!("{side}_{part}");
        let hip = format!("{side}_hip_pitch_link");
        rig.joint("revolute", &part("yaw_drive"), &hip, "0.02 0 -0.01", Z)
            .joint("revolute", &part("crank"), &hip, "0.01 0 -0.05", Y)
            .joint("revolute", &part("rod"), &format!("{side}_crank_link"), "0 0 -0.01", Y)
    }));
    assert_eq!(body.parts.left_knee.as_deref(), Some("left_knee_link"));
    assert_eq!(body.parts.right_ankle.as_deref(), Some("right_ankle_pitch_link"));
}

/// A collision box in a link that has none yet.
fn with_box(urdf: &str, link: &str, origin: &str, size: &str) -> String {
    let start = format!("<link name=\"{link}\">");
    let shape = format!(
        "<collision><origin {origin}/><geometry><box size=\"{size}\"/></geometry></collision>"
    );
    assert_eq!(urdf.matches(&start).count(), 1);
    urdf.replace(&start, &format!("{start}{shape}"))
}

fn tip(draft: &ConfigDraft, name: &str) -> [f64; 3] {
    draft.config.tip.iter().find(|tip| tip.name == name).expect("a tip").at_m
}

/// As GR3: one foot has a shape, the other has none.
#[test]
fn a_foot_without_a_shape_is_the_mirror_image_of_the_other() {
    let urdf = two_legs(|rig, _, _| rig).urdf();
    let foot = "xyz=\"0.03 0.01 -0.04\"";
    let urdf = with_box(&urdf, "left_ankle_roll_link", foot, "0.2 0.08 0.02");
    let draft = draft_config(&urdf, DraftOptions::default(), &no_meshes).unwrap();
    assert_eq!(tip(&draft, "left_sole_tip"), [0.03, 0.01, -0.05]);
    assert_eq!(tip(&draft, "right_sole_tip"), [0.03, -0.01, -0.05]);
}

/// As K-Bot without its meshes: feet that are masses below their ankles.
#[test]
fn a_foot_that_is_a_mass_alone_reaches_twice_as_far_down() {
    let urdf = two_legs(|rig, _, _| rig).urdf();
    let mass = |urdf: String, side: &str, xyz: &str| {
        let start = format!("<link name=\"{side}_ankle_roll_link\"><inertial>");
        assert_eq!(urdf.matches(&start).count(), 1);
        urdf.replace(&start, &format!("{start}<origin xyz=\"{xyz}\"/>"))
    };
    let urdf = mass(mass(urdf, "left", "0.01 0.02 -0.03"), "right", "0.01 -0.02 -0.03");
    let draft = draft_config(&urdf, DraftOptions::default(), &no_meshes).unwrap();
    assert_eq!(tip(&draft, "left_sole_tip"), [0.01, 0.02, -0.06]);
    // As simple_humanoid: a mass where no foot is says nothing.
    let far = mass(two_legs(|rig, _, _| rig).urdf(), "left", "0.14 0 -0.2");
    assert!(draft_config(&far, DraftOptions::default(), &no_meshes).unwrap().config.tip.is_empty());
}

/// As Wolfgang: legs are bent at zero, so that the soles lean there; and as simple_humanoid: a
/// shape of the body reaches into the floor.
#[test]
fn soles_that_lean_at_zero_are_put_level() {
    let rig = two_legs(|rig, side, _| {
        let ankle = format!("{side}_ankle_roll_link");
        rig.joint("fixed", &format!("{side}_sole"), &ankle, "0 0 -0.05\" rpy=\"0 0.3 0", "")
    });
    let mut urdf = with_box(&rig.urdf(), "left_hip_yaw_link", "xyz=\"0 0 0\"", "0.1 0.1 1.6");
    for side in ["left", "right"] {
        let sole = format!("{side}_sole_link");
        urdf = with_box(&urdf, &sole, "xyz=\"0 0 0.005\"", "0.2 0.08 0.01");
    }
    let draft = draft_config(&urdf, DraftOptions::default(), &no_meshes).unwrap();
    assert_eq!(draft.config.sole_m, [0.19, 0.076]);
    let limits = JointLimits {
        lower_rad: -1.5,
        upper_rad: 1.5,
        velocity_rad_s: 4.0,
        acceleration_rad_s2: 40.0,
    };
    let joints: Vec<_> = draft.joints.iter().map(|joint| (joint.name.clone(), limits)).collect();
    let retargeter = Retargeter::new(&urdf, &draft.config, &joints, 100.0).unwrap();
    let model = retargeter.model();
    let sole = model.link("left_sole_link").unwrap();
    let root = retargeter.world_from_root(retargeter.rest());
    let up = (root * model.link_poses(retargeter.rest())[sole]).rotation.to_rotation_matrix();
    assert!(up[(2, 2)] > 0.9999, "{up}");
    let links = retargeter.rigid_links();
    let body = links.iter().find(|link| link.name == "left_hip_yaw_link").unwrap();
    assert!(body.touch.iter().all(|touch| touch.at_m[2] > 0.0), "{:?}", body.touch);
}

/// Feet that are meshes alone: the sole is the mesh's underside, not the ankle.
#[test]
fn the_underside_of_a_mesh_is_the_sole() {
    let mesh =
        |name: &str| format!("<visual><geometry><mesh filename=\"{name}\"/></geometry></visual>");
    let mut urdf = two_legs(|rig, _, _| rig).urdf();
    for side in ["left", "right"] {
        let link = format!("<link name=\"{side}_ankle_roll_link\">");
        urdf = urdf.replace(&link, &format!("{link}{}", mesh("foot.stl")));
    }
    // A foot of 0.2 by 0.08 that lies 0.05 below its ankle, 0.03 ahead of it.
    let read = |name: &str| match name {
        "foot.stl" => {
            let corner = |i: usize| {
                let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
                [0.03 + 0.1 * sign(0), 0.04 * sign(1), -0.035 + 0.015 * sign(2)]
            };
            (0..8).map(corner).collect()
        }
        _ => Vec::new(),
    };
    let body = guess_body(&urdf, &read).unwrap();
    assert_eq!(body.parts.left_sole.as_deref(), Some("left_sole_tip"));
    let draft = draft_config(&urdf, DraftOptions::default(), &read).unwrap();
    let sole = draft.config.tip.iter().find(|tip| tip.name == "left_sole_tip").unwrap();
    let near =
        sole.at_m.iter().zip([0.03, 0.0, -0.05]).all(|(at, there)| (at - there).abs() < 1e-4);
    assert!(near, "{sole:?}");
    assert_eq!(draft.config.sole_m, [0.19, 0.076]);
}

/// As Berkeley Humanoid: legs bent at zero, so that its feet are tilted, with a frame for each sole.
#[test]
fn a_frame_that_is_called_foot_tells_where_a_tilted_foot_is_level() {
    let tilted = "0.015 0 -0.049\" rpy=\"0 -0.1745 0";
    let frame = |rig: Rig, side: &str, _: f64| {
        let ankle = format!("{side}_ankle_roll_link");
        rig.joint("fixed", &format!("{side}_foot"), &ankle, tilted, "")
    };
    let urdf = ["left", "right"].iter().fold(two_legs(frame).urdf(), |urdf, side| {
        let (before, link) = urdf.split_once(&format!("<link name=\"{side}_foot_link\">")).unwrap();
        let (_, after) = link.split_once("</link>").unwrap();
        format!("{before}<link name=\"{side}_foot_link\"/>{after}")
    });
    let sole = "xyz=\"0.014 0 -0.043\" rpy=\"0 -0.1745 0\"";
    let boxed = ["left", "right"].iter().fold(urdf, |urdf, side| {
        with_box(&urdf, &format!("{side}_ankle_roll_link"), sole, "0.16 0.055 0.012")
    });
    let draft = draft_config(&boxed, DraftOptions::default(), &no_meshes).unwrap();
    assert_eq!(draft.config.body.left_sole.as_deref(), Some("left_foot_link"));
    let size = draft.config.sole_m;
    assert!((size[0] - 0.152).abs() < 1e-3, "the whole underside: {size:?}");
}

/// As SMPL's humanoid, Asimov and OpenSim's skeleton: the toes have a joint of their own.
#[test]
fn toes_are_no_sole_where_the_foot_reaches_the_floor() {
    let toes = |rig: Rig, side: &str, _: f64| {
        let ankle = format!("{side}_ankle_roll_link");
        rig.joint("revolute", &format!("{side}_toe"), &ankle, "0.12 0 -0.04", Y)
    };
    let feet = |foot: &str| {
        ["left", "right"].iter().fold(two_legs(toes).urdf(), |urdf, side| {
            let link = |part: &str| format!("{side}_{part}_link");
            let urdf = with_box(&urdf, &link("ankle_roll"), foot, "0.16 0.08 0.02");
            with_box(&urdf, &link("toe"), "xyz=\"0.03 0 -0.01\"", "0.06 0.08 0.02")
        })
    };
    let draft =
        |foot: &str| draft_config(&feet(foot), DraftOptions::default(), &no_meshes).unwrap().config;
    let on_the_floor = draft("xyz=\"0.04 0 -0.05\"");
    assert_eq!(on_the_floor.tip[0].link, "left_ankle_roll_link");
    assert_eq!(on_the_floor.tip[0].at_m, [0.04, 0.0, -0.06]);
    // As Digit: what is called toe is the foot.
    let above = draft("xyz=\"0.04 0 0\"");
    assert_eq!(above.tip[0].link, "left_toe_link");
}

/// As COMAN: frames at the corners of its left hand are called right, its shoulders have a side
/// and no part, and its forearm turns about itself. As T1: what twists the upper arm is called
/// the elbow's pitch.
#[test]
fn an_elbow_bends_the_arm() {
    let mut rig = two_legs(|rig, _, _| rig);
    for (side, y) in [("L", 0.2), ("R", -0.2)] {
        let part = |part: &str| format!("{side}{part}");
        let link = |part: &str| format!("{side}{part}_link");
        let corner = |corner: &str| format!("{}_hand_{corner}", side.to_lowercase());
        rig = rig
            .joint("revolute", &part("ShSag"), "base", &format!("0 {y} 0.3"), Y)
            .joint("revolute", &part("ShLat"), &link("ShSag"), "0 0 0", X)
            .joint("revolute", &part("ElbYaw"), &link("ShLat"), "0 0 -0.06", Z)
            .joint("revolute", &part("Elb"), &link("ElbYaw"), "0 0 -0.14", Y)
            .joint("revolute", &part("Forearm"), &link("Elb"), "0 0 -0.1", Z)
            .joint("fixed", &part("Hand"), &link("Forearm"), "0 0 -0.12", "")
            .joint("fixed", &corner("upper_right"), &link("Hand"), "0.04 0.03 0", "")
            .joint("fixed", &corner("upper_left"), &link("Hand"), "0.04 -0.03 0", "");
    }
    let body = guess(&rig);
    assert_eq!(body.parts.left_shoulder.as_deref(), Some("LShLat_link"));
    assert_eq!(body.parts.left_elbow.as_deref(), Some("LElb_link"));
    assert_eq!(body.parts.right_elbow.as_deref(), Some("RElb_link"));
    assert_eq!(body.parts.right_hand.as_deref(), Some("RHand_link"));
}

/// As NimbRo's: a linkage is drawn beside the leg by links that weigh nothing, with more joints.
#[test]
fn a_leg_weighs_something() {
    let parts = ["crank", "rod", "knee_plate", "shank_rod", "ankle_plate", "foot_plate"];
    let urdf = two_legs(|rig, side, _| {
        let name = |part: &str| format!("parallel_{side}_{part}");
        let hip = (rig, format!("{side}_hip_roll_link"));
        let add = |(rig, above): (Rig, String), part: &&str| {
            let next = format!("{}_link", name(part));
            (rig.joint("revolute", &name(part), &above, "0.01 0 -0.07", Y), next)
        };
        parts.iter().fold(hip, add).0
    })
    .urdf();
    let drawn = ["left", "right"]
        .iter()
        .flat_map(|side| parts.iter().map(move |part| format!("parallel_{side}_{part}_link")));
    let body = guess_body(&drawn.fold(urdf, without_mass), &no_meshes).unwrap();
    assert_eq!(body.parts.left_knee.as_deref(), Some("left_knee_link"));
    assert_eq!(body.parts.right_ankle.as_deref(), Some("right_ankle_pitch_link"));
}

fn without_mass(urdf: String, link: String) -> String {
    let (before, rest) = urdf.split_once(&format!("<link name=\"{link}\">")).unwrap();
    let (_, after) = rest.split_once("</inertial>").unwrap();
    format!("{before}<link name=\"{link}\">{after}")
}

/// As GENE.01 and Romeo: the frame called sole is below the ankle, the foot reaches farther ahead.
#[test]
fn a_sole_is_where_the_foot_is() {
    let frame = |rig: Rig, side: &str, _: f64| {
        let ankle = format!("{side}_ankle_roll_link");
        rig.joint("fixed", &format!("{side}_sole"), &ankle, "0 0 -0.05", "")
    };
    let foot = |side: &str| format!("{side}_ankle_roll_link");
    let boxed = ["left", "right"].iter().fold(two_legs(frame).urdf(), |urdf, side| {
        with_box(&urdf, &foot(side), "xyz=\"0.06 0 -0.04\"", "0.2 0.08 0.02")
    });
    let draft = draft_config(&boxed, DraftOptions::default(), &no_meshes).unwrap();
    assert_eq!(draft.config.body.left_sole.as_deref(), Some("left_sole_tip"));
    assert_eq!(draft.config.tip[0].at_m, [0.06, 0.0, 0.0]);
    // As iCub, whose meshes lie as another program turns them: both feet point to one side.
    let mesh = "<visual><geometry><mesh filename=\"foot.dae\"/></geometry></visual>";
    let turned = ["left", "right"].iter().fold(two_legs(frame).urdf(), |urdf, side| {
        let link = format!("<link name=\"{}\">", foot(side));
        urdf.replace(&link, &format!("{link}{mesh}"))
    });
    let corners = |_: &str| {
        let corner = |x, z| [-0.04, 0.14].map(|y| [x, y, z]);
        [corner(-0.03, -0.05), corner(0.03, -0.05), corner(0.0, 0.0)].concat()
    };
    let draft = draft_config(&turned, DraftOptions::default(), &corners).unwrap();
    assert_eq!(draft.config.body.left_sole.as_deref(), Some("left_sole_link"));
    assert!(draft.config.tip.is_empty());
    assert!(draft.config.sole_m[0] > draft.config.sole_m[1], "{:?}", draft.config.sole_m);
}

/// As Cassie of UMich: what is called ankle is the heel, at half of the leg; the toe is the foot.
#[test]
fn toes_far_from_what_is_called_the_ankle_are_the_foot() {
    let cassie = |rig: Rig, side: &str, y: f64| {
        let part = |part: &str| format!("{side}_{part}");
        let link = |part: &str| format!("{side}_{part}_link");
        rig.joint("revolute", &part("hip_roll"), "base", &format!("0 {y} 0"), X)
            .joint("revolute", &part("thigh"), &link("hip_roll"), "0 0 0", Y)
            .joint("revolute", &part("knee"), &link("thigh"), "0.05 0 -0.2", Y)
            .joint("revolute", &part("ankle"), &link("knee"), "-0.1 0 -0.3", Y)
            .joint("revolute", &part("toe"), &link("ankle"), "0.1 0 -0.4", Y)
    };
    let body = guess(&cassie(cassie(Rig::new(), "left", 0.1), "right", -0.1));
    assert_eq!(body.kind, BodyKind::Biped);
    assert_eq!(body.parts.left_sole.as_deref(), Some("left_toe_link"));
}

/// As the two arms of WATonomous: no name says arm, one hangs and one is held out at zero.
#[test]
fn arms_that_are_held_otherwise_at_zero_are_a_pair() {
    let rig = [("", 0.16, "0 0 -1"), ("l", -0.16, "0 -1 0")].iter().fold(
        Rig::new(),
        |rig, (mark, y, way)| {
            let along = |m: f64| {
                let numbers = way.split(' ').map(|v| v.parse::<f64>().unwrap() * m);
                numbers.map(|v| v.to_string()).collect::<Vec<_>>().join(" ")
            };
            let name = |index: usize| format!("seg{index}{mark}");
            let link = |index: usize| format!("seg{index}{mark}_link");
            (2..7).fold(
                rig.joint("revolute", &name(1), "base", &format!("0 {y} 0.5"), X),
                |rig, index| {
                    let axis = [X, Y, Z][index % 3];
                    rig.joint("revolute", &name(index), &link(index - 1), &along(0.1), axis)
                },
            )
        },
    );
    let body = guess(&rig);
    assert_eq!(body.kind, BodyKind::UpperBody);
    assert_eq!(body.parts.left_hand.as_deref(), Some("seg6_link"));
    assert_eq!(body.parts.right_hand.as_deref(), Some("seg6l_link"));
}

/// As Kangaroo: the knee is driven through a rod, so its leg has the joints of a ball at the
/// hip and those of the foot; the waist above the hips is no head.
#[test]
fn joints_of_a_ball_are_no_knee_and_a_waist_is_no_head() {
    let kangaroo = |rig: Rig, side: &str, y: f64| {
        let part = |part: usize| format!("leg_{side}_{part}");
        let link = |part: usize| format!("leg_{side}_{part}_link");
        rig.joint("revolute", &part(1), "base", &format!("0 {y} 0"), Z)
            .joint("revolute", &part(2), &link(1), "0 0 -0.12", Y)
            .joint("revolute", &part(3), &link(2), "0 0 0", X)
            .joint("fixed", &part(4), &link(3), "0 0 -0.3", "")
            .joint("revolute", &part(5), &link(4), "0 0 0", X)
    };
    let waist = Rig::new().joint("revolute", "pelvis_1", "base", "0 0 0.05", Z);
    let body = guess(&kangaroo(kangaroo(waist, "left", 0.1), "right", -0.1));
    assert_eq!((body.kind, body.parts.head), (BodyKind::Biped, None));
    assert_eq!(body.parts.left_knee.as_deref(), Some("leg_left_5_link"));
    assert_eq!(body.parts.left_sole.as_deref(), Some("leg_left_5_link"));
}

/// As PM01 of EngineAI: a ball of a gram marks the ankle's lower end, the foot is a mesh.
#[test]
fn a_ball_that_marks_a_point_is_no_foot() {
    let marker = |rig: Rig, side: &str, _: f64| {
        let ankle = format!("{side}_ankle_roll_link");
        rig.joint("fixed", &format!("{side}_end"), &ankle, "0.017 0 -0.046", "")
    };
    let mesh = "<visual><geometry><mesh filename=\"foot.obj\"/></geometry></visual>";
    let ball = "<visual><geometry><sphere radius=\"0.02\"/></geometry></visual>";
    let drawn = ["left", "right"].iter().fold(two_legs(marker).urdf(), |urdf, side| {
        let link = |part: &str| format!("<link name=\"{side}_{part}_link\">");
        let urdf = without_mass(urdf, format!("{side}_end_link"));
        let urdf = urdf.replace(&link("end"), &format!("{}{ball}", link("end")));
        urdf.replace(&link("ankle_roll"), &format!("{}{mesh}", link("ankle_roll")))
    });
    let corners = |_: &str| {
        let corner = |x: f64| [-0.04, 0.04].map(|y| [x, y, -0.06]);
        [corner(-0.06), corner(0.14)].concat()
    };
    let config = draft_config(&drawn, DraftOptions::default(), &corners).unwrap().config;
    assert!((config.sole_m[0] - 0.19).abs() < 1e-3, "{:?}", config.sole_m);
}

/// As InMoov, whose arms hang from a waist: the fingers of one hand begin at the corners of a
/// rectangle and end level.
#[test]
fn fingers_of_a_hand_are_no_four_legs() {
    let mut rig = Rig::new().joint("revolute", "waist_rotate", "base", "0 0 1.1", Z);
    for (side, y) in [("left", 0.2), ("right", -0.2)] {
        let part = |part: &str| format!("{side}_{part}");
        let link = |part: &str| format!("{side}_{part}_link");
        rig = rig
            .joint(
                "revolute",
                &part("shoulder_side"),
                "waist_rotate_link",
                &format!("0 {y} 0.4"),
                X,
            )
            .joint("revolute", &part("shoulder_up"), &link("shoulder_side"), "0 0 0", Y)
            .joint("revolute", &part("bicep_rotate"), &link("shoulder_up"), "0 0 -0.1", Z)
            .joint("revolute", &part("forearm"), &link("bicep_rotate"), "0 0 -0.2", Y)
            .joint("revolute", &part("hand"), &link("forearm"), "0 0 -0.25", Z);
        for (finger, x, y) in [
            ("one", 0.03, 0.03),
            ("two", 0.03, -0.03),
            ("three", -0.03, 0.03),
            ("four", -0.03, -0.03),
        ] {
            let knuckle = part(finger);
            rig =
                rig.joint("revolute", &knuckle, &link("hand"), &format!("{x} {y} -0.05"), Y).joint(
                    "revolute",
                    &format!("{knuckle}_tip"),
                    &format!("{knuckle}_link"),
                    "0 0 -0.04",
                    Y,
                );
        }
    }
    let body = guess(&rig);
    assert_eq!(body.kind, BodyKind::UpperBody);
    assert_eq!(body.parts.left_elbow.as_deref(), Some("left_forearm_link"));
    assert_eq!(body.parts.right_hand.as_deref(), Some("right_hand_link"));
}

/// As Genie G1, whose names only count the joints: with its gripper, the arm's half is nearer to
/// the wrist than to the elbow.
#[test]
fn a_gripper_beyond_the_wrist_does_not_move_the_elbow() {
    let mut rig = Rig::new().joint("prismatic", "body_1", "base", "0 0 0.9", Z);
    for (side, out) in [("l", 1.0), ("r", -1.0)] {
        let joints = [(0.2, Y), (0.0, X), (0.305, Y), (0.0, Z), (0.2, Y), (0.0, Z), (0.18, Y)];
        let mut last = "body_1_link".to_owned();
        for (index, (along, axis)) in joints.iter().enumerate() {
            let name = format!("arm_{side}_{}", index + 1);
            rig = rig.joint("revolute", &name, &last, &format!("0 {} 0", along * out), axis);
            last = format!("{name}_link");
        }
        let at = format!("0 {} 0", 0.15 * out);
        rig = rig.joint("fixed", &format!("gripper_{side}"), &last, &at, "");
    }
    let body = guess(&rig);
    assert_eq!(body.kind, BodyKind::UpperBody);
    assert_eq!(body.parts.left_elbow.as_deref(), Some("arm_l_4_link"));
    assert_eq!(body.parts.right_elbow.as_deref(), Some("arm_r_4_link"));
}

/// As Nextage Open: the hand's shape lies aside, so that the line to its end is not the forearm's.
#[test]
fn a_hand_that_lies_aside_does_not_bend_the_forearm() {
    let mut rig = Rig::new().joint("revolute", "chest", "base", "0 0 0", Z);
    for (side, y) in [("l", 0.15), ("r", -0.15)] {
        let at = format!("0 {y} 0.37");
        let joints = [
            (at.as_str(), Z),
            ("0 0 0", Y),
            ("0 0 -0.26", Y),
            ("-0.03 0 0", Z),
            ("0 0 -0.23", Y),
            ("-0.05 0 -0.09", X),
        ];
        let mut last = "chest_link".to_owned();
        for (index, (at, axis)) in joints.iter().enumerate() {
            let name = format!("{side}arm_joint{index}");
            rig = rig.joint("revolute", &name, &last, at, axis);
            last = format!("{name}_link");
        }
    }
    let aside = |urdf: String, side: &str| {
        with_box(&urdf, &format!("{side}arm_joint5_link"), "xyz=\"-0.25 0 0\"", "0.5 0.05 0.05")
    };
    let urdf = aside(aside(rig.urdf(), "l"), "r");
    let body = guess_body(&urdf, &no_meshes).expect("an upper body");
    assert_eq!(body.kind, BodyKind::UpperBody);
    assert_eq!(body.parts.left_elbow.as_deref(), Some("larm_joint2_link"));
    assert_eq!(body.parts.right_elbow.as_deref(), Some("rarm_joint2_link"));
}

/// As Xuanwu, whose names only count the joints: the hip's brackets go out and back again.
#[test]
fn brackets_of_a_hip_do_not_lengthen_the_thigh() {
    let mut rig = Rig::new();
    for (side, y) in [("1", 0.07), ("2", -0.07)] {
        let joints = [
            (format!("0 {y} 0"), Z),
            ("-0.083 0 -0.11".into(), X),
            ("0.083 0 0".into(), Y),
            ("0 0 -0.18".into(), Y),
            ("0 0 -0.18".into(), Y),
        ];
        let mut last = "base".to_owned();
        for (index, (at, axis)) in joints.iter().enumerate() {
            let name = format!("joint_{side}_{}", index + 1);
            rig = rig.joint("revolute", &name, &last, at, axis);
            last = format!("{name}_link");
        }
    }
    let body = guess(&rig);
    assert_eq!(body.kind, BodyKind::Biped);
    assert_eq!(body.parts.left_knee.as_deref(), Some("joint_1_4_link"));
    assert_eq!(body.parts.right_knee.as_deref(), Some("joint_2_4_link"));
}
