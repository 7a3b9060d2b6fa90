//! `servodance servos`: the settings of a robot's servos, and the registers of single ones.

pub mod backup;
pub mod check;
pub mod factory_reset;
pub mod read;
pub mod restore;
pub mod watch;
pub mod write;

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::memory::ServoPlaces;

const EXAMPLES: &str = include_str!("../examples/servos.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    pub action: Action,
}

/// What can be done with servos. Torque is never turned on.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
    /// Compare the settings in the servos with the robot file: exit code 0 as they should
    /// be, 1 not.
    Check(check::Args),
    /// Read registers by name, with their units; all of them if none is named.
    Read(read::Args),
    /// Write registers by name, and read each back.
    Write(write::Args),
    /// Write what the servos keep for good into a file.
    Backup(backup::Args),
    /// Write a backup back: what differs is shown, asked about, written and read back.
    Restore(restore::Args),
    /// Put one servo back as it left the factory.
    FactoryReset(factory_reset::Args),
    /// Show position, velocity, current, voltage, temperature and errors, ten times a second.
    Watch(watch::Args),
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.action {
        Action::Check(args) => check::run(args),
        Action::Read(args) => read::run(args),
        Action::Write(args) => write::run(args),
        Action::Backup(args) => backup::run(args),
        Action::Restore(args) => restore::run(args),
        Action::FactoryReset(args) => factory_reset::run(args),
        Action::Watch(args) => watch::run(args),
    }
}

/// Which servos: those of a robot, or whoever is on a port.
#[derive(Debug, clap::Args)]
pub struct PlacesArgs {
    /// A serial port; with --bus a built-in robot or a robot file.
    #[arg(value_name = "ROBOT|PORT")]
    pub which: String,
    /// Where the robot's servos are: serial:PATH; NAME=... for each bus of a robot with
    /// several.
    #[arg(long, value_name = "BUS")]
    pub bus: Vec<String>,
    /// Only this baud rate of the port.
    #[arg(long, value_name = "BAUD")]
    pub baud: Option<u32>,
}

impl PlacesArgs {
    fn open(&self) -> anyhow::Result<ServoPlaces> {
        ServoPlaces::new(&self.which, &self.bus, self.baud)
    }
}
