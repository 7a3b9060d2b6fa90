//! `servodance doctor`.

use crate::cli::prelude::*;
use servodance_runtime::doctor::{Finding, Verdict, examine, servos};
use servodance_runtime::pipeline::conditioning::Conditioning;
use servodance_runtime::pipeline::model_args::EngineArgs;
use servodance_runtime::session::dance::open_generator;

const EXAMPLES: &str = include_str!("examples/doctor.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    pub robot: RobotFileArgs,
    /// Ask the servos too: serial:PATH; NAME=... for each bus of a robot with several.
    #[arg(long, value_name = "BUS")]
    pub bus: Vec<String>,
    /// Weights to use in place of the built-in ones.
    #[arg(long, value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,
    /// Encodec's model.safetensors, for weights that hear through it.
    #[arg(long, value_name = "FILE.safetensors")]
    pub encodec: Option<PathBuf>,
    /// Print the findings as JSON: area, verdict (good, warning, bad), what, remedy.
    #[arg(long)]
    pub json: bool,
}

/// Prints what was found; fails where a dance is not possible.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = args.robot.load()?;
    let generator = open_generator(args.model.as_deref(), EngineArgs::default())?;
    let conditioning = Conditioning { encodec: args.encodec, ..Conditioning::default() };
    let encodec = conditioning.encodec(&generator)?;
    let mut findings = examine(&robot, &generator, encodec.as_ref())?;
    if !args.bus.is_empty() {
        findings.extend(servos(&robot, &args.bus)?);
    }
    if args.json {
        stdout_line!("{}", serde_json::to_string_pretty(&findings)?);
    } else {
        for finding in &findings {
            print(finding);
        }
    }
    let bad = findings.iter().any(|f| f.verdict == Verdict::Bad);
    Ok(match bad {
        true => ExitCode::FAILURE,
        false => ExitCode::SUCCESS,
    })
}

fn print(finding: &Finding) {
    let mark = match finding.verdict {
        Verdict::Good => "ok     ",
        Verdict::Warning => "warning",
        Verdict::Bad => "BAD    ",
    };
    stdout_line!("{mark}  {:<10}{}", finding.area, finding.what);
    if let Some(remedy) = &finding.remedy {
        stdout_line!("{:21}-> {remedy}", "");
    }
}
