//! `robot new`: a complete robot file from a description alone.
//!
//! Guesses are explained as comments where they stand; what was tried before
//! it was written down is said with its figures. The file loads and dances in
//! simulation as it is; the servos are placeholders to fill in.

mod description_copy;
mod file_text;
mod servo_draft;
mod trials;

use self::description_copy::DescriptionCopy;
use self::file_text::{FilePlan, parts, robot_file};
use self::servo_draft::servo_drafts;
use self::trials::RATES;
use crate::physics::TrialDance;
use crate::robot::description_text::read_description;
use crate::robot::loaded::Robot;
use crate::robot::meshes::mesh_reader;
use crate::robot::pose_sheet::pose_sheet;
use crate::robot::robot_folders::RobotFolders;
use crate::telemetry::pending_file::write_whole;
use anyhow::{anyhow, bail};
use servodance_model::motion::Clip;
use servodance_retarget::{
    Diagnostic, DiagnosticCode, DiagnosticSeverity, DraftOptions, JointUse, draft_config, is_mjcf,
    lint, urdf_from_mjcf,
};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A robot file that was written.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // the names say it
pub struct NewRobot {
    pub files: Vec<PathBuf>,
    pub lines: Vec<String>,
}

/// Writes a robot file for a description. Refuses a description with a fatal
/// finding, a file that is there already unless `force` is set, and a robot that cannot
/// show a dance. `trial` is danced by its kinematics, `dances` in the simulated world.
pub fn new_robot(
    description: &Path,
    out: &Path,
    force: bool,
    options: DraftOptions,
    trial: &Clip,
    dances: &[TrialDance],
) -> anyhow::Result<NewRobot> {
    check_place(out, force)?;
    let source = read_description(description)?;
    let findings = lint(&source);
    // Whoever gives the kind knows of parts that were not found.
    let told = |f: &&Diagnostic| options.kind.is_some() && f.code == DiagnosticCode::PartsNone;
    let mut refused = findings.iter().filter(|f| f.severity == DiagnosticSeverity::Refused);
    if let Some(refused) = refused.find(|f| !told(f)) {
        bail!(
            "{}: {} `{}`: {} (all findings: servodance robot check)",
            description.display(),
            refused.code,
            refused.subject,
            refused.message
        );
    }
    let is_converted = is_mjcf(&source);
    let source = if is_converted { urdf_from_mjcf(&source)?.0 } else { source };
    let folders = RobotFolders::of_file(out.parent().unwrap_or(Path::new("")));
    let in_place = folders.relative(description).filter(|_| !is_converted);
    let (urdf, text, copies) = match in_place {
        Some(relative) => (relative, source.clone(), None),
        None => {
            let copies = DescriptionCopy::of(description, &source, out)?;
            (copies.urdf_name(), copies.text.clone(), Some(copies))
        }
    };
    let there = copies.iter().flat_map(DescriptionCopy::places).find(|p| p.exists());
    if let Some(there) = there.filter(|_| !force) {
        bail!("{} is there already; --force overwrites it", there.display());
    }
    let picture = out.with_extension("png");
    if picture.exists() && !force {
        bail!("{} is there already; --force overwrites it", picture.display());
    }
    // In the copy meshes have other names, and are not there yet.
    let mut draft = draft_config(&source, options, &mesh_reader(description))
        .map_err(|error| anyhow!("{}: {error}", description.display()))?;
    let (servos, left_out) = servo_drafts(&draft.joints);
    if servos.is_empty() {
        bail!("{}: no joint can have a servo ({})", description.display(), left_out.join("; "));
    }
    let mut plan = FilePlan {
        name: stem(out),
        source: text.as_str(),
        trial,
        dances,
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
    write_whole(out, robot_file(&plan).as_bytes())?;
    let robot = Robot::load(&out.display().to_string())?;
    write_whole(&picture, &pose_sheet(&[robot])?)?;
    files.push(picture);
    lines.extend(summary(&plan, out));
    Ok(NewRobot { files, lines })
}

/// Refuses a place where no robot file can be written; of interest before dances are made.
pub fn check_place(out: &Path, force: bool) -> anyhow::Result<()> {
    if out.extension().is_none_or(|extension| extension != "toml") {
        bail!("{}: a robot file ends in .toml", out.display());
    }
    if out.exists() && !force {
        bail!("{} is there already; --force overwrites it", out.display());
    }
    Ok(())
}

fn summary(plan: &FilePlan, out: &Path) -> Vec<String> {
    let mut lines = vec![format!("kind: {}", plan.draft.kind_reason)];
    lines.extend(plan.draft.reasons.iter().cloned());
    lines.extend(parts(&plan.draft.config.body));
    lines.extend(labelled("missing", &plan.draft.missing));
    let servos = plan.servos.iter();
    let held = servos.filter(|servo| servo.role == JointUse::Held);
    let held: Vec<&str> = held.map(|servo| servo.name.as_str()).collect();
    if !held.is_empty() {
        lines.push(format!("held at rest: {}", held.join(", ")));
    }
    lines.extend(labelled("no servo", &plan.left_out));
    lines.extend(labelled("found", &plan.findings));
    lines.extend(labelled("tried", &plan.tried));
    lines.push(format!(
        "{} servos are placeholders: fill in id, model, direction and zero_deg, then",
        plan.servos.len()
    ));
    lines.push(format!("  servodance dance --robot {}", out.display()));
    lines
}

fn labelled<T: Display>(label: &str, lines: &[T]) -> impl Iterator<Item = String> {
    lines.iter().map(move |line| format!("{label}: {line}"))
}

fn stem(out: &Path) -> String {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let plain: String = stem.chars().filter(|c| !c.is_control()).collect();
    if plain.is_empty() { "robot".into() } else { plain }
}
