//! The text of a description: a URDF, or an MJCF model with what it includes.

use crate::robot::robot_folders::{FileRefused, RobotFolders};
use anyhow::Context;
use servodance_retarget::{is_mjcf, with_includes};
use std::path::Path;

/// Reads a description. Files that an MJCF model includes are read from its folder and
/// below; one elsewhere is refused.
pub fn read_description(path: &Path) -> anyhow::Result<String> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    if !is_mjcf(&text) || !text.contains("<include") {
        return Ok(text);
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let folders = RobotFolders::of_file(folder);
    // Names count from the model's folder, or from that of a file that was included.
    let mut places = vec![folder.to_owned()];
    let whole = with_includes(&text, |name| {
        let mut tried = places.iter().map(|place| folders.find(&place.join(name)));
        let first = tried.next().unwrap_or(Err(FileRefused::Outside));
        let found = first.or_else(|refused| tried.find_map(Result::ok).ok_or(refused));
        let found = found.map_err(|refused| refused.to_string())?;
        let text = std::fs::read_to_string(&found).map_err(|error| error.to_string())?;
        places.extend(found.parent().map(Path::to_owned));
        Ok(text)
    });
    whole.with_context(|| path.display().to_string())
}
