//! `robot new`: a complete robot file from a description alone.
//!
//! Guesses are explained as comments where they stand; what was tried before
//! it was written down is said with its figures. The file loads and dances in
//! simulation as it is; the servos are placeholders to fill in.

use super::copies::Copies;
use super::homes::Homes;
use super::servos::{ServoDraft, servo_drafts};
use super::text;
use crate::follow::{Followed, follow};
use crate::output::write_whole;
use crate::robot::{Robot, RobotError};
use anyhow::{Context, bail};
use servodance_model::motion::Clip;
use servodance_retarget::{
    Code, Draft, Finding, Role, Severity, Stance, draft, is_mjcf, lint, rest_deg, urdf_from_mjcf,
};
use std::path::{Path, PathBuf};

/// Baud rates and control rates that are tried until the servos fit.
const RATES: [(u32, f64); 5] = [
    (1_000_000, 100.0),
    (2_000_000, 100.0),
    (4_000_000, 100.0),
    (4_000_000, 50.0),
    (4_000_000, 20.0),
];
/// How far a robot that stands sinks at rest, as shares of its leg length:
/// tried in turn.
const CROUCHES: [f64; 3] = [0.05, 0.12, 0.2];
/// Share of cycles that may go wrong before a robot is put on a stand.
const TOLERATED: f64 = 1e-3;

/// A robot file that was written.
#[derive(Clone, Debug)]
pub struct NewRobot {
    /// The files, robot file first.
    pub files: Vec<PathBuf>,
    /// What was seen and done, a line each.
    pub lines: Vec<String>,
}

/// Writes a robot file for a description.
///
/// # Errors
/// A description that is refused (each reason named), a file that is there
/// already (unless `force`), or what cannot be written.
pub fn new_robot(
    description: &Path,
    out: &Path,
    force: bool,
    trial: &Clip,
) -> anyhow::Result<NewRobot> {
    if out.extension().is_none_or(|extension| extension != "toml") {
        bail!("{}: a robot file ends in .toml", out.display());
    }
    if out.exists() && !force {
        bail!("{} is there already; --force overwrites it", out.display());
    }
    let source = std::fs::read_to_string(description)
        .with_context(|| format!("cannot read {}", description.display()))?;
    let findings = lint(&source);
    if let Some(refused) = findings.iter().find(|f| f.severity == Severity::Refused) {
        bail!(
            "{}: {} `{}`: {} (all findings: servodance robot check)",
            description.display(),
            refused.code,
            refused.subject,
            refused.message
        );
    }
    let (urdf, source, copies) = beside(description, source, out)?;
    let there = copies.iter().flat_map(Copies::places).find(|p| p.exists());
    if let Some(there) = there.filter(|_| !force) {
        bail!(
            "{} is there already; --force overwrites it",
            there.display()
        );
    }
    let mut draft = draft(&source)?;
    let (servos, left_out) = servo_drafts(&draft.joints);
    if servos.is_empty() {
        bail!(
            "{}: no joint can have a servo ({})",
            description.display(),
            left_out.join("; ")
        );
    }
    let mut plan = Plan {
        name: stem(out),
        source: source.as_str(),
        trial,
        urdf,
        draft: &mut draft,
        servos,
        left_out,
        findings,
        rates: RATES[0],
        rest: Vec::new(),
        tried: Vec::new(),
    };
    plan.settle()?;
    let (mut files, mut lines) = (vec![out.to_owned()], Vec::new());
    if let Some(copies) = copies {
        copies.write()?;
        files.extend(copies.places());
        lines.extend(copies.lines());
    }
    write_whole(out, plan.text().as_bytes())?;
    lines.extend(plan.summary(out));
    Ok(NewRobot { files, lines })
}

/// What the robot file calls the description, its text, and what must be copied
/// so that all lies in the robot file's folder.
fn beside(
    description: &Path,
    source: String,
    out: &Path,
) -> anyhow::Result<(String, String, Option<Copies>)> {
    let folder = out.parent().unwrap_or(Path::new(""));
    let copies = if is_mjcf(&source) {
        Copies::of_text(&urdf_from_mjcf(&source)?.0, out)
    } else if let Some(relative) = Homes::of_file(folder).relative(description) {
        return Ok((relative, source, None));
    } else {
        Copies::of(description, &source, out)?
    };
    let name = out.with_extension("urdf");
    let name = name.file_name().unwrap_or_default().to_string_lossy();
    Ok((name.into_owned(), copies.text.clone(), Some(copies)))
}

/// Everything that goes into the file.
pub(super) struct Plan<'a> {
    pub name: String,
    source: &'a str,
    /// The dance that the robot is tried with.
    trial: &'a Clip,
    pub urdf: String,
    pub draft: &'a mut Draft,
    pub servos: Vec<ServoDraft>,
    pub left_out: Vec<String>,
    pub findings: Vec<Finding>,
    /// Baud and control rate.
    pub rates: (u32, f64),
    /// Rest positions, degrees.
    pub rest: Vec<(String, f64)>,
    /// What trials showed, a line each.
    pub tried: Vec<String>,
}

impl Plan<'_> {
    /// Finds rates that the bus can carry and a stance that holds in a dance.
    fn settle(&mut self) -> anyhow::Result<()> {
        if self.draft.config.stance == Stance::Planted {
            match self.stand()? {
                Ok(line) => self.tried.push(line),
                Err(why) => {
                    let line = format!("planted was tried and given up ({why}): hung on a stand");
                    self.tried.push(line);
                    self.draft.config.stance = Stance::Hung;
                }
            }
        }
        let robot = self.fitting_robot()??;
        self.rest = rest_deg(
            &robot.urdf_xml,
            &robot.retarget,
            &robot.joint_limits(),
            robot.control_hz,
        )?;
        let followed = self.dance(&self.parse()?)?;
        let duration_s = self.trial.frames().len() as f64 / servodance_types::FRAME_RATE_HZ;
        self.tried.push(danced(&followed, duration_s));
        Ok(())
    }

    /// Whether the robot can stay on its feet, and why not.
    fn stand(&mut self) -> anyhow::Result<Result<String, String>> {
        let mut verdict = Err(String::new());
        for crouch in CROUCHES {
            self.draft.config.crouch = crouch;
            verdict = match self.fitting_robot()? {
                Ok(robot) => stands(&self.dance(&robot)?),
                Err(error) => Err(format!("{error:#}")),
            };
            if verdict.is_ok() {
                break;
            }
        }
        Ok(verdict)
    }

    /// The robot at the first rates that the bus carries; the inner error is
    /// of the robot, the outer of the rates.
    fn fitting_robot(&mut self) -> anyhow::Result<anyhow::Result<Robot>> {
        for rates in RATES {
            self.rates = rates;
            match self.parse() {
                Err(error) if code(&error) == Some(Code::BusRate) => {}
                other => return Ok(other),
            }
        }
        bail!("{} servos are too many for one bus", self.servos.len())
    }

    fn dance(&self, robot: &Robot) -> anyhow::Result<Followed> {
        follow(robot, &self.trial.frames(), |_, _| Ok(()))
    }

    fn parse(&self) -> anyhow::Result<Robot> {
        Robot::from_toml(&self.text(), "the new robot file", |_| {
            Ok(self.source.to_owned())
        })
    }

    /// The file.
    fn text(&self) -> String {
        text::robot_file(self)
    }

    fn summary(&self, out: &Path) -> Vec<String> {
        let mut lines: Vec<String> = self.draft.reasons.clone();
        lines.extend(text::parts(&self.draft.config.body));
        lines.extend(
            self.draft
                .missing
                .iter()
                .map(|missing| format!("missing: {missing}")),
        );
        let held = self.servos.iter().filter(|servo| servo.role == Role::Held);
        let held: Vec<&str> = held.map(|servo| servo.name.as_str()).collect();
        if !held.is_empty() {
            lines.push(format!("held at rest: {}", held.join(", ")));
        }
        lines.extend(
            self.left_out
                .iter()
                .map(|joint| format!("no servo: {joint}")),
        );
        let odd = self.findings.iter();
        lines.extend(odd.map(|finding| format!("found: {finding}")));
        lines.extend(self.tried.iter().map(|line| format!("tried: {line}")));
        lines.push(format!(
            "{} servos are placeholders: fill in id, model, direction and zero_deg, then",
            self.servos.len()
        ));
        lines.push(format!("  servodance dance --robot {}", out.display()));
        lines
    }
}

fn code(error: &anyhow::Error) -> Option<Code> {
    error.downcast_ref::<RobotError>().map(|error| error.code)
}

/// Whether a robot on its feet kept them and its balance.
fn stands(followed: &Followed) -> Result<String, String> {
    let share = |count: u64| count as f64 / followed.cycles.max(1) as f64;
    let (feet, balance) = (
        share(followed.counts.feet_moved_cycles),
        share(followed.counts.unbalanced_cycles),
    );
    if feet > TOLERATED {
        return Err(format!("a foot slipped in {:.1} % of cycles", feet * 100.0));
    }
    if balance > TOLERATED {
        return Err(format!(
            "out of balance in {:.1} % of cycles",
            balance * 100.0
        ));
    }
    Ok("planted: both feet stay and the balance is kept".into())
}

fn danced(followed: &Followed, duration_s: f64) -> String {
    let broken = followed.violations;
    let median = Followed::quantile(&followed.direction_errors_deg, 0.5);
    let arms = match followed.direction_errors_deg.is_empty() {
        true => "no arms to compare".into(),
        false => format!("arms point within {median:.0} degrees of the dancer's (median)"),
    };
    format!(
        "{duration_s:.0} s of dance: {} limits broken, {} cycles with an arm touching the body; {arms}",
        broken.position + broken.velocity + broken.acceleration,
        followed.counts.collision_cycles,
    )
}

/// A name for the robot from that of its file.
fn stem(out: &Path) -> String {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let plain: String = stem.chars().filter(|c| !c.is_control()).collect();
    if plain.is_empty() {
        "robot".into()
    } else {
        plain
    }
}
