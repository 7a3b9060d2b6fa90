//! How much of a dance a robot on its feet is asked for, found in the simulated world
//! and written into its file.

use std::path::Path;

use super::loaded::Robot;
use crate::physics::{StandingAmplitude, find_amplitude};
use crate::telemetry::pending_file::write_whole;
use anyhow::{Context, bail};
use servodance_model::motion::Clip;
use toml_edit::{DocumentMut, Item, Table, value};

/// Finds the largest share of `dances` that `robot` stands and writes `[retarget.gain]`
/// into `file`, if that is a file. Returns a line for people; fails where the robot falls
/// whatever it leaves out.
pub fn settle_amplitude(file: &str, robot: &Robot, dances: &[Clip]) -> anyhow::Result<String> {
    let mut robot = robot.clone();
    robot.retarget.gain = Default::default();
    let Some(StandingAmplitude { pelvis, arms, .. }) = find_amplitude(&robot, dances, false)?
    else {
        bail!("{}: in the simulated world it falls whatever it leaves out", robot.name);
    };
    let found = format!(
        "{}: stands {:.0} % of the pelvis's movement and {:.0} % of the arms'",
        robot.name,
        pelvis * 100.0,
        arms * 100.0
    );
    let path = Path::new(file);
    if path.extension().is_none_or(|e| e != "toml") {
        return Ok(format!("{found} (a built-in robot: nothing is written)"));
    }
    let text = std::fs::read_to_string(path).with_context(|| file.to_owned())?;
    write_whole(path, with_gain(&text, pelvis, arms)?.as_bytes())?;
    Ok(format!("{found}; written to {file}"))
}

/// The file's text with these shares, and nothing else changed.
fn with_gain(text: &str, pelvis: f64, arms: f64) -> anyhow::Result<String> {
    let mut document: DocumentMut = text.parse().context("the robot file is no TOML")?;
    let retarget =
        document["retarget"].as_table_mut().context("the robot file has no [retarget]")?;
    let gain = retarget.entry("gain").or_insert(Item::Table(Table::new()));
    let gain = gain.as_table_like_mut().context("[retarget.gain] is no table")?;
    for (keys, share) in
        [(["torso", "left_leg", "right_leg"], pelvis), (["left_arm", "right_arm", "head"], arms)]
    {
        for key in keys {
            gain.insert(key, value(share));
        }
    }
    Ok(document.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_written_and_comments_stay() {
        let text = "# mine\n[retarget]\nstance = \"planted\" # on its feet\n";
        let written = with_gain(text, 0.5, 1.0).unwrap();
        assert!(written.starts_with(text), "{written}");
        assert!(written.contains("[retarget.gain]\ntorso = 0.5\n"), "{written}");
        assert_eq!(with_gain(&written, 0.5, 1.0).unwrap(), written);
    }
}
