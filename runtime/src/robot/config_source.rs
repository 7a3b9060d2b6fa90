//! Where a key of a robot file comes from, for messages: the file and the line,
//! or the option or variable that set it. `toml_edit` knows where keys stand;
//! `figment` would know the file, and not the line.

use super::overrides::Overrides;
use toml_edit::{Document, Item, TableLike};

pub struct ConfigSource<'a> {
    pub file: &'a str,
    pub text: &'a str,
    pub overrides: &'a Overrides,
}

impl ConfigSource<'_> {
    /// Whether the description is chosen by the user, not by the file.
    pub fn sets_urdf(&self) -> bool {
        self.overrides.source_of(&["urdf"]).is_some()
    }

    /// Who set a key: `FILE:LINE`, the file alone, `--set KEY=VALUE`, or a variable.
    pub fn place(&self, path: &[&str]) -> String {
        if let Some(source) = self.overrides.source_of(path) {
            return source.to_owned();
        }
        match line_of(self.text, path) {
            Some(line) => format!("{}:{line}", self.file),
            None => self.file.to_owned(),
        }
    }
}

/// The line of a key or the last table on its way; array entries go by their `name`.
fn line_of(text: &str, path: &[&str]) -> Option<usize> {
    let document = Document::parse(text).ok()?;
    let mut at = None;
    let mut table: &dyn TableLike = document.as_table();
    let mut rest = path.iter();
    while let Some(part) = rest.next() {
        let Some((key, item)) = table.get_key_value(part) else {
            break;
        };
        at = key.span().or(item.span()).or(at);
        match item {
            Item::ArrayOfTables(tables) => {
                at = tables.span().or(at);
                let wanted = rest.next();
                let named =
                    |t: &&toml_edit::Table| t.get("name").and_then(Item::as_str) == wanted.copied();
                let Some(found) = tables.iter().find(named) else {
                    break;
                };
                at = found.span().or(at);
                table = found;
            }
            item => match item.as_table_like() {
                Some(inner) => table = inner,
                None => break,
            },
        }
    }
    at.map(|span| line_at(text, span.start))
}

/// The line, from 1, of a byte of a text.
pub(super) fn line_at(text: &str, byte: usize) -> usize {
    let before = &text.as_bytes()[..byte.min(text.len())];
    1 + before.iter().filter(|b| **b == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "control_hz = 100\n\n[bus]\nbaud = 1\n\n[retarget.gain]\nhead = 1.0\n\n[[joint]]\nname = \"a\"\nid = 1\n\n[[joint]]\nname = \"b\"\nid = 2\n";

    #[test]
    fn keys_are_found_on_their_lines() {
        for (path, line) in [
            (&["control_hz"][..], Some(1)),
            (&["bus", "baud"], Some(4)),
            (&["bus", "retries"], Some(3)),
            (&["retarget", "gain", "head"], Some(7)),
            (&["joint", "b", "id"], Some(15)),
            (&["joint", "b"], Some(13)),
            (&["safety", "rearm"], None),
        ] {
            assert_eq!(line_of(TEXT, path), line, "{path:?}");
        }
    }

    #[test]
    fn what_was_set_beside_the_file_is_named_as_it_was_set() {
        let set = ["joint.b.id=7".to_owned()];
        let overrides = Overrides::new([], &set).unwrap();
        let source = ConfigSource { file: "my.toml", text: TEXT, overrides: &overrides };
        assert_eq!(source.place(&["joint", "b", "id"]), "--set joint.b.id=7");
        assert_eq!(source.place(&["joint", "a", "id"]), "my.toml:11");
        assert_eq!(source.place(&["idle"]), "my.toml");
    }
}
