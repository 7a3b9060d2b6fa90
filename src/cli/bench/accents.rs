//! `servodance bench accents`.

use crate::cli::prelude::*;
use servodance_lab::bench::accents::{self, AccentReport, StageShares};
use servodance_model::motion::Clip;
use servodance_runtime::offline::generate::dances_of_built_in_song;
use servodance_runtime::robot::BUILT_IN;

const EXAMPLES: &str = include_str!("../examples/bench-accents.txt").trim_ascii_end();

/// What `bench accents` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A built-in robot, or a robot file; every built-in one if left out.
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub robot: Option<String>,
    /// A motion (.npz, `positions` [T, 22, 3] in metres, y up, and `fps`); can be given
    /// several times. Dances of 20 s to the built-in song if left out.
    #[arg(long, value_name = "FILE.npz")]
    pub motion: Vec<PathBuf>,
    /// Print one JSON list.
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let names = match &args.robot {
        Some(name) => vec![name.clone()],
        None => BUILT_IN.iter().map(|robot| robot.name.to_owned()).collect(),
    };
    let clips = match args.motion.is_empty() {
        true => dances_of_built_in_song()?,
        false => args.motion.iter().map(Clip::read_npz).collect::<Result<_, _>>()?,
    };
    let clips: Vec<Clip> = clips.iter().map(Clip::normalised).collect();
    let mut reports = Vec::new();
    if !args.json {
        stdout_line!(
            "shares of a perfect robot's energy, accents (3 to 8 Hz) of arms | upper joints | all"
        );
    }
    for name in names {
        let report = accents::run(&Robot::load(&name)?, &clips)?;
        if !args.json {
            line(&report);
        }
        reports.push(report);
    }
    if args.json {
        stdout_line!("{}", serde_json::to_string(&reports)?);
    }
    Ok(ExitCode::SUCCESS)
}

fn line(report: &AccentReport) {
    let AccentReport { robot, arms, upper_joints, all_joints, violations } = report;
    let stage = |of: fn(&StageShares) -> (f64, f64)| {
        let cell = |shares: &Option<StageShares>| {
            shares.as_ref().map(of).map_or("     -".to_owned(), |(e, a)| format!("{e:.2}, {a:.2}"))
        };
        [arms, upper_joints, all_joints].map(cell).join(" | ")
    };
    let dancer = arms.and_then(|arms| arms.dancer);
    let dancer = dancer.map_or("-".to_owned(), |d| format!("{:.2}, {:.2}", d.energy, d.accents));
    stdout_line!("{robot:<10} dancer's arms {dancer}; {violations} limits broken");
    stdout_line!("           commands {}", stage(|s| (s.commands.energy, s.commands.accents)));
    stdout_line!("           servos   {}", stage(|s| (s.servos.energy, s.servos.accents)));
}
