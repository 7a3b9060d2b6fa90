//! Defects as they are found in public descriptions: each has its code, and
//! names joint or link.

use servodance_retarget::{Diagnostic, DiagnosticCode, DiagnosticSeverity, RobotModel, lint};

/// A description whose one moving joint `turn` and whose link `arm` hold this.
fn urdf(joint_type: &str, joint: &str, link: &str, more: &str) -> String {
    format!(
        r#"<robot name="r"><link name="base">{MASS}</link><link name="arm">{link}</link>
        <joint name="turn" type="{joint_type}"><parent link="base"/><child link="arm"/>
        {joint}</joint>{more}</robot>"#
    )
}

const MASS: &str = r#"<inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>"#;
const AXIS: &str = r#"<axis xyz="0 0 1"/>"#;
const GOOD: &str = r#"<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="2" velocity="3"/>"#;

fn found(text: &str, code: DiagnosticCode) -> Diagnostic {
    let findings = lint(text);
    let finding = findings.iter().find(|finding| finding.code == code);
    finding.unwrap_or_else(|| panic!("no {code} in {findings:#?} of {text}")).clone()
}

fn limit(lower: &str, upper: &str, effort: &str, velocity: &str) -> String {
    format!(
        r#"{AXIS}<limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="{velocity}"/>"#
    )
}

#[test]
fn a_good_description_has_no_findings() {
    let mut found = lint(&urdf("revolute", GOOD, MASS, ""));
    // One arm without a partner shows no forward.
    found
        .retain(|f| ![DiagnosticCode::ForwardAssumed, DiagnosticCode::PartsNone].contains(&f.code));
    assert_eq!(found, []);
}

#[test]
fn joints_of_public_descriptions_are_named_with_their_values() {
    let pi = "3.14159";
    for (kind, joint, code, says) in [
        ("revolute", limit("-1", "1", "2", "100"), DiagnosticCode::VelocityPlaceholder, "100"),
        ("revolute", limit("-1", "1", "2", "0"), DiagnosticCode::VelocityUnset, "0"),
        ("revolute", limit("-1", "1", "2", "0.5"), DiagnosticCode::VelocitySlow, "0.5 rad/s"),
        ("revolute", limit("-1", "1", "1000", "3"), DiagnosticCode::EffortPlaceholder, "1000"),
        ("revolute", limit("-1", "1", "0", "3"), DiagnosticCode::EffortUnset, "0"),
        (
            "revolute",
            limit("-2.8274", "2.8274", "2", "3"),
            DiagnosticCode::RangePlaceholder,
            "0.90 pi",
        ),
        ("revolute", limit("-3.14159", pi, "2", "3"), DiagnosticCode::RangePlaceholder, "1.00 pi"),
        ("revolute", limit("-2.5", "3.1", "2", "3"), DiagnosticCode::RangeWide, "321 degrees"),
        ("revolute", limit("1", "-1", "2", "3"), DiagnosticCode::RangeInverted, "exchanged"),
        ("revolute", limit("2", "1", "2", "3"), DiagnosticCode::RangeUnusable, "lower limit 2"),
        ("revolute", limit("0.5", "1", "2", "3"), DiagnosticCode::ZeroOutside, "0.5 to 1"),
        ("revolute", limit("0", "0", "2", "3"), DiagnosticCode::RangeUnset, "both"),
        ("revolute", limit("-inf", "1", "2", "3"), DiagnosticCode::NumberUnusable, "-inf"),
        ("revolute", limit("-1", "one", "2", "3"), DiagnosticCode::NumberUnreadable, "one"),
        ("revolute", AXIS.into(), DiagnosticCode::VelocityUnset, "0"),
        ("revolute", r#"<axis xyz="0 0 0"/>"#.into(), DiagnosticCode::AxisZero, "0 0 0"),
        ("revolute", r#"<axis xyz="0 1 1"/>"#.into(), DiagnosticCode::AxisTilted, "45 degrees"),
        ("revolute", r#"<axis xyz="0 1"/>"#.into(), DiagnosticCode::NumberUnreadable, "3 number"),
        ("revolute", "<axis/>".into(), DiagnosticCode::AxisUnset, "1 0 0"),
        ("revolute", format!("{AXIS}{AXIS}"), DiagnosticCode::ElementTwice, "<axis>"),
        ("continuous", GOOD.into(), DiagnosticCode::JointContinuous, "without end"),
        ("prismatic", GOOD.into(), DiagnosticCode::JointPrismatic, "held"),
        ("hinge", GOOD.into(), DiagnosticCode::TypeUnknown, "hinge"),
        ("revolute", format!("{GOOD}<mimic joint='x'/>"), DiagnosticCode::MimicUnknown, "`x`"),
        ("revolute", format!("{GOOD}<mimic joint='turn'/>"), DiagnosticCode::MimicCircle, "circle"),
        (
            "revolute",
            format!(
                "{AXIS}<limit lower='-1' upper='1' effort='1' velocity='1' acceleration='9' jerk='5'/>"
            ),
            DiagnosticCode::LimitExtended,
            "acceleration 9",
        ),
    ] {
        let finding = found(&urdf(kind, &joint, MASS, ""), code);
        assert_eq!(finding.subject, "turn", "{finding}");
        assert!(finding.message.contains(says), "{finding}");
    }
}

#[test]
fn links_of_public_descriptions_are_named_with_their_values() {
    let mesh = r#"<mesh filename="a.stl"/>"#;
    let shape = |inside: &str| format!("<visual><geometry>{inside}</geometry></visual>");
    let mass = |kg: &str| MASS.replace("value=\"1\"", &format!("value=\"{kg}\""));
    let small = shape(r#"<box size="0.01 0.01 0.01"/>"#);
    for (link, code, says) in [
        (shape(&mesh.repeat(2)), DiagnosticCode::GeometryTwo, "the first"),
        (shape(""), DiagnosticCode::GeometryUnreadable, "nothing"),
        (shape("<mesh/>"), DiagnosticCode::GeometryUnreadable, "mesh"),
        (shape("<box size='1 x 1'/>"), DiagnosticCode::GeometryUnreadable, "box"),
        (mass("-1"), DiagnosticCode::MassUnusable, "-1"),
        (mass("NaN"), DiagnosticCode::MassUnusable, "NaN"),
        (mass("1e9"), DiagnosticCode::MassUnusable, "1000000000"),
        (format!("{small}{MASS}"), DiagnosticCode::MassAbsurd, "heavier than lead"),
        (
            "<inertial><mass value='1'/></inertial>".into(),
            DiagnosticCode::InertialIncomplete,
            "inertia",
        ),
        (MASS.replace("izz=\"0.1\"", "izz=\"9\""), DiagnosticCode::InertiaAbsurd, "9"),
    ] {
        let finding = found(&urdf("revolute", GOOD, &link, ""), code);
        assert_eq!(finding.subject, "arm", "{finding}");
        assert!(finding.message.contains(says), "{finding}");
    }
}

#[test]
fn what_stands_around_is_found_as_well() {
    let texture = "<visual><geometry><sphere radius='0.1'/></geometry>\
        <material name='skin'><texture/></material></visual>";
    let floating = "<link name='world'/><joint name='free' type='floating'>\
        <parent link='world'/><child link='base'/></joint>";
    let fixed_mimic = "<link name='c'/><joint name='still' type='fixed'>\
        <parent link='arm'/><child link='c'/><mimic joint='turn'/></joint>";
    let camera = format!(
        "<link name='camera'/><joint name='look' type='revolute'><parent link='arm'/>\
         <child link='camera'/><axis xyz='0 0 0'/>{}</joint>",
        limit("-1", "1", "1", "1").replace(AXIS, "")
    );
    let loop_joint = "<joint name='back' type='revolute'><parent link='base'/>\
        <child link='arm'/><axis xyz='0 0 1'/></joint>";
    for (link, more, code, subject) in [
        (texture, "", DiagnosticCode::TextureUnnamed, "skin"),
        (MASS, floating, DiagnosticCode::RootFloating, "free"),
        (MASS, fixed_mimic, DiagnosticCode::MimicOnFixed, "still"),
        (MASS, loop_joint, DiagnosticCode::ParentsTwo, "robot"),
        (MASS, "<link name='alone'/>", DiagnosticCode::RootsMany, "robot"),
        (MASS, "<gazebo:plugin a='b'/>", DiagnosticCode::PrefixUndeclared, "gazebo"),
        (MASS, "<link/>", DiagnosticCode::NameMissing, "robot"),
        (MASS, "<xacro:include/>", DiagnosticCode::Xacro, "robot"),
        (MASS, &camera, DiagnosticCode::AxisZeroEnd, "look"),
    ] {
        let finding = found(&urdf("revolute", GOOD, link, more), code);
        assert_eq!(finding.subject, subject, "{finding}");
    }
}

/// As exporters write it: includes of colours, transmissions and the simulator's settings, and
/// macros that write those.
#[test]
fn a_xacro_is_read_where_nothing_in_it_adds_parts() {
    const COLOURS: &str = "<xacro:include filename='$(find my_robot)/urdf/materials.xacro'/>";
    let finding = found(&urdf("revolute", GOOD, MASS, COLOURS), DiagnosticCode::XacroInclude);
    assert_eq!(finding.subject, "$(find my_robot)/urdf/materials.xacro", "{finding}");
    const MOTOR: &str = "<xacro:macro name='motor' params='name'><transmission name='t'>\
        <joint name='${name}'/></transmission></xacro:macro><xacro:motor name='turn'/>";
    assert!(RobotModel::new(&urdf("revolute", GOOD, MASS, MOTOR), &["turn"]).is_ok());
    const HAND: &str = "<xacro:macro name='hand'><link name='hand'/></xacro:macro>";
    let in_link = MASS.to_owned() + "<xacro:motor name='turn'/>";
    for (link, more) in [
        (MASS, "<xacro:include filename='arm.urdf.xacro'/>"),
        (MASS, "<xacro:motor name='turn'/>"),
        (MASS, HAND),
        (&in_link, MOTOR),
    ] {
        let finding = found(&urdf("revolute", GOOD, link, more), DiagnosticCode::Xacro);
        assert_eq!(finding.subject, "robot", "{finding}");
    }
}

/// As TurtleBot3, Bioloid and Wolfgang have it: names and numbers by xacro's properties, a
/// condition around the simulator's settings, a call of a macro for them.
#[test]
fn values_of_a_xacro_are_put_in() {
    const VALUES: &str = "<xacro:arg name='prefix' default=''/>\
        <xacro:property name='ns' value='$(arg prefix)'/><xacro:property name='w' value='0.2'/>\
        <xacro:if value='${sim == True}'><gazebo/></xacro:if><xacro:arm_gazebo prefix='l'/>\
        <link name='${ns}tool'/><joint name='hold' type='fixed'><parent link='${ns}arm'/>\
        <child link='${ns}tool'/><origin xyz='0 0 ${w / 2}' rpy='${pi/2} 0 0'/></joint>";
    let model = RobotModel::new(&urdf("revolute", GOOD, MASS, VALUES), &["turn"]);
    assert!(model.is_ok_and(|model| model.link_names().iter().any(|link| link == "tool")));
    for (written, unknown) in [("${w / 2}", "${w / n}"), ("<gazebo/>", "<link name='more'/>")] {
        let text = urdf("revolute", GOOD, MASS, &VALUES.replace(written, unknown));
        assert_eq!(found(&text, DiagnosticCode::Xacro).subject, "robot", "{unknown}");
    }
}

/// As an industrial arm whose axes are S, L, U, R, B and T.
#[test]
fn letters_of_one_chain_are_no_sides() {
    let joint = |name: &str, parent: &str, upper: &str| {
        format!(
            "<link name='{name}'/><joint name='joint_{name}' type='revolute'>\
             <parent link='{parent}'/><child link='{name}'/>{}</joint>",
            limit("-1", upper, "2", "3")
        )
    };
    let sides = |parent: &str| {
        let more = joint("l", "arm", "1") + &joint("r", parent, "2");
        lint(&urdf("revolute", GOOD, MASS, &more))
            .iter()
            .any(|finding| finding.code == DiagnosticCode::SidesDiffer)
    };
    assert!(sides("arm") && !sides("l"));
}

#[test]
fn what_stands_behind_the_robot_is_passed_over() {
    let text = urdf("revolute", GOOD, MASS, "") + "\n\u{0} trailing";
    assert_eq!(found(&text, DiagnosticCode::TextBehind).subject, "robot");
    assert!(RobotModel::new(&text, &["turn"]).is_ok());
}

#[test]
fn what_is_repaired_builds_and_what_is_refused_does_not() {
    for joint in [GOOD.to_owned(), limit("1", "-1", "1", "1"), limit("2", "1", "1", "1")] {
        let text = urdf("revolute", &joint, "", "");
        let refused = lint(&text).iter().any(|f| f.severity == DiagnosticSeverity::Refused);
        assert_eq!(RobotModel::new(&text, &[]).is_err(), refused, "{text}");
    }
}

#[test]
fn vectors_with_commas_are_read_and_said_and_decimal_commas_are_refused() {
    let joint = |xyz: &str| GOOD.replacen("<axis", &format!("<origin xyz=\"{xyz}\"/><axis"), 1);
    let text = |xyz: &str| urdf("revolute", &joint(xyz), MASS, "");
    for xyz in ["0.1, 0.2, 0.3", "0.1,0.2,0.3"] {
        let finding = found(&text(xyz), DiagnosticCode::NumberCommas);
        assert!(finding.message.contains(xyz), "{finding:?}");
        assert_eq!(finding.severity, DiagnosticSeverity::Repaired);
        let model = RobotModel::new(&text(xyz), &["turn"]).unwrap();
        let place = model.link_poses(&[0.0])[1].translation.vector;
        assert_eq!(<[f64; 3]>::from(place), [0.1, 0.2, 0.3]);
    }
    for xyz in ["0,1 0,2 0,3", "0,5 1", "1,2,3,4", "0.1,,0.3"] {
        found(&text(xyz), DiagnosticCode::NumberUnreadable);
    }
}
