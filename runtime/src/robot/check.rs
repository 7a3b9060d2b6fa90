//! `robot check`: everything that is wrong or odd about a robot file or a
//! description, each with a stable code. Nothing here panics on any file.

use super::description_text::read_description;
use super::loaded::Robot;
use super::meshes::mesh_reader;
use super::robot_file::RobotError;
use crate::physics::StanceCheck;
use serde::Serialize;
use servodance_retarget::{
    BodyGuess, Diagnostic, DiagnosticCode, DiagnosticSeverity, guess_body, lint, lint_limits,
};
use std::path::Path;

/// What was found in one file.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the names say it
pub struct Checked {
    pub file: String,
    pub usable: bool,
    pub findings: Vec<Diagnostic>,
    /// What a description looks like; `None` for a robot file, which says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyGuess>,
    /// What it can take on its feet; `None` where that was not tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stance: Option<StanceCheck>,
}

impl Checked {
    fn new(file: &str, mut findings: Vec<Diagnostic>) -> Self {
        findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        Self {
            file: file.to_owned(),
            usable: is_usable(&findings),
            findings,
            body: None,
            stance: None,
        }
    }

    /// What it looks like, a line.
    pub fn looks_like(&self) -> Option<String> {
        let body = self.body.as_ref()?;
        let (kind, confidence) = (body.kind.name(), body.confidence);
        Some(format!(
            "looks like: {kind} (confidence {confidence}): {}; forward {}, up {}",
            body.reason, body.forward, body.up
        ))
    }

    /// The verdict in one line.
    pub fn verdict(&self) -> String {
        let count = |severity| {
            let of = |f: &&Diagnostic| f.severity == severity;
            self.findings.iter().filter(of).count()
        };
        format!(
            "{}: {}; {} refused, {} repaired, {} notes",
            self.file,
            if self.usable { "usable" } else { "refused" },
            count(DiagnosticSeverity::Refused),
            count(DiagnosticSeverity::Repaired),
            count(DiagnosticSeverity::Note)
        )
    }
}

fn is_usable(findings: &[Diagnostic]) -> bool {
    let mut severities = findings.iter().map(|finding| finding.severity);
    severities.all(|severity| severity != DiagnosticSeverity::Refused)
}

/// Checks a robot file (`.toml`), a built-in robot by name, or a description.
pub fn check(file: &str) -> Checked {
    let built_in = servodance_robots::built_in(file).is_some();
    let is_toml = Path::new(file).extension().is_some_and(|e| e == "toml");
    if built_in || is_toml {
        return Checked::new(file, check_robot(file));
    }
    match read_description(Path::new(file)) {
        Ok(text) => {
            let checked = Checked::new(file, lint(&text));
            let body = if checked.usable {
                guess_body(&text, &mesh_reader(Path::new(file)))
            } else {
                None
            };
            Checked { body, ..checked }
        }
        Err(error) => {
            let code = DiagnosticCode::FileUnreadable;
            Checked::new(file, vec![Diagnostic::new(code, file, format!("{error:#}"))])
        }
    }
}

/// Rest angles that are moved into the joint's limits by more than rounding.
fn rest_outside(robot: &Robot) -> impl Iterator<Item = Diagnostic> {
    const ROUNDING_DEG: f64 = 0.1;
    robot.retarget.rest_deg.iter().filter_map(|(name, degrees)| {
        let servo = robot.servos.iter().find(|servo| servo.name == *name)?;
        let used_deg = servo.limits.clamp_rad(degrees.to_radians()).to_degrees();
        let text = format!("rest_deg is {degrees} degrees, {used_deg:.1} is used");
        let moved = (used_deg - degrees).abs() > ROUNDING_DEG;
        moved.then(|| Diagnostic::new(DiagnosticCode::RestOutside, name, text))
    })
}

fn check_robot(file: &str) -> Vec<Diagnostic> {
    match Robot::load(file) {
        Ok(robot) => {
            let mut findings = lint(&robot.urdf_xml);
            // The robot file names the parts.
            findings.retain(|finding| finding.code != DiagnosticCode::PartsNone);
            findings.extend(lint_limits(&robot.urdf_xml, &robot.joint_limits()));
            findings.extend(rest_outside(&robot));
            findings
        }
        Err(error) => {
            let known = error.downcast_ref::<RobotError>();
            let code = known.map_or(DiagnosticCode::RobotFile, |e| e.code);
            // What is wrong with the description itself is told in full.
            let description = known.and_then(|e| e.urdf_xml.as_deref());
            let mut findings = description.map(lint).unwrap_or_default();
            if is_usable(&findings) {
                findings.push(Diagnostic::new(code, file, format!("{error:#}")));
            }
            findings
        }
    }
}
