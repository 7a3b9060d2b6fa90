//! Robot descriptions as they are found: usable, or refused with a reason.

use proptest::prelude::*;
use servodance_retarget::nalgebra::{Point3, Vector3};
use servodance_retarget::{
    DiagnosticCode, RetargetConfig, RetargetError, Retargeter, RobotModel, guess_body, lint,
    no_meshes, urdf_from_mjcf,
};
use servodance_types::JointLimits;

use crate::support::{CONTROL_HZ, Robot};

fn limits() -> JointLimits {
    JointLimits { lower_rad: -1.0, upper_rad: 1.0, velocity_rad_s: 3.0, acceleration_rad_s2: 20.0 }
}

fn two_links(joint: &str) -> String {
    format!(
        r#"<robot name="r"><link name="base"/><link name="tip"/>
        <joint name="turn" type="revolute"><parent link="base"/><child link="tip"/>{joint}</joint>
        </robot>"#
    )
}

fn refusal(urdf: &str, joint: &str) -> String {
    let joints = [(joint.to_string(), limits())];
    match Retargeter::new(urdf, &RetargetConfig::default(), &joints, CONTROL_HZ) {
        Ok(_) => panic!("accepted: {urdf}"),
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains('\n'), "{message}");
            message
        }
    }
}

const GOOD_LIMIT: &str = r#"<limit lower="-1" upper="1" effort="1" velocity="1"/>"#;

#[test]
fn broken_descriptions_are_refused_by_name() {
    let axis = r#"<axis xyz="0 0 0"/>"#;
    let inverted = r#"<axis xyz="0 0 1"/><limit lower="1" upper="0.5" effort="1" velocity="1"/>"#;
    let nan = r#"<axis xyz="0 NaN 1"/>"#;
    let mimic = r#"<axis xyz="0 0 1"/><mimic joint="nobody"/>"#;
    let circle = r#"<axis xyz="0 0 1"/><mimic joint="turn"/>"#;
    for (body, expected) in [
        (format!("{axis}{GOOD_LIMIT}"), "axis 0 0 0"),
        (inverted.into(), "lower limit 1 is above upper limit 0.5"),
        (format!("{nan}{GOOD_LIMIT}"), "has no direction"),
        (format!("{mimic}{GOOD_LIMIT}"), "nobody"),
        (format!("{circle}{GOOD_LIMIT}"), "circle"),
    ] {
        let message = refusal(&two_links(&body), "turn");
        assert!(message.contains(expected), "{message}");
        assert!(message.contains("`turn`"), "{message}");
    }
}

#[test]
fn limits_written_the_wrong_way_round_are_exchanged_and_said() {
    let limit = r#"<axis xyz="0 0 1"/><limit lower="1" upper="-1" effort="1" velocity="1"/>"#;
    let found = lint(&two_links(limit));
    assert!(found.iter().any(|f| f.code == DiagnosticCode::RangeInverted), "{found:?}");
    assert!(RobotModel::new(&two_links(limit), &["turn"]).is_ok());
}

#[test]
fn a_mimic_of_a_fixed_joint_is_held_and_said() {
    let urdf = r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
        <joint name="still" type="fixed"><parent link="a"/><child link="b"/></joint>
        <joint name="turn" type="revolute"><parent link="b"/><child link="c"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
        <mimic joint="still"/></joint></robot>"#;
    let found = lint(urdf);
    let held = found.iter().find(|f| f.code == DiagnosticCode::MimicOfFixed);
    assert!(held.is_some_and(|f| f.subject == "turn" && f.message.contains("`still`")));
    assert!(RobotModel::new(urdf, &[]).is_ok());
    assert!(refusal(urdf, "turn").contains("no joint `turn`"));
}

#[test]
fn trees_that_are_none_are_refused() {
    let link = |name: &str| format!(r#"<link name="{name}"/>"#);
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            r#"<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>"#
        )
    };
    let robot = |parts: &[String]| format!(r#"<robot name="r">{}</robot>"#, parts.concat());
    let (a, b) = (link("a"), link("b"));
    for (urdf, expected) in [
        (robot(&[]), "no link"),
        (robot(&[a.clone(), b.clone()]), "several roots: a, b"),
        (robot(&[a.clone(), a.clone()]), "`a` is there twice"),
        (robot(&[a.clone(), joint("j", "a", "z")]), "no link `z`"),
        (robot(&[a.clone(), b.clone(), joint("i", "a", "b"), joint("j", "b", "a")]), "loop"),
        (robot(&["<xacro:include/>".into()]), "xacro"),
        ("not xml at all".into(), "not a readable URDF"),
        (String::new(), "not a readable URDF"),
        ("<a>".repeat(100_000), "nested"),
    ] {
        let message = refusal(&urdf, "turn");
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn unknown_names_list_the_choices() {
    let urdf = two_links(&format!(r#"<axis xyz="0 0 1"/>{GOOD_LIMIT}"#));
    let message = refusal(&urdf, "trun");
    assert!(message.contains("`trun`") && message.contains("it has: turn"), "{message}");
    let mut robot = Robot::op3();
    robot.config.body.left_hand = Some("paw".into());
    let error = Retargeter::new(robot.urdf, &robot.config, &robot.joints, CONTROL_HZ);
    let Err(RetargetError::NoSuchLink { part, choices, .. }) = error else {
        panic!("accepted");
    };
    assert_eq!(part, "left_hand");
    assert!(choices.contains("l_hand"));
}

#[test]
fn a_robot_without_legs_cannot_be_planted() {
    let urdf = two_links(&format!(r#"<axis xyz="0 0 1"/>{GOOD_LIMIT}"#));
    let config: RetargetConfig = toml::from_str("stance = 'planted'").unwrap();
    let joints = [("turn".to_string(), limits())];
    let error = Retargeter::new(&urdf, &config, &joints, CONTROL_HZ).err().unwrap();
    assert!(error.to_string().contains("hung"), "{error}");
}

#[test]
fn body_parts_are_guessed_from_names() {
    let mut robot = Robot::op3();
    let named = robot.retargeter().rest().to_vec();
    robot.config.body = Default::default();
    let guessed = robot.retargeter().rest().to_vec();
    for (a, b) in named.iter().zip(&guessed) {
        assert!((a - b).abs() < 1e-6);
    }
}

#[test]
fn forward_kinematics_agrees_with_k_for_every_robot() {
    for (robot_name, robot) in Robot::all() {
        let names: Vec<&str> = robot.joints.iter().map(|(name, _)| name.as_str()).collect();
        let model = RobotModel::new(robot.urdf, &names).unwrap();
        let chain: k::Chain<f64> = urdf_rs::read_from_string(robot.urdf).unwrap().into();
        let angle = |(i, limits): (usize, &JointLimits)| {
            let share = 0.5 + 0.45 * (i as f64 * 1.7).sin();
            limits.lower_rad + share * (limits.upper_rad - limits.lower_rad)
        };
        let positions: Vec<f64> = robot.limits().iter().enumerate().map(angle).collect();
        for (name, position) in names.iter().zip(&positions) {
            let node = chain.find(name).unwrap();
            node.set_joint_position(*position).unwrap();
        }
        chain.update_transforms();
        let poses = model.link_poses(&positions);
        for (name, pose) in model.link_names().iter().zip(&poses) {
            let theirs = chain.find_link(name).unwrap().world_transform().unwrap();
            let apart_m = (theirs.translation.vector - pose.translation.vector).norm();
            assert!(apart_m < 1e-12, "{robot_name}: {name} {apart_m}");
            let turned = theirs.rotation.angle_to(&pose.rotation);
            assert!(turned < 1e-7, "{robot_name}: {name} {turned}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Bytes changed, cut out or doubled anywhere in a good description.
    #[test]
    fn no_mutation_of_a_description_panics(
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0..4_u8, any::<u8>()), 1..8),
    ) {
        let robot = Robot::op3();
        let mut text = robot.urdf.as_bytes().to_vec();
        for (place, kind, byte) in edits {
            let at = place.index(text.len());
            match kind {
                0 => text[at] = byte % 128,
                1 => { text.remove(at); }
                2 => text.insert(at, b"0123456789.-<>/\" e"[usize::from(byte) % 18]),
                _ => {
                    let end = (at + usize::from(byte)).min(text.len());
                    let piece = text[at..end].to_vec();
                    text.splice(at..at, piece);
                }
            }
        }
        let text = String::from_utf8_lossy(&text);
        let made = Retargeter::new(&text, &robot.config, &robot.joints, CONTROL_HZ);
        if let Ok(mut robot) = made {
            let mut out = robot.rest().to_vec();
            prop_assert!(robot.next(0.0, &mut out).is_ok());
            prop_assert!(out.iter().all(|p| p.is_finite()));
        }
    }

    #[test]
    fn numbers_put_anywhere_do_not_panic(
        place in any::<prop::sample::Index>(),
        number in prop_oneof![
            Just("nan"), Just("inf"), Just("-1e308"), Just("1e-320"), Just("0"), Just("-0"),
        ],
    ) {
        let robot = Robot::op3();
        let numbers: Vec<(usize, &str)> = robot
            .urdf
            .match_indices(|c: char| c.is_ascii_digit())
            .collect();
        let (at, _) = numbers[place.index(numbers.len())];
        let text = format!("{}{number}{}", &robot.urdf[..at], &robot.urdf[at + 1..]);
        if let Ok(mut robot) = Retargeter::new(&text, &robot.config, &robot.joints, CONTROL_HZ) {
            let mut out = robot.rest().to_vec();
            prop_assert!(robot.next(0.0, &mut out).is_ok());
            prop_assert!(out.iter().all(|p| p.is_finite()));
        }
    }
}

/// Colours of the shapes of a description, in order.
fn colours(urdf: &str) -> Vec<[f32; 4]> {
    let model = RobotModel::new(urdf, &["turn"]).expect("a model");
    model.visuals().iter().map(|visual| visual.rgba).collect()
}

#[test]
fn a_material_that_is_only_named_has_the_colour_of_its_definition() {
    let box_of = |material: &str| {
        format!(r#"<visual><geometry><box size="1 1 1"/></geometry>{material}</visual>"#)
    };
    let urdf = format!(
        r#"<robot name="r">
        <link name="base">{}{}{}{}</link><link name="tip">{}</link>
        <joint name="turn" type="revolute"><parent link="base"/><child link="tip"/>{GOOD_LIMIT}</joint>
        <material name="later"><color rgba="0.1 0.2 0.3 1"/></material>
        </robot>"#,
        box_of(r#"<material name="later"/>"#),
        box_of(r#"<material name="own"><color rgba="1 0 0 1"/></material>"#),
        box_of(r#"<material name="nobody"/>"#),
        box_of(""),
        box_of(r#"<material name="own"/>"#),
    );
    let none = [0.0; 4];
    let [named, red] = [[0.1, 0.2, 0.3, 1.0], [1.0, 0.0, 0.0, 1.0]];
    assert_eq!(colours(&urdf), [named, red, none, none, red]);
}

#[test]
fn a_shape_of_mjcf_has_its_own_colour_or_its_materials() {
    let mjcf = r#"<mujoco><default><geom material="cloth"/>
        <default class="dark"><geom rgba="0.1 0.1 0.1 1"/></default></default>
        <asset><material name="cloth" rgba="0 0 1 1"/><material name="skin" rgba="1 0.5 0 1"/></asset>
        <worldbody><body name="base"><geom type="sphere" size="0.1"/>
        <body name="tip"><joint name="turn" range="-60 60"/>
        <geom type="sphere" size="0.1" material="skin"/>
        <geom type="sphere" size="0.1" material="skin" rgba="0 1 0 1"/>
        <geom type="sphere" size="0.1" class="dark"/></body></body></worldbody></mujoco>"#;
    let (urdf, _) = urdf_from_mjcf(mjcf).expect("a URDF");
    let [blue, skin] = [[0.0, 0.0, 1.0, 1.0], [1.0, 0.5, 0.0, 1.0]];
    let [green, dark] = [[0.0, 1.0, 0.0, 1.0], [0.1, 0.1, 0.1, 1.0]];
    assert_eq!(colours(&urdf), [blue, skin, green, dark]);
}

#[test]
fn meshes_of_mjcf_are_drawn_by_their_files_names_and_simple_shapes_beside_them_only_touch() {
    let mjcf = r#"<mujoco><compiler meshdir="assets"/>
        <default><mesh scale="0.001 0.001 0.001"/>
        <default class="solid"><geom group="3"/></default></default>
        <asset><mesh file="parts/foot.stl"/><mesh name="hull" file="hull.obj" scale="2 2 2"/>
        <mesh name="turned" file="turned.stl" refpos="0.1 0 0" refquat="0 0 0 1"/></asset>
        <worldbody><body name="base"><geom type="sphere" size="0.1"/>
        <body name="tip"><joint name="turn" range="-60 60"/>
        <geom type="mesh" mesh="foot" pos="0 0 1" contype="0" conaffinity="0"/>
        <geom type="mesh" mesh="foot" pos="0 0 1"/>
        <geom type="mesh" mesh="turned"/>
        <geom type="mesh" mesh="hull" class="solid"/><geom type="mesh" mesh="gone"/>
        <geom type="box" size="0.1 0.2 0.3"/></body></body></worldbody></mujoco>"#;
    let (urdf, found) = urdf_from_mjcf(mjcf).expect("a URDF");
    let model = RobotModel::new(&urdf, &[]).expect("a model");
    let [foot, turned] = model.meshes() else { panic!("{:?}", model.meshes()) };
    assert_eq!((foot.filename.as_str(), foot.scale), ("assets/parts/foot.stl", [0.001; 3]));
    assert_eq!(foot.pose_in_link.translation.vector.z, 1.0);
    let corner = turned.pose_in_link * Point3::new(0.3, 0.0, 0.0);
    assert!((corner - Point3::new(-0.2, 0.0, 0.0)).norm() < 1e-9, "{corner}");
    let drawn: Vec<usize> = model.visuals().iter().map(|visual| visual.link).collect();
    assert_eq!(drawn, [0], "the box beside a mesh is not drawn");
    assert!(urdf.contains("<collision><origin"), "{urdf}");
    let left_out = found.iter().find(|f| f.code == DiagnosticCode::MjcfLeftOut);
    assert!(left_out.is_some_and(|f| f.subject == "tip" && f.message.starts_with("1 shapes")));
    let plain = mjcf.replace("meshdir", "strippath=\"true\" assetdir");
    let (urdf, _) = urdf_from_mjcf(&plain).expect("a URDF");
    let model = RobotModel::new(&urdf, &[]).expect("a model");
    assert_eq!(model.meshes()[0].filename, "assets/foot.stl");
}

#[test]
fn the_world_of_mjcf_is_the_base_of_limbs_that_hang_from_it_by_one_joint() {
    let leg = |name: &str, joints: &str| {
        let knee = format!("<body name='{name}_shank' pos='0 0 -.2'><joint axis='0 1 0'/></body>");
        format!("<body name='{name}' pos='.1 0 0'>{joints}{knee}</body>")
    };
    let hinge = "<joint axis='1 0 0'/>";
    let world = |bodies: &str| format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>");
    let hung = "<geom type='plane' size='1 1 1'/><geom type='box' size='.2 .1 .05'/>".to_owned()
        + &leg("one", hinge)
        + &leg("two", hinge)
        + &leg("ball", "<freejoint/>");
    let (urdf, found) = urdf_from_mjcf(&world(&hung)).unwrap();
    let model = RobotModel::new(&urdf, &[]).unwrap();
    assert_eq!(model.link_names()[0], "base");
    assert_eq!(model.link_names().len(), 5, "{urdf}");
    assert!(found.iter().any(|f| f.subject == "ball" && f.message.contains("object")), "{found:?}");
    // A root that floats in a plane.
    let planar = leg("torso", &("<joint type='slide'/>".to_owned() + hinge));
    let (urdf, found) = urdf_from_mjcf(&world(&planar)).unwrap();
    assert!(urdf.contains("link name=\"torso\""), "{urdf}");
    assert_eq!(found.iter().filter(|f| f.message.contains("held")).count(), 2, "{found:?}");
}

/// As ALOHA: two arms stand beside each other on a table that is part of the world.
#[test]
fn the_world_of_mjcf_is_the_base_of_arms_that_are_bolted_to_it() {
    let arm = |name: &str, x: f64| {
        let elbow = format!("<body name='{name}_elbow' pos='0 0 .3'><joint axis='0 1 0'/></body>");
        let shoulder = format!("<body name='{name}_shoulder'><joint axis='0 0 1'/>{elbow}</body>");
        format!("<body name='{name}' pos='{x} 0 0'>{shoulder}</body>")
    };
    let door = "<body name='door'><body name='wing'><joint axis='0 0 1'/></body></body>";
    let table = "<body name='table'><geom type='box' size='1 1 .1'/></body>";
    let world = |bodies: &str| format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>");
    let both = table.to_owned() + &arm("left", -0.5) + door + &arm("right", 0.5);
    let (urdf, found) = urdf_from_mjcf(&world(&both)).unwrap();
    let model = RobotModel::new(&urdf, &[]).unwrap();
    assert_eq!(model.link_names()[0], "base");
    for part in ["left_elbow", "right_elbow"] {
        assert!(model.link(part).is_some(), "{urdf}");
    }
    assert_eq!(found.iter().filter(|f| f.message.contains("object")).count(), 2, "{found:?}");
    let (urdf, _) = urdf_from_mjcf(&world(&arm("left", -0.5))).unwrap();
    assert!(!urdf.contains("link name=\"base\""), "{urdf}");
}

/// A frame moves and turns what stands in it, and may hold another; its class is theirs.
#[test]
fn frames_of_mjcf_are_looked_into() {
    let arm = |side: &str| {
        format!(
            "<body name=\"{side}_upper_arm\"><joint name=\"{side}_shoulder\" axis=\"0 1 0\"/>\
             <geom type=\"capsule\" size=\".03\" fromto=\"0 0 0 0 0 -.2\"/>\
             <frame pos=\"0 0 -.2\" childclass=\"weak\"><body name=\"{side}_lower_arm\">\
             <joint name=\"{side}_elbow\" axis=\"0 1 0\"/></body></frame></body>"
        )
    };
    let text = format!(
        "<mujoco><default><default class=\"weak\"><joint range=\"-90 0\"/></default></default>\
         <worldbody><body name=\"torso\"><freejoint/><frame pos=\"0 .1 0\">\
         <frame pos=\"0 .05 .1\" euler=\"0 0 90\"><geom name=\"g\" size=\".02\" pos=\".1 0 0\"/>{}\
         </frame></frame><frame pos=\"0 -.15 .1\">{}</frame>\
         <replicate count=\"3\"><geom size=\".1\"/></replicate></body></worldbody></mujoco>",
        arm("left"),
        arm("right")
    );
    let (urdf, found) = urdf_from_mjcf(&text).unwrap();
    let left_out: Vec<&str> = found.iter().map(|found| found.subject.as_str()).collect();
    assert_eq!(left_out, ["replicate"]);
    let model = RobotModel::new(&urdf, &["left_elbow", "right_elbow"]).unwrap();
    let place = |link: &str| {
        let at = model.link_poses(&[0.0; 2])[model.link(link).unwrap()];
        (at * Point3::origin()).coords
    };
    assert!((place("left_lower_arm") - Vector3::new(0.0, 0.15, -0.1)).norm() < 1e-6);
    assert!((place("right_lower_arm") - Vector3::new(0.0, -0.15, -0.1)).norm() < 1e-6);
    // The left arm is turned by its frame: its shoulder's axis y is -x of the torso.
    let turned = model.link_poses(&[0.0; 2])[model.link("left_upper_arm").unwrap()];
    assert!((turned * Vector3::y() + Vector3::x()).norm() < 1e-6);
    assert!(urdf.contains("-1.57"), "the class of the frame gives the elbow its range: {urdf}");
    let body = guess_body(&text, &no_meshes).unwrap();
    assert_eq!(body.parts.left_elbow.as_deref(), Some("left_lower_arm"));
}

/// Simulators read what XML forbids: `--` in a comment, blank lines before `<?xml`.
#[test]
fn xml_that_simulators_read_is_read_and_said() {
    let strict = Robot::op3().urdf;
    let bare = &strict[strict.find("<robot").unwrap()..];
    let loose = format!("\n\n<?xml version=\"1.0\"?>\n<!-- a -- b --->\n{bare}");
    let found = lint(&loose);
    let codes: Vec<&str> = found.iter().map(|found| found.code.as_str()).collect();
    assert_eq!(codes, ["xml-loose"]);
    let mjcf = "<!-- -- --><mujoco><worldbody><body name=\"base\"/></worldbody></mujoco>";
    assert_eq!(urdf_from_mjcf(mjcf).unwrap().1[0].code.as_str(), "xml-loose");
}
