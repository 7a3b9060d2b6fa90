//! In place of the commands that need the feature `train`, in a build without it.

use std::ffi::OsString;
use std::process::ExitCode;

const EXAMPLES: &str = "Examples:
  cargo build --release --features train   # builds the program with this command";

/// Whatever the command is given.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Not looked at: this program was built without the feature `train`.
    #[arg(value_name = "ARGUMENTS", trailing_var_arg = true, allow_hyphen_values = true)]
    pub arguments: Vec<OsString>,
}

/// Says how to build it.
fn refused(command: &str) -> anyhow::Result<ExitCode> {
    anyhow::bail!("{command}: this program was built without training; build with --features train")
}

macro_rules! commands {
    ($($name:ident),*) => {$(
        #[doc = concat!("`servodance ", stringify!($name), "`.")]
        pub mod $name {
            pub use super::Args;

            /// Says how to build it.
            pub fn run(_: Args) -> anyhow::Result<std::process::ExitCode> {
                super::refused(stringify!($name))
            }
        }
    )*};
}

commands!(ablate, dataset, evaluate, reconstruct, train, weights);
