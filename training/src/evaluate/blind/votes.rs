//! Votes on a blind comparison, and what they add up to.

use super::PairKey;
use super::bradley_terry::{Meeting, intervals, strengths};
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::path::Path;

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Choice {
    Left,
    Right,
    Same,
}

#[derive(Clone, Debug, Deserialize)]
struct Vote {
    pair: usize,
    choice: Choice,
}

/// What the page saves.
#[derive(Clone, Debug, Deserialize)]
struct VoteFile {
    votes: Vec<Vote>,
}

/// A side of the comparison, `generated` first.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SideScore {
    pub(crate) side: String,
    /// Pairs in which it was shown and voted on; a tie is half a win.
    pub(crate) votes: usize,
    pub(crate) wins: f64,
    /// Bradley-Terry strength against `generated`, nats, and its 95 % interval.
    pub(crate) strength: f64,
    pub(crate) interval: [f64; 2],
}

/// The votes of a blind comparison; serialised as the JSON of `evaluate --votes`.
#[derive(Clone, Debug, Serialize)]
pub struct VoteScores {
    pub(crate) voters: usize,
    pub(crate) votes: usize,
    pub(crate) sides: Vec<SideScore>,
}

/// Scores all votes*.json of a folder that `write_blind` wrote.
/// Fails for: no votes, or a file that does not belong to the folder's key.
pub fn score_votes(folder: &Path) -> anyhow::Result<VoteScores> {
    let keys: Vec<PairKey> = read(&folder.join("key.json"))?;
    let mut names = vec!["generated".to_owned()];
    for name in keys.iter().flat_map(|key| [&key.left, &key.right]) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    let place = |name: &String| names.iter().position(|known| known == name).unwrap_or(0);
    let (mut meetings, mut voters) = (Vec::<Meeting>::new(), 0);
    let entries = std::fs::read_dir(folder).with_context(|| format!("{}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !(name.starts_with("votes") && name.ends_with(".json")) {
            continue;
        }
        voters += 1;
        for vote in read::<VoteFile>(&path)?.votes {
            let Some(key) = keys.iter().find(|key| key.pair == vote.pair) else {
                bail!(
                    "{}: a vote on pair {}, key.json has {}",
                    path.display(),
                    vote.pair,
                    keys.len()
                );
            };
            let share = match vote.choice {
                Choice::Left => 1.0,
                Choice::Right => 0.0,
                Choice::Same => 0.5,
            };
            meetings.push((place(&key.left), place(&key.right), share));
        }
    }
    if meetings.is_empty() {
        bail!("{} holds no votes: save them from its page as votes*.json", folder.display());
    }
    let strength = strengths(names.len(), &meetings);
    let interval = intervals(names.len(), &meetings, 1);
    let side = |(at, side): (usize, &String)| {
        let shares = meetings.iter().filter_map(|&(a, b, share)| match at {
            _ if at == a => Some(share),
            _ if at == b => Some(1.0 - share),
            _ => None,
        });
        let shares: Vec<f64> = shares.collect();
        SideScore {
            side: side.clone(),
            votes: shares.len(),
            wins: shares.iter().sum(),
            strength: strength[at],
            interval: interval[at],
        }
    };
    let sides = names.iter().enumerate().map(side).collect();
    Ok(VoteScores { voters, votes: meetings.len(), sides })
}

fn read<T: for<'a> Deserialize<'a>>(path: &Path) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{}", path.display()))
}

impl VoteScores {
    /// The figures as a table for a terminal.
    pub fn table(&self) -> String {
        let mut text = format!(
            "{} voters, {} votes\n\n{:<24}{:>8}{:>8}{:>12}{:>20}\n",
            self.voters, self.votes, "", "votes", "wins", "strength", "95 % interval"
        );
        for side in &self.sides {
            let [low, high] = side.interval;
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{:<24}{:>8}{:>8.1}{:>12.2}{:>20}",
                side.side,
                side.votes,
                side.wins,
                side.strength,
                format!("{low:.2} to {high:.2}")
            );
        }
        text.push_str("\nstrength: logarithm of the odds to be preferred to the generated dance\n");
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn votes_are_told_apart_by_the_key() {
        let folder = tempfile::tempdir().unwrap();
        let write =
            |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write(
            "key.json",
            r#"[{"pair":1,"left":"generated","right":"captured"},
                {"pair":2,"left":"captured","right":"generated"}]"#,
        );
        let none = score_votes(folder.path()).unwrap_err().to_string();
        assert!(none.contains("no votes"), "{none}");
        write(
            "votes-ann.json",
            r#"{"votes":[{"pair":1,"choice":"right"},{"pair":2,"choice":"left"}]}"#,
        );
        write("votes-ben.json", r#"{"votes":[{"pair":2,"choice":"same"}]}"#);
        let found = score_votes(folder.path()).unwrap();
        assert_eq!((found.voters, found.votes), (2, 3));
        let [generated, captured] = &found.sides[..] else { panic!("{found:?}") };
        assert_eq!((generated.wins, captured.wins), (0.5, 2.5));
        // Half a win more for each side by the prior.
        assert!((captured.strength - 3f64.ln()).abs() < 1e-9, "{found:?}");
        write("votes-eve.json", r#"{"votes":[{"pair":9,"choice":"left"}]}"#);
        assert!(score_votes(folder.path()).unwrap_err().to_string().contains("pair 9"));
    }
}
