//! How much of a dance a robot on its feet is asked for, found in the simulated world
//! and written into its file.

use std::path::Path;

use super::loaded::Robot;
use crate::physics::{StandingAmplitude, StandingShares, TrialDance, find_amplitude};
use crate::telemetry::pending_file::write_whole;
use anyhow::{Context, bail};
use toml_edit::{DocumentMut, Item, Table, value};

/// Finds the largest share of `dances` that `robot` stands and writes `arm_zmp_limit` and
/// `[retarget.gain]` into `file`, if that is a file. Returns a line for people; fails where the
/// robot falls whatever it leaves out.
pub fn settle_amplitude(
    file: &str,
    robot: &Robot,
    dances: &[TrialDance],
) -> anyhow::Result<String> {
    let mut robot = robot.clone();
    robot.retarget.gain = Default::default();
    let Some(StandingAmplitude { shares, .. }) = find_amplitude(&robot, dances, false)? else {
        bail!("{}: in the simulated world it falls whatever it leaves out", robot.name);
    };
    let found = format!("{}: stands {}", robot.name, shares.shown(&robot.retarget.body));
    let path = Path::new(file);
    if path.extension().is_none_or(|e| e != "toml") {
        return Ok(format!("{found} (a built-in robot: nothing is written)"));
    }
    let text = std::fs::read_to_string(path).with_context(|| file.to_owned())?;
    write_whole(path, with_shares(&text, &shares)?.as_bytes())?;
    Ok(format!("{found}; written to {file}"))
}

/// The file's text with these shares, and nothing else changed.
fn with_shares(text: &str, shares: &StandingShares) -> anyhow::Result<String> {
    let mut document: DocumentMut = text.parse().context("the robot file is no TOML")?;
    let retarget =
        document["retarget"].as_table_mut().context("the robot file has no [retarget]")?;
    retarget.insert("arm_zmp_limit", value(shares.arm_zmp_limit));
    let gain = retarget.entry("gain").or_insert(Item::Table(Table::new()));
    let gain = gain.as_table_like_mut().context("[retarget.gain] is no table")?;
    for (keys, share) in [
        (["torso", "left_leg", "right_leg"], shares.pelvis),
        (["left_arm", "right_arm", "head"], shares.arms),
    ] {
        for key in keys {
            gain.insert(key, value(share));
        }
    }
    Ok(document.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_retarget::BodyLinks;

    #[test]
    fn shares_are_written_and_comments_stay() {
        let text = "# mine\n[retarget]\nstance = \"planted\" # on its feet\n";
        let shares = StandingShares { pelvis: 0.5, arm_zmp_limit: 0.4, arms: 1.0 };
        let written = with_shares(text, &shares).unwrap();
        assert!(written.starts_with(text), "{written}");
        assert!(
            written.contains("arm_zmp_limit = 0.4\n\n[retarget.gain]\ntorso = 0.5\n"),
            "{written}"
        );
        assert_eq!(with_shares(&written, &shares).unwrap(), written);
    }

    #[test]
    fn shares_are_shown_of_what_the_body_has() {
        let shares = StandingShares { pelvis: 0.5, arm_zmp_limit: 0.4, arms: 1.0 };
        let mut body = BodyLinks::default();
        assert_eq!(shares.shown(&body), "50 % of the pelvis's movement");
        body.head = Some("head".into());
        assert!(shares.shown(&body).ends_with("and 100 % of the head's"));
        body.left_elbow = Some("elbow".into());
        assert!(shares.shown(&body).contains("100 % of the arms'"));
    }
}
