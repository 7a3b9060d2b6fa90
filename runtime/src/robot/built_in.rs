//! Where the files of the built-in robots lie on this machine.

use servodance_robots::BuiltIn;
use std::path::{Path, PathBuf};

/// The robot file on this machine: beside an installed program, else in the source tree.
pub fn place_of(built_in: &BuiltIn) -> PathBuf {
    let program = std::env::current_exe().unwrap_or_default();
    let prefix = program.ancestors().nth(2).unwrap_or(Path::new(""));
    let installed = prefix.join("share/servodance/robots");
    let installed = installed.join(format!("{}.toml", built_in.name));
    match installed.is_file() {
        true => installed,
        false => built_in.file.into(),
    }
}
