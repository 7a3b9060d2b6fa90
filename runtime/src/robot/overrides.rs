//! Keys of a robot file that are set beside it: by `--set KEY=VALUE` and by the
//! environment.
//!
//! A key is dotted (`safety.rearm`); an entry of an array of tables goes by its
//! name or its number (`joint.l_knee.upper_deg`, `retarget.capsule.0.radius_m`).
//! A value is TOML, else text. In the environment a dot is two underscores, and
//! case does not matter: `SERVODANCE_SAFETY__REARM=true`. Options win over
//! variables, later ones over earlier ones. A variable that names no key is
//! ignored with a warning.

use anyhow::{anyhow, bail};
use toml_edit::{DocumentMut, Item, Key, Table, TableLike, Value};

const PREFIX: &str = "SERVODANCE_";
/// Variables that are something else.
const RESERVED: [&str; 4] = ["ROBOT", "BUS", "MODEL", "FAILPOINT"];

#[derive(Clone, Debug)]
struct Override {
    /// As the user wrote it, without the value of a variable.
    source: String,
    path: Vec<String>,
    value: Value,
    /// Whether the case of letters is not known.
    loose: bool,
}

/// All of them, in the order in which they are set.
#[derive(Clone, Debug, Default)]
pub struct Overrides(Vec<Override>);

impl Overrides {
    /// From the environment, then options; fails at an option without key or value.
    pub fn from_user(set: &[String]) -> anyhow::Result<Self> {
        let variables = std::env::vars_os();
        let variables = variables.filter_map(|(name, value)| {
            Some((name.into_string().ok()?, value.into_string().ok()?))
        });
        Self::new(variables, set)
    }

    pub(crate) fn new(
        variables: impl IntoIterator<Item = (String, String)>,
        set: &[String],
    ) -> anyhow::Result<Self> {
        let mut all: Vec<Override> = variables.into_iter().filter_map(from_variable).collect();
        all.sort_by(|a, b| a.source.cmp(&b.source));
        for text in set {
            all.push(from_option(text)?);
        }
        Ok(Self(all))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The text of a robot file with all of them set, `check`ed after each, and a
    /// line for each variable that names no key and is ignored.
    /// Fails at one that cannot be set, or that `check` refuses, and names it.
    pub(super) fn apply(
        &self,
        text: &str,
        check: impl Fn(&str) -> Result<(), String>,
    ) -> Result<(String, Vec<String>), String> {
        let mut text = text.to_owned();
        let mut ignored = Vec::new();
        for one in &self.0 {
            let set = one.apply(&text).map_err(|reason| (reason, true));
            let checked = set.and_then(|set| match check(&set) {
                Ok(()) => Ok(set),
                Err(reason) => {
                    let no_key = reason.starts_with("unknown field");
                    Err((reason, no_key))
                }
            });
            match checked {
                Ok(set) => text = set,
                // Options are for this program; a variable may be meant for another.
                Err((reason, true)) if one.loose => {
                    ignored.push(format!("{} is ignored: {reason}", one.source));
                }
                Err((reason, _)) => return Err(format!("{}: {reason}", one.source)),
            }
        }
        Ok((text, ignored))
    }

    pub(super) fn source_of(&self, path: &[&str]) -> Option<&str> {
        let sets = |one: &&Override| {
            let parts = one.path.iter().zip(path);
            one.path.len() == path.len() && { parts }.all(|(a, b)| same(a, b, one.loose))
        };
        let found = self.0.iter().rev().find(sets);
        found.map(|one| one.source.as_str())
    }
}

impl Override {
    fn apply(&self, text: &str) -> Result<String, String> {
        let mut document: DocumentMut = text.parse().map_err(|e| format!("{e}"))?;
        self.set(document.as_table_mut(), &self.path)?;
        Ok(document.to_string())
    }

    /// Sets the key at the end of `path`, with the tables on the way to it.
    fn set(&self, table: &mut dyn TableLike, path: &[String]) -> Result<(), String> {
        let Some((first, rest)) = path.split_first() else {
            return Err("no key".into());
        };
        let known = table.iter().map(|(key, _)| key.to_owned());
        let known = { known }.find(|key| same(key, first, self.loose));
        let key = known.unwrap_or_else(|| first.clone());
        if rest.is_empty() {
            table.insert(&key, Item::Value(self.value.clone()));
            return Ok(());
        }
        let item = table.entry(&key).or_insert(Item::Table(Table::new()));
        if item.is_array_of_tables() {
            return self.set_in_array(item, first, rest);
        }
        match item.as_table_like_mut() {
            Some(inner) => self.set(inner, rest),
            None => Err(format!("{first} is no table")),
        }
    }

    fn set_in_array(&self, item: &mut Item, what: &str, path: &[String]) -> Result<(), String> {
        let (Some(tables), Some((who, rest))) = (item.as_array_of_tables_mut(), path.split_first())
        else {
            return Err(format!("{what} is no table"));
        };
        let names: Vec<String> = tables.iter().map(name_of).collect();
        let by_name = names.iter().position(|name| same(name, who, self.loose));
        let by_number = who.parse().ok().filter(|place| *place < names.len());
        let place = by_name.or(by_number);
        match place.and_then(|place| tables.get_mut(place)) {
            Some(table) if !rest.is_empty() => self.set(table, rest),
            Some(_) => Err(format!("which key of {what} {who}?")),
            None => Err(format!("no {what} \"{who}\"; there are {}", names.join(", "))),
        }
    }
}

fn name_of(table: &Table) -> String {
    let name = table.get("name").and_then(Item::as_str);
    name.unwrap_or_default().to_owned()
}

fn same(a: &str, b: &str, loose: bool) -> bool {
    a == b || loose && a.eq_ignore_ascii_case(b)
}

fn from_variable((name, value): (String, String)) -> Option<Override> {
    let key = name.strip_prefix(PREFIX).filter(|key| !RESERVED.contains(key))?;
    let path = key.split("__").map(str::to_ascii_lowercase).collect();
    Some(Override { path, value: value_of(&value), source: name, loose: true })
}

fn from_option(text: &str) -> anyhow::Result<Override> {
    let Some((key, value)) = text.split_once('=') else {
        bail!("--set {text}: expected KEY=VALUE, such as safety.rearm=true");
    };
    let keys = Key::parse(key.trim()).map_err(|error| {
        let error = error.to_string();
        let line = error.lines().last().unwrap_or_default();
        anyhow!("--set {text}: \"{key}\" is no key: {line}")
    })?;
    Ok(Override {
        source: format!("--set {text}"),
        path: keys.iter().map(|key| key.get().to_owned()).collect(),
        value: value_of(value),
        loose: false,
    })
}

fn value_of(text: &str) -> Value {
    let text = text.trim();
    text.parse().unwrap_or_else(|_| Value::from(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# a comment\nname = \"x\"\ncontrol_hz = 100\n\n[bus]\nbaud = 1\n\n[[joint]]\nname = \"neck_Pan\"\nid = 1\n";

    fn applied(variables: &[(&str, &str)], set: &[&str]) -> Result<toml::Table, String> {
        let variables = variables.iter().map(|(k, v)| (k.to_string(), v.to_string()));
        let set: Vec<String> = set.iter().map(|text| text.to_string()).collect();
        let overrides = Overrides::new(variables, &set).map_err(|e| e.to_string())?;
        let (text, _) = overrides.apply(TEXT, |_| Ok(()))?;
        assert!(text.contains("# a comment"));
        toml::from_str(&text).map_err(|e| e.to_string())
    }

    #[test]
    fn options_win_over_variables_and_both_over_the_file() {
        let table = applied(
            &[
                ("SERVODANCE_CONTROL_HZ", "50"),
                ("SERVODANCE_BUS__BAUD", "2"),
                ("SERVODANCE_JOINT__NECK_PAN__ID", "9"),
                ("SERVODANCE_ROBOT", "op3"),
                ("HOME", "/"),
            ],
            &["control_hz = 25", "idle=rest", "safety.rearm=true", "retarget.gain.head=0.5"],
        )
        .unwrap();
        assert_eq!(table["control_hz"].as_integer(), Some(25));
        assert_eq!(table["bus"]["baud"].as_integer(), Some(2));
        assert_eq!(table["joint"][0]["id"].as_integer(), Some(9));
        assert_eq!(table["idle"].as_str(), Some("rest"));
        assert_eq!(table["safety"]["rearm"].as_bool(), Some(true));
        assert_eq!(table["retarget"]["gain"]["head"].as_float(), Some(0.5));
        assert!(!table.contains_key("robot"));
    }

    #[test]
    fn what_cannot_be_set_is_told_as_it_was_written() {
        for (set, says) in [
            ("control_hz", "expected KEY=VALUE"),
            ("=1", "is no key"),
            ("joint.knee.id=1", "no joint \"knee\"; there are neck_Pan"),
            ("joint.neck_pan.id=1", "no joint \"neck_pan\""),
            ("joint.0=1", "which key"),
            ("name.x=1", "name is no table"),
        ] {
            let error = applied(&[], &[set]).unwrap_err();
            assert!(error.contains(says) && error.contains(set), "{set}: {error}");
        }
    }

    #[test]
    fn a_variable_that_names_no_key_is_ignored_and_named() {
        let apply = |name: &str, check: &dyn Fn(&str) -> Result<(), String>| {
            let variable = (name.to_owned(), "1".to_owned());
            let overrides = Overrides::new([variable], &[]).unwrap();
            overrides.apply(TEXT, check)
        };
        for (name, check) in [
            ("SERVODANCE_NAME__X", Ok(())),
            ("SERVODANCE_JOINT__KNEE__ID", Ok(())),
            ("SERVODANCE_FOO", Err("unknown field `foo`, expected `name`")),
        ] {
            let check = |_: &str| check.map_err(str::to_owned);
            let (text, ignored) = apply(name, &check).unwrap();
            assert_eq!((text.as_str(), ignored.len()), (TEXT, 1));
            assert!(ignored[0].starts_with(name), "{ignored:?}");
        }
        let refused = |_: &str| Err("invalid type".to_owned());
        let error = apply("SERVODANCE_CONTROL_HZ", &refused).unwrap_err();
        assert_eq!(error, "SERVODANCE_CONTROL_HZ: invalid type");
    }
}
