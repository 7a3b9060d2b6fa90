//! The JSON Schema of robot files (`configs/robot.schema.json`), for editors that complete and check TOML.
//!
//! It is kept by hand beside the robots: derived from the types (`schemars`), ranges
//! and doc texts would be attributes of types in three crates, more lines than the
//! tests below, which hold it against the parser and the built-in robots.

use crate::robot::{BUILT_IN, ROBOT_SCHEMA, Robot};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

fn schema() -> Value {
    serde_json::from_str(ROBOT_SCHEMA).unwrap()
}

/// The schema of a table; several may be allowed: the one with properties.
fn table<'a>(schema: &'a Value, name: &str) -> &'a Value {
    match name {
        "" => schema,
        name => &schema["$defs"][name],
    }
}

fn keys(schema: &Value, name: &str) -> BTreeSet<String> {
    let properties = table(schema, name)["properties"].as_object();
    let properties = properties.unwrap_or_else(|| panic!("no table {name}"));
    properties.keys().cloned().collect()
}

/// The keys that the parser expects where it meets one that it does not know.
fn expected_keys(header: &str) -> BTreeSet<String> {
    let neck = servodance_robots::built_in("neck").unwrap().toml;
    let stray = "no_such_key = 1\n";
    let text = match (header, neck.find(header)) {
        ("", _) => format!("{stray}{neck}"),
        (_, Some(at)) => {
            let (before, after) = neck.split_at(at + header.len());
            format!("{before}\n{stray}{after}")
        }
        (_, None) => format!("{neck}\n{header}\n{stray}"),
    };
    let error = Robot::from_text(&text, Path::new("neck.toml")).unwrap_err().to_string();
    let (_, expected) = error.split_once("expected").unwrap_or_else(|| panic!("{error}"));
    let quoted = expected.split('`').skip(1).step_by(2);
    quoted.map(String::from).collect()
}

#[test]
fn every_key_of_the_parser_is_in_the_schema_and_no_other() {
    let schema = schema();
    for (header, name) in [
        ("", ""),
        ("[bus]", "bus"),
        ("[imu]", "imu"),
        ("[getup]", "getup"),
        ("[[getup.front]]", "getup_pose"),
        ("[[joint]]", "joint"),
        ("[safety]", "safety"),
        ("[retarget]", "retarget"),
        ("[retarget.body]", "body"),
        ("[retarget.gain]", "gain"),
        ("[retarget.weights]", "weights"),
        ("[retarget.torque]", "torque"),
        ("[[retarget.tip]]", "tip"),
        ("[[retarget.capsule]]", "capsule"),
        ("[[retarget.couple]]", "couple"),
        ("[[retarget.rod]]", "rod"),
        ("[[retarget.wheel]]", "wheel"),
    ] {
        assert_eq!(keys(&schema, name), expected_keys(header), "{header}");
        assert_eq!(table(&schema, name)["additionalProperties"], false, "{header}");
    }
}

/// Whether a value is as its schema says, as far as this schema goes: types,
/// choices, keys that are there and keys that must be.
fn fits(root: &Value, schema: &Value, value: &Value) -> Result<(), String> {
    if let Some(name) = schema["$ref"].as_str() {
        let name = name.trim_start_matches("#/$defs/");
        return fits(root, &root["$defs"][name], value);
    }
    if let Some(choices) = schema["oneOf"].as_array() {
        let fitting = choices.iter().filter(|s| fits(root, s, value).is_ok()).count();
        return (fitting == 1).then_some(()).ok_or(format!("{fitting} fit {value}"));
    }
    let kind = match schema["type"].as_str() {
        Some("object") => value.is_object(),
        Some("array") => value.is_array(),
        Some("string") => value.is_string(),
        Some("boolean") => value.is_boolean(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("number") => value.is_number(),
        _ => true,
    };
    if !kind {
        return Err(format!("{value} is no {}", schema["type"]));
    }
    if schema["enum"].as_array().is_some_and(|choices| !choices.contains(value)) {
        return Err(format!("{value} is none of {}", schema["enum"]));
    }
    for item in value.as_array().into_iter().flatten() {
        fits(root, &schema["items"], item)?;
    }
    let Some(members) = value.as_object() else {
        return Ok(());
    };
    for (key, member) in members {
        let inner = match (&schema["properties"][key], &schema["additionalProperties"]) {
            (Value::Null, others @ Value::Object(_)) => others,
            (Value::Null, _) => return Err(format!("unknown key {key}")),
            (known, _) => known,
        };
        fits(root, inner, member).map_err(|e| format!("{key}: {e}"))?;
    }
    let required = schema["required"].as_array().into_iter().flatten();
    match { required }.find(|key| !members.contains_key(key.as_str().unwrap_or_default())) {
        Some(missing) => Err(format!("no {missing}")),
        None => Ok(()),
    }
}

#[test]
fn the_built_in_robots_fit_and_a_wrong_one_does_not() {
    let schema = schema();
    for built_in in BUILT_IN {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(built_in.file);
        let text = std::fs::read_to_string(file).unwrap();
        let robot: toml::Table = toml::from_str(&text).unwrap();
        let robot = serde_json::to_value(&robot).unwrap();
        assert_eq!(fits(&schema, &schema, &robot), Ok(()), "{}", built_in.name);
        let mut wrong = robot.clone();
        wrong["control_hz"] = "fast".into();
        assert!(fits(&schema, &schema, &wrong).is_err());
        let mut strange = robot.clone();
        strange["joint"][0]["colour"] = "red".into();
        assert!(fits(&schema, &schema, &strange).is_err());
    }
}
