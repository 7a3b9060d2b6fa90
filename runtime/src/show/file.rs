//! A show file: TOML.
//!
//! ```toml
//! song = "song.ogg"      # beside this file; the built-in song if left out
//! style = "salsa"        # of the leader
//! bars_s = [0.5, 2.4]    # where bars begin; found in the song if left out
//!
//! [[cue]]
//! at_s = 12.0            # or bar = 7, counted from 1
//! follower = "all"
//! mirror = true          # amplitude, canon, style: as in `servodance cue`
//! ```

use super::{Show, SongOutline, TimedCue};
use anyhow::{Context, bail};
use serde::Deserialize;
use servodance_stage::messages::Role;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A show file as it was read.
#[derive(Clone, Debug)]
pub struct ShowFile {
    path: PathBuf,
    text: ShowText,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ShowText {
    song: Option<String>,
    style: Option<String>,
    #[serde(default)]
    beats_s: Vec<f64>,
    #[serde(default)]
    bars_s: Vec<f64>,
    #[serde(default, rename = "section")]
    sections: Vec<SectionText>,
    #[serde(default, rename = "cue")]
    cues: Vec<CueText>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SectionText {
    at_s: f64,
    name: String,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CueText {
    at_s: Option<f64>,
    bar: Option<usize>,
    follower: String,
    mirror: Option<bool>,
    amplitude: Option<f32>,
    canon: Option<f32>,
    style: Option<String>,
}

impl ShowFile {
    /// Reads a show. The error names the file and what is wrong in it.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let shown = path.display();
        let text = std::fs::read_to_string(path).with_context(|| format!("{shown}"))?;
        let text: ShowText = toml::from_str(&text)
            .map_err(|error| anyhow::anyhow!("{shown}: {}", in_a_line(&error, &text)))?;
        Ok(Self { path: path.to_owned(), text })
    }

    /// The song, found from the folder of the file; none for the built-in one.
    pub fn song(&self) -> Option<PathBuf> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        self.text.song.as_ref().map(|song| folder.join(song))
    }

    /// The leader's style, if the file says.
    pub fn style(&self) -> Option<&str> {
        self.text.style.as_deref()
    }

    /// The outline that the file has written down, if it has.
    pub fn outline(&self) -> Option<SongOutline> {
        let ShowText { beats_s, bars_s, sections, .. } = &self.text;
        let sections = sections.iter().map(|section| (section.at_s, section.name.clone()));
        let outline = SongOutline {
            length_s: 0.0,
            beats_s: beats_s.clone(),
            bars_s: bars_s.clone(),
            sections: sections.collect(),
        };
        (!bars_s.is_empty() || !beats_s.is_empty()).then_some(outline)
    }

    /// The show, its bars counted by this outline. The error names the cue.
    pub fn show(&self, outline: &SongOutline) -> anyhow::Result<Show> {
        let mut show = Show::new(self.text.song.clone(), self.text.style.clone());
        for (number, cue) in (1..).zip(&self.text.cues) {
            let checked = cue.checked(outline);
            let checked = checked
                .map_err(|why| anyhow::anyhow!("{}: cue {number}: {why}", self.path.display()))?;
            if !show.add(checked) {
                bail!("{}: more than {} cues", self.path.display(), super::MOST);
            }
        }
        Ok(show)
    }

    /// The file, for messages.
    pub fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// Whether cues are counted in bars.
    pub fn counts_bars(&self) -> bool {
        self.text.cues.iter().any(|cue| cue.bar.is_some())
    }
}

impl CueText {
    fn checked(&self, outline: &SongOutline) -> Result<TimedCue, String> {
        let at_s = match (self.at_s, self.bar) {
            (Some(at_s), None) => at_s,
            (None, Some(bar)) => outline.bar_s(bar)?,
            _ => return Err("expected either at_s or bar".into()),
        };
        let role = Role {
            mirror: self.mirror,
            amplitude: self.amplitude,
            canon_beats: self.canon,
            style: self.style.clone(),
        };
        TimedCue::checked(Some(at_s), self.follower.clone(), role)
    }
}

/// Line and column, then what is wrong.
fn in_a_line(error: &toml::de::Error, text: &str) -> String {
    let before = error.span().map_or("", |span| &text[..span.start.min(text.len())]);
    let line = before.matches('\n').count() + 1;
    format!("line {line}: {}", error.message().replace('\n', " "))
}

impl Show {
    /// The show as a file, with the outline of its song.
    pub fn to_text(&self, outline: &SongOutline) -> String {
        let mut text = String::from("# Played again by `servodance lead --show FILE`.\n");
        let quoted = |word: &str| toml::Value::from(word).to_string();
        // Writing into a text cannot fail.
        for (key, value) in [("song", &self.song), ("style", &self.style)] {
            if let Some(value) = value {
                let _ = writeln!(text, "{key} = {}", quoted(value));
            }
        }
        for (key, times) in [("beats_s", &outline.beats_s), ("bars_s", &outline.bars_s)] {
            let times: Vec<String> = times.iter().map(|time_s| format!("{time_s:.3}")).collect();
            let _ = writeln!(text, "{key} = [{}]", times.join(", "));
        }
        for (at_s, name) in &outline.sections {
            let _ = writeln!(text, "\n[[section]]\nat_s = {at_s:.3}\nname = {}", quoted(name));
        }
        for cue in &self.cues {
            let follower = quoted(&cue.follower);
            let at_s = cue.time_s();
            let _ = writeln!(text, "\n[[cue]]\nat_s = {at_s:.3}\nfollower = {follower}");
            let role = &cue.role;
            let lines = [
                role.mirror.map(|on| format!("mirror = {on}\n")),
                role.amplitude.map(|share| format!("amplitude = {share:?}\n")),
                role.canon_beats.map(|beats| format!("canon = {beats:?}\n")),
                role.style.as_ref().map(|style| format!("style = {}\n", quoted(style))),
            ];
            text.extend(lines.into_iter().flatten());
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline() -> SongOutline {
        SongOutline {
            length_s: 8.0,
            beats_s: (0..16).map(|beat| 0.5 * f64::from(beat)).collect(),
            bars_s: vec![0.0, 2.0, 4.0, 6.0],
            sections: vec![(0.0, "A".into()), (4.0, "B \"2\"".into())],
        }
    }

    fn read(text: &str) -> anyhow::Result<ShowFile> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("show.toml");
        std::fs::write(&path, text).unwrap();
        ShowFile::read(&path)
    }

    #[test]
    fn a_show_that_was_written_down_is_the_same_show_when_it_is_read() {
        let mut show = Show::new(Some("a \"b\".ogg".into()), Some("salsa".into()));
        let role = Role { mirror: Some(true), ..Role::default() };
        let late = Role {
            amplitude: Some(0.35),
            canon_beats: Some(2.0),
            style: Some("hype".into()),
            ..Role::default()
        };
        for (at_s, follower, role) in [(6.25, "all", late), (1.5, "op3", role)] {
            let cue = TimedCue::checked(Some(at_s), follower.into(), role).unwrap();
            assert!(show.add(cue));
        }
        let file = read(&show.to_text(&outline())).unwrap();
        assert_eq!(file.show(&SongOutline::default()).unwrap(), show);
        let again = file.outline().unwrap();
        assert_eq!((again.bars_s, again.sections), (outline().bars_s, outline().sections));
        assert!(file.song().unwrap().ends_with("a \"b\".ogg"));
        let due = |from_s, to_s| show.due(from_s, to_s).map(TimedCue::words).collect::<Vec<_>>();
        assert_eq!(due(-1.0, 1.5), ["op3: mirror"]);
        assert_eq!(due(1.5, 9.0), ["all: amplitude 35 %, 2 beats later, style hype"]);
    }

    #[test]
    fn bars_are_counted_from_one() {
        let file = read("[[cue]]\nbar = 3\nfollower = 'all'\nmirror = true\n").unwrap();
        let show = file.show(&outline()).unwrap();
        assert_eq!(show.cues()[0].at_s, Some(4.0));
        let error = file.show(&SongOutline::default()).unwrap_err().to_string();
        assert!(error.contains("cue 1: bar 3"), "{error}");
    }

    #[test]
    fn what_is_wrong_with_a_show_is_said_with_its_place() {
        for (text, words) in [
            ("song = 1", ["line 1", "string"]),
            ("\n\n[[cue]]\nfollow = 'all'", ["line 4", "follow"]),
            ("[[cue]]\nat_s = 1.0\nbar = 2\nfollower = 'all'\nmirror = true", ["cue 1", "either"]),
            ("[[cue]]\nat_s = nan\nfollower = 'all'\nmirror = true", ["cue 1", "NaN"]),
            ("[[cue]]\nat_s = 1.0\nfollower = 'a b'\nmirror = true", ["cue 1", "a b"]),
            ("[[cue]]\nat_s = 1.0\nfollower = 'all'\namplitude = 2.0", ["cue 1", "0 to 1"]),
            ("[[cue]]\nat_s = 1.0\nfollower = 'all'", ["cue 1", "nothing"]),
        ] {
            let error = match read(text) {
                Ok(file) => file.show(&outline()).unwrap_err(),
                Err(error) => error,
            };
            let told = format!("{error:#}");
            assert!(words.iter().all(|word| told.contains(word)), "{text}: {told}");
            assert!(told.contains("show.toml") && told.lines().count() == 1, "{told}");
        }
    }
}
