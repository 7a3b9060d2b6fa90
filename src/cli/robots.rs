//! `servodance robots`.

use crate::cli::options::file_ending::file_of;
use crate::cli::prelude::*;
use servodance_runtime::robot::BUILT_IN;

const EXAMPLES: &str = include_str!("examples/robots.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A built-in robot to copy.
    #[arg(value_name = "NAME", requires = "out")]
    pub name: Option<String>,
    /// The robot file to write for it, its URDF beside it: the beginning of a robot of your own.
    #[arg(long, value_name = "FILE.toml", requires = "name", value_parser = file_of("toml"))]
    pub out: Option<PathBuf>,
}

/// Prints the built-in robots, or writes the files of one.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match (&args.name, &args.out) {
        (Some(name), Some(out)) => copy(name, out)?,
        _ => list()?,
    }
    Ok(ExitCode::SUCCESS)
}

fn list() -> anyhow::Result<()> {
    for built_in in BUILT_IN {
        let robot = Robot::load(built_in.name)?;
        let (servos, hz) = (robot.servos.len(), robot.control_hz);
        stdout_line!("{:<12}{} ({servos} servos, {hz:.0} Hz)", robot.name, robot.description);
    }
    stdout_line!("\nYour own: servodance robots op3 --out my-robot.toml, or servodance robot new");
    Ok(())
}

fn copy(name: &str, out: &Path) -> anyhow::Result<()> {
    let Some(built_in) = BUILT_IN.iter().find(|built_in| built_in.name == name) else {
        let names: Vec<&str> = BUILT_IN.iter().map(|built_in| built_in.name).collect();
        bail!("unknown robot \"{name}\"; built in: {}", names.join(", "));
    };
    let urdf = Path::new(built_in.file).with_extension("urdf");
    let urdf = out.with_file_name(urdf.file_name().unwrap_or_default());
    for file in [out, &urdf] {
        anyhow::ensure!(!file.exists(), "{} is there already", file.display());
    }
    write_whole(&urdf, built_in.urdf.as_bytes())?;
    write_whole(out, built_in.toml.as_bytes())?;
    stdout_line!("{} and {}", out.display(), urdf.display());
    Ok(())
}
