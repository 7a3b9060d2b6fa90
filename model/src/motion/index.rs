//! The list of motion clips beside their files: what is dance, in which style,
//! and which clips belong to one take.
//!
//! Reads an `index.csv` with at least the columns `clip`, `source`, `dance`
//! and `label`; `clip` is the npz file's path without its ending.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::MotionError;

/// The names of all styles, in the order of the style numbers. The first six
/// are captured motion, the others come from the choreographer.
pub const STYLES: [&str; 10] = [
    "everyday", "martial", "modern", "pop", "salsa", "street", "groove", "disco", "robot", "hype",
];

/// The number of a style; `None` for a name that is not in [`STYLES`].
pub fn style_number(name: &str) -> Option<usize> {
    STYLES.iter().position(|style| *style == name)
}

/// What a clip is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// The weights are fitted to it.
    Train = 0,
    /// Sizes and stopping are chosen by it.
    Validation = 1,
    /// Only the final figures use it.
    Test = 2,
}

/// One line of the index.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// `source/file`, without the ending.
    pub name: String,
    /// Where the clip comes from.
    pub source: String,
    /// Whether it is dance.
    pub dance: bool,
    /// What it shows, in words.
    pub label: String,
    /// Minutes, as the index says.
    pub minutes: f64,
    /// What the clip is for.
    pub split: Split,
}

impl Entry {
    /// The clip's file under the folder of the index.
    pub fn path(&self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.npz", self.name))
    }

    /// The file name, without source and ending.
    fn stem(&self) -> &str {
        self.name.rsplit('/').next().unwrap_or(&self.name)
    }

    /// Clips of one take show one performance: they share a split.
    fn take(&self) -> String {
        match (self.source.as_str(), self.stem().split_once('_')) {
            ("cmu_salsa", Some((_, take))) => format!("salsa {take}"),
            _ => self.name.clone(),
        }
    }

    /// Whether the performer stands on a flat floor throughout. CMU subject 1
    /// climbs a playground and subject 3 walks on uneven ground.
    pub fn on_flat_floor(&self) -> bool {
        let subject = self.stem().split('_').next().unwrap_or("");
        let rough = self.source.starts_with("cmu") && matches!(subject, "01" | "03");
        !rough && !self.label.contains("climb")
    }

    /// The clip's style, an index into [`STYLES`].
    pub fn style(&self) -> usize {
        let stem = self.stem();
        let name = if !self.dance {
            let fights = ["karate", "Fence", "Chop", "martial", "sword", "punch"];
            if fights
                .iter()
                .any(|word| stem.contains(word) || self.label.contains(word))
            {
                "martial"
            } else {
                "everyday"
            }
        } else if self.source == "cmu_salsa" || stem.contains("Salsa") {
            "salsa"
        } else if self.label.contains("Michael Jackson") {
            "pop"
        } else if self.source == "g1_moves" && !stem.contains("Modern") {
            "street"
        } else {
            "modern"
        };
        style_number(name).unwrap_or(0)
    }
}

/// Reads `folder/index.csv`, leaves out what is not on a flat floor, and
/// assigns splits.
pub fn read(folder: &Path) -> Result<Vec<Entry>, MotionError> {
    let path = folder.join("index.csv");
    let text = std::fs::read_to_string(&path).map_err(|error| MotionError::Read {
        path: path.clone(),
        reason: error.to_string(),
    })?;
    let content = |reason: String| MotionError::Content {
        path: path.clone(),
        reason,
    };
    let mut lines = text.lines().enumerate();
    let header = fields(lines.next().map_or("", |(_, line)| line));
    let column = |name: &str| {
        header
            .iter()
            .position(|field| field == name)
            .ok_or_else(|| content(format!("no column `{name}`; the file has {header:?}")))
    };
    let columns = [
        column("clip")?,
        column("source")?,
        column("dance")?,
        column("label")?,
        column("minutes")?,
    ];
    let mut entries = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let row = fields(line);
        let Some([name, source, dance, label, minutes]) = pick(&row, columns) else {
            return Err(content(format!(
                "line {}: {} fields, {} expected",
                number + 1,
                row.len(),
                header.len()
            )));
        };
        let minutes = minutes.parse().map_err(|_| {
            content(format!(
                "line {}: minutes `{minutes}` is not a number",
                number + 1
            ))
        })?;
        entries.push(Entry {
            name,
            source,
            dance: dance == "yes",
            label,
            minutes,
            split: Split::Train,
        });
    }
    entries.retain(Entry::on_flat_floor);
    assign_splits(&mut entries);
    Ok(entries)
}

fn pick<const N: usize>(row: &[String], columns: [usize; N]) -> Option<[String; N]> {
    let mut out = std::array::from_fn(|_| String::new());
    for (field, column) in out.iter_mut().zip(columns) {
        *field = row.get(column)?.clone();
    }
    Some(out)
}

/// The fields of one CSV line; double quotes protect commas.
fn fields(line: &str) -> Vec<String> {
    let mut out = Vec::new();
    let mut field = String::new();
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => out.push(std::mem::take(&mut field)),
            c => field.push(c),
        }
    }
    out.push(field);
    out
}

/// Holds out 8 % of the minutes of every style for test and as much for
/// validation, whole takes, in an order that depends on their names alone.
pub fn assign_splits(entries: &mut [Entry]) {
    const SHARE: f64 = 0.08;
    for style in 0..STYLES.len() {
        let members: Vec<usize> = (0..entries.len())
            .filter(|i| entries[*i].style() == style)
            .collect();
        let mut takes: Vec<String> = members.iter().map(|i| entries[*i].take()).collect();
        takes.sort_by_key(|take| (Sha256::digest(take.as_bytes()), take.clone()));
        takes.dedup();
        let total: f64 = members.iter().map(|i| entries[*i].minutes).sum();
        let mut room = [SHARE * total; 2];
        for take in takes {
            let clips: Vec<usize> = members
                .iter()
                .copied()
                .filter(|i| entries[*i].take() == take)
                .collect();
            let minutes: f64 = clips.iter().map(|i| entries[*i].minutes).sum();
            // A take may overshoot its room by half of itself: rounding.
            let split = if minutes / 2.0 <= room[0] {
                room[0] -= minutes;
                Split::Test
            } else if minutes / 2.0 <= room[1] {
                room[1] -= minutes;
                Split::Validation
            } else {
                Split::Train
            };
            for i in clips {
                entries[i].split = split;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, source: &str, dance: bool, label: &str) -> Entry {
        Entry {
            name: format!("{source}/{name}"),
            source: source.into(),
            dance,
            label: label.into(),
            minutes: 0.3,
            split: Split::Train,
        }
    }

    #[test]
    fn partners_of_one_take_share_a_split() {
        let mut entries: Vec<Entry> = (1..13)
            .flat_map(|take| {
                ["60", "61"].map(|s| entry(&format!("{s}_{take:02}"), "cmu_salsa", true, ""))
            })
            .collect();
        assign_splits(&mut entries);
        for pair in entries.chunks(2) {
            assert_eq!(pair[0].split, pair[1].split, "{}", pair[0].name);
        }
        for split in [Split::Test, Split::Validation] {
            assert_eq!(entries.iter().filter(|e| e.split == split).count(), 2);
        }
    }

    #[test]
    fn quotes_protect_commas() {
        assert_eq!(fields("a,\"b, c\",d"), ["a", "b, c", "d"]);
    }

    #[test]
    fn climbing_is_left_out() {
        assert!(!entry("01_01", "cmu_amc", false, "playground").on_flat_floor());
        assert!(entry("02_01", "cmu_amc", false, "walk").on_flat_floor());
    }

    #[test]
    fn styles_come_from_labels() {
        let style = |e: Entry| STYLES[e.style()];
        assert_eq!(
            style(entry("dance_J_Dance2_Salsa", "g1_moves", true, "")),
            "salsa"
        );
        assert_eq!(
            style(entry("dance_B_DadDance", "g1_moves", true, "")),
            "street"
        );
        assert_eq!(
            style(entry("karate_M_Move1", "g1_moves", false, "M_Move1")),
            "martial"
        );
        assert_eq!(style(entry("05_18", "cmu_iclone", true, "dance")), "modern");
    }
}
