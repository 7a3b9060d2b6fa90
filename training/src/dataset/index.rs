//! The list of motion clips beside their files: whose they are, what is dance,
//! in which style, and what each is for.
//!
//! An `index.csv` has at least the columns `clip` (the npz file's path without
//! its ending), `source`, `dance`, `label` and `minutes`. `licence`, `style`,
//! `split`, `music` and `bone_change` may be missing: styles then follow from
//! labels, splits from names (`splits.rs`).

use std::path::{Component, Path};

use servodance_types::FRAME_RATE_HZ;

use super::clip_entry::{ClipEntry, Split};
use super::splits::assign_splits;
use super::styles::STYLES;
use servodance_model::motion::MotionError;

const COLUMNS: [&str; 11] = [
    "clip",
    "source",
    "licence",
    "minutes",
    "frames",
    "dance",
    "style",
    "label",
    "split",
    "music",
    "bone_change",
];

/// Whether a name that a list of files gives leads to nowhere but into the list's own folder.
pub fn stays_inside(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    parts.all(|part| matches!(part, Component::Normal(_)))
}

/// Reads `index.csv`: without what is not on a flat floor, with splits where none are written.
pub fn read(folder: &Path) -> Result<Vec<ClipEntry>, MotionError> {
    let path = folder.join("index.csv");
    let text = std::fs::read_to_string(&path).map_err(|error| MotionError::read(&path, error))?;
    let content = |reason: String| MotionError::content(&path, reason);
    let mut lines = text.lines().enumerate();
    let header = fields(lines.next().map_or("", |(_, line)| line));
    for wanted in ["clip", "source", "dance", "label", "minutes"] {
        if !header.iter().any(|name| name == wanted) {
            return Err(content(format!("no column `{wanted}`; the file has {header:?}")));
        }
    }
    let mut entries = Vec::new();
    let mut without_split = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let row = fields(line);
        let at_line = |reason: String| content(format!("line {}: {reason}", number + 1));
        if row.len() != header.len() {
            let (found, wanted) = (row.len(), header.len());
            return Err(at_line(format!("{found} fields, {wanted} expected")));
        }
        let get = |name: &str| {
            let column = header.iter().position(|field| field == name);
            column.map_or("", |column| row[column].as_str())
        };
        let (entry, split) = entry(&get).map_err(at_line)?;
        if entry.on_flat_floor() {
            if split.is_none() {
                without_split.push(entries.len());
            }
            entries.push(entry);
        }
    }
    let mut rest: Vec<ClipEntry> = without_split.iter().map(|&i| entries[i].clone()).collect();
    assign_splits(&mut rest);
    for (i, entry) in without_split.into_iter().zip(rest) {
        entries[i] = entry;
    }
    Ok(entries)
}

/// The entry of a row, and whether its split is written.
fn entry<'a>(get: &dyn Fn(&str) -> &'a str) -> Result<(ClipEntry, Option<Split>), String> {
    let minutes = get("minutes");
    let told = |name: &str, known: Vec<&str>| -> Result<Option<usize>, String> {
        let text = get(name);
        let at = known.iter().position(|word| *word == text);
        match text.is_empty() || at.is_some() {
            true => Ok(at),
            false => Err(format!("{name} `{text}`: choose of {}", known.join(", "))),
        }
    };
    let split = told("split", Split::ALL.map(Split::name).to_vec())?.map(|at| Split::ALL[at]);
    let name = get("clip").to_owned();
    if !stays_inside(&name) {
        return Err(format!("clip `{name}` leads out of the folder"));
    }
    let entry = ClipEntry {
        name,
        source: get("source").to_owned(),
        licence: get("licence").to_owned(),
        dance: get("dance") == "yes",
        label: get("label").to_owned(),
        minutes: minutes.parse().map_err(|_| format!("minutes `{minutes}` is not a number"))?,
        written_style: told("style", STYLES.to_vec())?,
        music: get("music") == "yes",
        bone_change: get("bone_change").parse().ok(),
        split: split.unwrap_or(Split::Train),
    };
    Ok((entry, split))
}

/// The text of an index with these entries.
pub fn text(entries: &[ClipEntry]) -> String {
    let yes = |is: bool| if is { "yes" } else { "no" }.to_owned();
    let mut out = COLUMNS.join(",") + "\n";
    for entry in entries {
        let row = [
            entry.name.clone(),
            entry.source.clone(),
            entry.licence.clone(),
            format!("{:.4}", entry.minutes),
            format!("{:.0}", entry.minutes * 60.0 * FRAME_RATE_HZ),
            yes(entry.dance),
            STYLES[entry.style()].to_owned(),
            entry.label.clone(),
            entry.split.name().to_owned(),
            yes(entry.music),
            entry.bone_change.map_or(String::new(), |v| format!("{v:.4}")),
        ];
        out += &(row.map(|field| quoted(&field)).join(",") + "\n");
    }
    out
}

/// A field that holds commas is put in quotes; quotes in it become single ones.
fn quoted(field: &str) -> String {
    let plain = field.replace('"', "'").replace(['\n', '\r'], " ");
    match plain.contains(',') {
        true => format!("\"{plain}\""),
        false => plain,
    }
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

#[cfg(test)]
mod tests {
    use super::super::styles::style_number;
    use super::*;

    #[test]
    fn quotes_protect_commas() {
        assert_eq!(fields("a,\"b, c\",d"), ["a", "b, c", "d"]);
    }

    #[test]
    fn reading_returns_what_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let mut entries = vec![
            ClipEntry::example("a", "home", true, "swing, slow"),
            ClipEntry::example("b", "home", false, ""),
        ];
        entries[0].licence = "free, with \"thanks\"".into();
        entries[0].written_style = style_number("pop");
        entries[0].split = Split::Test;
        entries[0].bone_change = Some(0.0125);
        entries[1].music = true;
        entries[1].split = Split::Validation;
        std::fs::write(folder.path().join("index.csv"), text(&entries)).unwrap();
        let read = read(folder.path()).unwrap();
        assert_eq!(read[0].licence, "free, with 'thanks'");
        assert_eq!((read[0].style(), read[0].split), (3, Split::Test));
        assert_eq!(
            (&read[0].label, read[0].bone_change),
            (&"swing, slow".to_owned(), Some(0.0125))
        );
        assert_eq!((read[1].music, read[1].split), (true, Split::Validation));
    }

    #[test]
    fn an_unknown_word_names_its_line_and_the_choices() {
        let folder = tempfile::tempdir().unwrap();
        let index = "clip,source,dance,label,minutes,style\na,b,yes,,1,polka\n";
        std::fs::write(folder.path().join("index.csv"), index).unwrap();
        let error = read(folder.path()).unwrap_err().to_string();
        assert!(error.contains("line 2: style `polka`: choose of everyday"), "{error}");
    }

    #[test]
    fn a_clip_outside_the_folder_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for clip in ["/etc/a", "../a", "home/../../a"] {
            let index = format!("clip,source,dance,label,minutes\n{clip},b,yes,,1\n");
            std::fs::write(folder.path().join("index.csv"), index).unwrap();
            let error = read(folder.path()).unwrap_err().to_string();
            let says = format!("line 2: clip `{clip}` leads out of the folder");
            assert!(error.contains(&says), "{error}");
        }
    }
}
