//! Robots made to look like public ones whose shape misled (docs/measurements/robots.md): arms
//! that hang as legs do, legs that are folded at zero, wheels that turn as a head does.

use crate::look_alikes_by_name::chain;
use crate::rigs::Rig;
use servodance_retarget::{BodyGuess, BodyKind, guess_body, lint, no_meshes};

const X: &str = "<axis xyz=\"1 0 0\"/>";
const Y: &str = "<axis xyz=\"0 1 0\"/>";
const Z: &str = "<axis xyz=\"0 0 1\"/>";

fn guess(rig: &Rig) -> BodyGuess {
    guess_body(&rig.urdf(), &no_meshes).expect("something that can dance")
}

/// As Astribot S1 and Galaxea R1: arms without a word that says so hang from a torso of four
/// joints that rises from the base.
#[test]
fn arms_that_hang_from_a_torso_are_no_legs() {
    let torso = [("0 0 0.1", Y), ("0 0 0.4", Y), ("0 0 0.4", Y), ("0 0 0", Z)];
    let mut rig = chain(Rig::new(), "base", "torso", &torso);
    for (side, y) in [("left", 0.15), ("right", -0.15)] {
        let at = format!("0 {y} 0.4");
        let arm = [(at.as_str(), Y), ("0 0 0", X), ("0 0 -0.05", Z), ("0 0 -0.3", Y)];
        let wrist = [("0 0 -0.05", Z), ("0 0 -0.25", Y), ("0 0 0", X)];
        rig = chain(
            rig,
            "torso4_link",
            &format!("{side}_joint_"),
            &[arm.as_slice(), &wrist].concat(),
        );
    }
    let body = guess(&rig);
    assert_eq!((body.kind, body.forward, body.up), (BodyKind::UpperBody, "x", "z"));
    assert_eq!(body.parts.left_elbow.as_deref(), Some("left_joint_4_link"));
    assert_eq!(body.parts.chest.as_deref(), Some("torso4_link"));
}

/// Arms on a fixed column: what stands below them is the base.
#[test]
fn a_pair_that_ends_above_the_base_is_arms() {
    let rig = Rig::new().joint("fixed", "column", "base", "0 0 0.5", "").joint(
        "fixed",
        "plate",
        "column_link",
        "0 0 -0.5",
        "",
    );
    let arm = |y: f64| {
        let begin = format!("0 {y} 0.3");
        [(begin, Y), ("0 0 0".into(), X), ("0 0 -0.2".into(), Y), ("0 0 -0.05".into(), Z)]
            .into_iter()
            .chain([("0 0 -0.15".to_owned(), Y)])
            .collect::<Vec<_>>()
    };
    let rig = [("one", 0.2), ("two", -0.2)].into_iter().fold(rig, |rig, (name, y)| {
        let joints = arm(y);
        let joints: Vec<_> = joints.iter().map(|(at, axis)| (at.as_str(), *axis)).collect();
        chain(rig, "column_link", name, &joints)
    });
    assert_eq!(guess(&rig).kind, BodyKind::UpperBody);
}

/// Two arms and two legs by their names; `thigh` and `shank` say where knees and feet are.
fn humanoid(thigh: &str, shank: &str) -> Rig {
    let mut rig = Rig::new();
    for (side, y) in [("left", 0.1), ("right", -0.1)] {
        let shoulder = format!("0 {y} 0.3");
        let arm = [(shoulder.as_str(), Y), ("0 0 0", X), ("0 0 -0.15", Y)];
        let hip = format!("0 {y} 0");
        let leg = [(hip.as_str(), X), ("0 0 0", Y), (thigh, Y), (shank, Y)];
        rig = chain(
            chain(rig, "base", &format!("{side}_arm"), &arm),
            "base",
            &format!("{side}_leg"),
            &leg,
        );
    }
    rig
}

/// As a simulator's figure that sits at zero, and a soccer robot whose knees are bent there.
#[test]
fn legs_that_are_folded_at_zero_do_not_lay_the_robot_down() {
    for [thigh, shank] in
        [["0.2 0 0", "0.2 0 0"], ["0 0 -0.2", "-0.22 0 0"], ["0 0 -0.2", "0 0 -0.2"]]
    {
        let body = guess(&humanoid(thigh, shank));
        assert_eq!((body.forward, body.up), ("x", "z"), "{thigh}, {shank}");
    }
}

/// As two arms on a turntable that begin below and beside it.
#[test]
fn where_arms_begin_says_nothing_of_up() {
    let mut rig = Rig::new();
    for (side, y) in [("left", 0.2), ("right", -0.2)] {
        let at = format!("0.06 {y} -0.02");
        let arm = [(at.as_str(), Z), ("0 0 0.05", Y), ("0 0 0.2", Y), ("0 0 0.17", Y)];
        rig = chain(rig, "base", &format!("{side}_arm"), &arm);
    }
    let body = guess(&rig);
    assert_eq!((body.kind, body.forward, body.up), (BodyKind::UpperBody, "x", "z"));
}

/// As WALL-E: two wheels that are called nothing turn beside each other.
#[test]
fn two_wheels_without_a_word_for_them_are_no_head() {
    let with_wheels = |names: [&str; 2]| {
        let rig = Rig::new().joint("continuous", names[0], "base", "0 0.1 0", Y);
        rig.joint("continuous", names[1], "base", "0 -0.1 0", Y)
    };
    for names in [["leftjoint", "rightjoint"], ["turn_a", "turn_b"]] {
        assert!(guess_body(&with_wheels(names).urdf(), &no_meshes).is_none(), "{names:?}");
    }
    let with_neck =
        with_wheels(["turn_a", "turn_b"]).joint("revolute", "pan", "base", "0 0 0.2", Z);
    assert_eq!(guess(&with_neck).parts.head.as_deref(), Some("pan_link"));
}

/// As a rover of a student team: its suspension is no neck, and a bar that follows it no head.
#[test]
fn a_rovers_suspension_is_passive() {
    let follows = "<axis xyz=\"0 0 1\"/><mimic joint=\"right_suspension\"/>";
    let mut rig = Rig::new();
    for (side, y) in [("left", 0.3), ("right", -0.3)] {
        let member = format!("{side}_suspension");
        rig = rig.joint("revolute", &member, "base", &format!("0 {y} 0"), Y);
        for (end, x) in [("front", 0.4), ("back", -0.4)] {
            let wheel = format!("{end}_{side}_wheel");
            rig = rig.joint(
                "continuous",
                &wheel,
                &format!("{member}_link"),
                &format!("{x} 0 -0.1"),
                Y,
            );
        }
    }
    let rig = rig.joint("revolute", "averaging_bar", "base", "0 0 0.1", follows);
    let body = guess(&rig);
    assert_eq!((body.kind, body.parts.head), (BodyKind::Wheeled, None));
}

/// As a soccer robot in French: `tibia` says which chains are legs, and nothing which are arms.
#[test]
fn arms_without_names_are_found_beside_legs_with_names() {
    let with = |arm: &str, leg: &str| {
        let mut rig = Rig::new().joint("revolute", "cou", "base", "0 0 0.35", Z);
        for (side, y) in [("gauche", 0.1), ("droite", -0.1)] {
            let shoulder = format!("0 {y} 0.3");
            let joints = [(shoulder.as_str(), Y), ("0 0 0", X), ("0 0 -0.15", Y)];
            rig = chain(rig, "base", &format!("{side}_{arm}"), &joints);
            let hip = format!("0 {y} 0");
            let joints =
                [(hip.as_str(), Z), ("0 0 0", X), ("0 0 0", Y), ("0 0 -0.2", Y), ("0 0 -0.2", Y)];
            rig = chain(rig, "base", &format!("{side}_{leg}"), &joints);
        }
        guess(&rig)
    };
    for body in [with("bras", "tibia"), with("arm", "jambe")] {
        assert_eq!((body.kind, body.forward, body.up), (BodyKind::Humanoid, "x", "z"));
        assert!(body.parts.right_elbow.is_some_and(|elbow| elbow.starts_with("droite")));
        assert!(body.parts.left_knee.is_some_and(|knee| knee.starts_with("gauche")));
    }
}

/// Lengths in millimetres make a robot of a hundred metres.
#[test]
fn a_robot_in_millimetres_is_noted() {
    let sizes = |up: &str| {
        let rig = chain(Rig::new(), "base", "neck", &[(up, Z), (up, Y)]);
        let found = lint(&rig.urdf());
        found.iter().filter(|found| found.code.as_str() == "size-absurd").count()
    };
    assert_eq!(["0 0 0.1", "0 0 100", "0 0 0.0001"].map(sizes), [0, 1, 1]);
}
