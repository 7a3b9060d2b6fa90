//! Rigs of every kind, made from parts: what they have dances, what they lack
//! is said, and the rest is held.

use servodance_retarget::DraftOptions;
use servodance_runtime::offline::motion_tracking::{TrackedMotion, track_motion};
use servodance_runtime::robot::Robot;
use servodance_runtime::robot::new_robot;
use servodance_runtime::telemetry::ViolationReport;
use servodance_training::choreography::trial_dance;
use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};
use std::fmt::Write;

/// Builds a URDF link by link.
pub(crate) struct Rig(String);

impl Rig {
    pub(crate) fn new() -> Self {
        Self("<robot name=\"rig\"><link name=\"base\"/>".into())
    }

    /// A link called after its joint.
    pub(crate) fn joint(
        mut self,
        kind: &str,
        name: &str,
        parent: &str,
        xyz: &str,
        more: &str,
    ) -> Self {
        let limit = "<limit lower=\"-1.5\" upper=\"1.5\" effort=\"3\" velocity=\"4\"/>";
        let _ = write!(
            self.0,
            "<link name=\"{name}_link\"><inertial><mass value=\"0.2\"/><inertia ixx=\"0.001\" \
             ixy=\"0\" ixz=\"0\" iyy=\"0.001\" iyz=\"0\" izz=\"0.001\"/></inertial></link>\
             <joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/>\
             <child link=\"{name}_link\"/><origin xyz=\"{xyz}\"/>{limit}{more}</joint>"
        );
        self
    }

    fn arm(self, side: &str, y: f64) -> Self {
        let name = |part: &str| format!("{side}_{part}");
        let link = |part: &str| format!("{side}_{part}_link");
        let at = format!("0 {y} 0.3");
        let (x, pitch) = ("<axis xyz=\"1 0 0\"/>", "<axis xyz=\"0 1 0\"/>");
        self.joint("revolute", &name("shoulder_pitch"), "base", &at, pitch)
            .joint("revolute", &name("shoulder_roll"), &link("shoulder_pitch"), "0 0 0", x)
            .joint("revolute", &name("elbow"), &link("shoulder_roll"), "0 0 -0.2", pitch)
            .joint("fixed", &name("hand"), &link("elbow"), "0 0 -0.2", "")
    }

    /// Gives a link that is there already another name.
    pub(crate) fn renamed(self, link: &str, name: &str) -> Self {
        Self(self.0.replace(&format!("\"{link}\""), &format!("\"{name}\"")))
    }

    /// The description so far.
    pub(crate) fn urdf(&self) -> String {
        self.0.clone() + "</robot>"
    }

    /// A wheel of 5 cm whose axle lies across, below the base.
    pub(crate) fn wheel(self, name: &str, xy: &str) -> Self {
        let across = "<axis xyz=\"0 1 0\"/>";
        let mut rig = self.joint("continuous", name, "base", &format!("{xy} -0.1"), across);
        let shape = "<collision><origin rpy=\"1.5708 0 0\"/><geometry><cylinder \
                     radius=\"0.05\" length=\"0.02\"/></geometry></collision></link><joint";
        let end = rig.0.rfind("</link><joint").expect("the wheel's link");
        rig.0.replace_range(end..end + "</link><joint".len(), shape);
        rig
    }

    /// Draws a robot file, then follows some seconds of dance.
    pub(crate) fn dance(self) -> (Robot, TrackedMotion, Vec<Vec<f64>>, Vec<String>) {
        self.dance_as(DraftOptions::default())
    }

    /// The same with a draft that is told more.
    pub(crate) fn dance_as(
        self,
        options: DraftOptions,
    ) -> (Robot, TrackedMotion, Vec<Vec<f64>>, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let urdf = folder.path().join("rig.urdf");
        std::fs::write(&urdf, self.urdf()).unwrap();
        let out = folder.path().join("rig.toml");
        let said = new_robot(&urdf, &out, false, options, &trial_dance(), &[]).unwrap().lines;
        let robot = Robot::load(&out.display().to_string()).unwrap();
        let beats: Vec<DanceBeat> = (0..20)
            .map(|beat| DanceBeat { time_s: f64::from(beat) * 0.5, downbeat: beat % 4 == 0 })
            .collect();
        let clip = choreograph(&beats, 10.0, DanceStyle::Disco, 1);
        let mut track = Vec::new();
        let followed = track_motion(&robot, &clip.frames(), |_, positions| {
            track.push(positions.to_vec());
            Ok(())
        });
        let followed = followed.unwrap();
        assert_eq!(followed.violations, ViolationReport::default());
        (robot, followed, track, said)
    }
}

/// How far each joint went, by name.
pub(crate) fn spans(robot: &Robot, track: &[Vec<f64>]) -> Vec<(String, f64)> {
    let span = |joint: usize| {
        let at = track.iter().map(|row| row[joint]);
        let low = at.clone().fold(f64::INFINITY, f64::min);
        at.fold(f64::NEG_INFINITY, f64::max) - low
    };
    let names = robot.servos.iter().map(|servo| servo.name.clone());
    names.enumerate().map(|(joint, name)| (name, span(joint))).collect()
}

pub(crate) fn moved(spans: &[(String, f64)], name: &str) -> f64 {
    spans.iter().find(|(joint, _)| joint == name).unwrap_or_else(|| panic!("{name}")).1
}

#[test]
fn arms_alone_dance() {
    let (robot, _, track, said) = Rig::new().arm("left", 0.15).arm("right", -0.15).dance();
    let spans = spans(&robot, &track);
    assert!(spans.iter().all(|(_, span)| *span > 0.05), "{spans:?}");
    for missing in ["no left leg", "no head or neck", "shoulder has 2 of 3"] {
        assert!(said.iter().any(|line| line.contains(missing)), "{missing}: {said:?}");
    }
}

#[test]
fn one_arm_is_enough() {
    let (robot, _, track, _) = Rig::new().arm("right", -0.15).dance();
    let spans = spans(&robot, &track);
    assert!(moved(&spans, "right_elbow") > 0.05, "{spans:?}");
}

#[test]
fn a_neck_alone_nods_and_turns() {
    let rig = Rig::new()
        .joint("revolute", "head_pan", "base", "0 0 0.1", "<axis xyz=\"0 0 1\"/>")
        .joint("revolute", "head_tilt", "head_pan_link", "0 0 0.02", "<axis xyz=\"0 1 0\"/>");
    let (robot, _, track, _) = rig.dance();
    assert!(spans(&robot, &track).iter().all(|(_, span)| *span > 0.03));
}

#[test]
fn wheels_and_sliders_get_no_servo_and_tails_are_held() {
    let y = "<axis xyz=\"0 1 0\"/>";
    let rig = Rig::new()
        .arm("left", 0.15)
        .arm("right", -0.15)
        .joint("continuous", "wheel_left", "base", "0 0.2 -0.3", y)
        .joint("continuous", "wheel_right", "base", "0 -0.2 -0.3", y)
        .joint("prismatic", "lift", "base", "0 0 -0.1", "<axis xyz=\"0 0 1\"/>")
        .joint("revolute", "tail", "base", "-0.2 0 0", y);
    let (robot, _, track, said) = rig.dance();
    let spans = spans(&robot, &track);
    assert!(moved(&spans, "tail") < 1e-3, "{spans:?}");
    assert!(!spans.iter().any(|(name, _)| name.contains("wheel") || name == "lift"));
    assert!(said.iter().any(|line| line.contains("held at rest: tail")), "{said:?}");
}

#[test]
fn followers_need_no_servo_and_keep_their_own_limits() {
    let mimic = "<axis xyz=\"0 1 0\"/><mimic joint=\"left_elbow\" multiplier=\"2\"/>";
    let rig = Rig::new().arm("left", 0.15).arm("right", -0.15).joint(
        "revolute",
        "left_rod",
        "left_elbow_link",
        "0 0 -0.1",
        mimic,
    );
    let (robot, _, track, _) = rig.dance();
    assert!(robot.servos.iter().all(|servo| servo.name != "left_rod"));
    let elbow = robot.servos.iter().position(|servo| servo.name == "left_elbow").unwrap();
    // The rod goes twice as far, and no farther than 1.5.
    assert!(track.iter().all(|row| row[elbow].abs() <= 0.7501));
}

#[test]
fn continuous_joints_do_not_jump() {
    let z = "<axis xyz=\"0 0 1\"/>";
    let rig = Rig::new().joint("continuous", "head_pan", "base", "0 0 0.1", z).joint(
        "revolute",
        "head_tilt",
        "head_pan_link",
        "0 0 0.02",
        "<axis xyz=\"0 1 0\"/>",
    );
    let (robot, _, track, _) = rig.dance();
    for pair in track.windows(2) {
        for ((before, after), servo) in pair[0].iter().zip(&pair[1]).zip(&robot.servos) {
            let most = servo.limits.velocity_rad_s * robot.period_s();
            assert!((after - before).abs() <= most * 1.000_001, "{}", servo.name);
        }
    }
}

#[test]
fn a_loop_is_expressed_by_a_table() {
    let y = "<axis xyz=\"0 1 0\"/>";
    let rig = Rig::new().arm("left", 0.15).arm("right", -0.15).joint(
        "revolute",
        "left_crank",
        "left_shoulder_roll_link",
        "0 0.02 0",
        y,
    );
    let folder = tempfile::tempdir().unwrap();
    let urdf = folder.path().join("rig.urdf");
    std::fs::write(&urdf, rig.0 + "</robot>").unwrap();
    let out = folder.path().join("rig.toml");
    new_robot(&urdf, &out, false, DraftOptions::default(), &trial_dance(), &[]).unwrap();
    let text = std::fs::read_to_string(&out).unwrap();
    let couple = "\n[[retarget.couple]]\njoint = \"left_crank\"\nfollows = \"left_elbow\"\n";
    let load = |text: String| {
        std::fs::write(&out, text).unwrap();
        Robot::load(&out.display().to_string())
    };
    // A joint that follows cannot have a servo as well.
    let message = load(format!("{text}{couple}")).unwrap_err().to_string();
    assert!(message.contains("left_crank") && message.contains("follows"), "{message}");
    let start = text.find("name = \"left_crank\"").unwrap();
    let start = text[..start].rfind("[[joint]]").unwrap();
    let end = text[start + 9..].find("[[joint]]").map_or(text.len(), |at| start + 9 + at);
    let rest = text[..start].to_owned() + &text[end..];
    let rest = rest.replace("\"left_crank\" = ", "# ").replace("left_crank = ", "# ");
    assert!(load(format!("{rest}{couple}")).is_ok());
    let wrong = couple.replace("left_elbow", "nothing");
    let message = load(format!("{rest}{wrong}")).unwrap_err().to_string();
    assert!(message.contains("no moving joint `nothing`"), "{message}");
}
