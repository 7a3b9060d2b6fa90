//! The robots that come with servodance. To add one, put `NAME.toml` and
//! `NAME.urdf` into configs/ and `NAME` into [`BUILT_IN`] and into the list of the crate
//! `web/`, which a test holds against this one.

use std::path::{Path, PathBuf};

/// A robot that comes with servodance.
#[derive(Clone, Copy, Debug)]
pub struct BuiltIn {
    /// The name for `--robot`.
    pub name: &'static str,
    /// Where the file lies in the source tree.
    pub file: &'static str,
    pub(super) toml: &'static str,
    pub(super) urdf: &'static str,
}

macro_rules! built_in {
    ($name:literal) => {
        BuiltIn {
            name: $name,
            file: concat!("configs/", $name, ".toml"),
            toml: include_str!(concat!("../../../configs/", $name, ".toml")),
            urdf: include_str!(concat!("../../../configs/", $name, ".urdf")),
        }
    };
}

impl BuiltIn {
    /// The file on this machine: beside an installed program, else in the source tree.
    pub fn place(&self) -> PathBuf {
        let program = std::env::current_exe().unwrap_or_default();
        let prefix = program.ancestors().nth(2).unwrap_or(Path::new(""));
        let installed = prefix.join("share/servodance/robots");
        let installed = installed.join(format!("{}.toml", self.name));
        match installed.is_file() {
            true => installed,
            false => self.file.into(),
        }
    }
}

/// The built-in robots by name, in the order of `servodance robots`.
pub const BUILT_IN: &[BuiltIn] = &[
    built_in!("op3"),
    built_in!("torso13"),
    built_in!("neck"),
    built_in!("lite22"),
    built_in!("so101"),
    built_in!("quad12"),
    built_in!("microduck"),
];
