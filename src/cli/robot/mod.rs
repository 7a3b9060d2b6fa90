//! `servodance robot`: write a robot file for a description, look one over, set its servos up.

pub mod setup;

use crate::cli::options::file_ending::file_of;
use crate::cli::prelude::*;
use servodance_retarget::{BodyKind, DraftOptions};
use servodance_runtime::offline::generate::{dances_of_built_in_song, trial_dances};
use servodance_runtime::physics::StanceCheck;
use servodance_runtime::robot::{self, BUILT_IN, Robot};
use servodance_runtime::telemetry::pending_file::write_whole;
use servodance_runtime::world::WorldChoice;
use servodance_training::choreography;

const EXAMPLES: &str = include_str!("../examples/robot.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    pub action: Action,
}

/// What can be done with a robot, before it dances.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
    /// Write a complete robot file for a description; guesses are explained in it.
    New(NewArgs),
    /// Draw robots in four poses beside the human in the same, a row each.
    Sheet(SheetArgs),
    /// Look over a robot file or a description: exit code 0 usable, 1 refused.
    Check(CheckArgs),
    /// Make new servos those of the robot, one after the other: id, rate, settings.
    Setup(setup::Args),
}

#[derive(Debug, clap::Args)]
pub struct NewArgs {
    /// The description: a URDF (a xacro must be expanded first) or an MJCF model.
    #[arg(value_name = "FILE")]
    pub description: PathBuf,
    /// The robot file to write.
    #[arg(long, value_name = "FILE.toml")]
    pub out: PathBuf,
    /// Overwrite it if it is there.
    #[arg(long)]
    pub force: bool,
    /// The kind of body, where the guess is wrong: humanoid, upper_body, biped, head, arm,
    /// quadruped or wheeled.
    #[arg(long, value_name = "KIND")]
    pub kind: Option<BodyKind>,
    /// Let the base turn on its wheels, too: each gets a servo. A base that is nothing but
    /// wheels turns without it.
    #[arg(long)]
    pub wheels: bool,
}

#[derive(Debug, clap::Args)]
pub struct SheetArgs {
    /// Robot files (.toml), or built-in robots.
    #[arg(value_name = "ROBOT", required = true)]
    pub robots: Vec<String>,
    /// The picture to write.
    #[arg(long, value_name = "FILE.png", value_parser = file_of("png"))]
    pub out: PathBuf,
}

#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    /// A robot file (.toml), a built-in robot, or a description (.urdf, .xml).
    #[arg(value_name = "FILE")]
    pub file: String,
    /// Print JSON: file, usable, findings (code, severity, subject, message), body: what a
    /// description looks like, and stance: what a robot on its feet can take.
    #[arg(long)]
    pub json: bool,
    /// Do not let a robot that stands on its feet stand, be pushed and dance in the
    /// simulated world.
    #[arg(long)]
    pub no_world: bool,
    /// Find the largest share of the dance that the robot can stand, and write it into
    /// its file (`arm_zmp_limit`, `[retarget.gain]`).
    #[arg(long)]
    pub amplitude: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.action {
        Action::New(args) => new(&args),
        Action::Sheet(args) => sheet(&args),
        Action::Check(args) => check(&args),
        Action::Setup(args) => setup::run(&args),
    }
}

fn new(args: &NewArgs) -> anyhow::Result<ExitCode> {
    robot::check_place(&args.out, args.force)?;
    let (trial, dances) = (choreography::trial_dance(), trial_dances()?);
    let options = DraftOptions { kind: args.kind, wheels: args.wheels };
    let written =
        robot::new_robot(&args.description, &args.out, args.force, options, &trial, &dances)?;
    for file in &written.files {
        stdout_line!("{}", file.display());
    }
    for line in &written.lines {
        stdout_line!("{line}");
    }
    Ok(ExitCode::SUCCESS)
}

fn sheet(args: &SheetArgs) -> anyhow::Result<ExitCode> {
    let robots: anyhow::Result<Vec<Robot>> = args.robots.iter().map(|r| Robot::load(r)).collect();
    write_whole(&args.out, &robot::pose_sheet(&robots?)?)?;
    stdout_line!("{}", args.out.display());
    Ok(ExitCode::SUCCESS)
}

fn check(args: &CheckArgs) -> anyhow::Result<ExitCode> {
    let mut checked = robot::check(&args.file);
    let is_there = Path::new(&args.file).exists() || BUILT_IN.iter().any(|b| b.name == args.file);
    if checked.usable
        && let Some(standing) = standing_robot(&args.file)
    {
        if args.amplitude {
            let line = robot::settle_amplitude(&args.file, &standing, &trial_dances()?)?;
            stderr_line!("{line}");
        }
        if !args.no_world {
            let robot = Robot::load(&args.file)?;
            checked.stance =
                Some(StanceCheck::of(&robot, &dances_of_built_in_song()?[0].frames())?);
        }
    } else if args.amplitude && is_there {
        anyhow::bail!("{}: --amplitude is for a robot that stands on its feet", args.file);
    }
    if args.json {
        stdout_line!("{}", serde_json::to_string_pretty(&checked)?);
    } else {
        for finding in &checked.findings {
            stdout_line!("{finding}");
        }
        if let Some(line) = checked.looks_like() {
            stdout_line!("{line}");
        }
        if let Some(stance) = &checked.stance {
            stdout_line!("{}", stance.line());
        }
        stdout_line!("{}", checked.verdict());
    }
    Ok(match checked.usable {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

/// A robot that can be put on its feet in the simulated world.
fn standing_robot(file: &str) -> Option<Robot> {
    let robot = Robot::load(file).ok()?;
    (WorldChoice::of_robot(&robot) == WorldChoice::Floor).then_some(robot)
}
