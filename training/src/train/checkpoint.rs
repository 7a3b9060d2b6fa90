//! The files of a run: checkpoints and weights, as bytes.
//!
//! A checkpoint holds the parameters under their names in the weights file,
//! both moments of AdamW (`adam.`), what else the network needs (`state.`), and
//! in its metadata what the run was asked for: it is refused by any other run.

use std::collections::BTreeMap;

use serde_json::Value;

use super::curve_tally::CurveTally;
use super::error::TrainError;
use super::optimizer::AdamW;
use super::tensors::{Numbers, Tensors, file, floats, read as read_tensors};
use crate::train::autodiff::parameters::Parameters;
use servodance_model::config::ModelConfig;
use servodance_model::weights::FORMAT;

/// The metadata key; its value holds the format's version and the run.
const KEY: &str = "servodance-training-1";

pub(crate) struct CheckpointContents {
    pub parameters: Vec<Vec<f32>>,
    pub adam: AdamW,
    pub step: u64,
    pub tally: CurveTally,
    pub state: Tensors,
}

pub(crate) fn insert(tensors: &mut Tensors, parameters: &Parameters) {
    for parameter in parameters.iter() {
        let numbers = Numbers::F32(parameter.values.clone());
        tensors.insert(parameter.name.clone(), (parameter.shape.clone(), numbers));
    }
}

pub(crate) fn write(
    run: &Value,
    parameters: &Parameters,
    adam: &AdamW,
    step: u64,
    tally: &CurveTally,
    state: Tensors,
) -> Vec<u8> {
    let mut tensors = state;
    insert(&mut tensors, parameters);
    for (parameter, (first, second)) in parameters.iter().zip(adam.first.iter().zip(&adam.second)) {
        for (moment, values) in [("first", first), ("second", second)] {
            let name = format!("adam.{moment}.{}", parameter.name);
            tensors.insert(name, (parameter.shape.clone(), Numbers::F32(values.clone())));
        }
    }
    let sums: Vec<f64> = tally.sums.iter().map(|(_, sum)| *sum).collect();
    let columns: Vec<&str> = tally.sums.iter().map(|(name, _)| name.as_str()).collect();
    tensors.insert("tally.sums".into(), (vec![sums.len()], Numbers::F64(sums)));
    tensors.insert("tally.best".into(), (vec![1], Numbers::F64(vec![tally.best])));
    let about = serde_json::json!({
        "run": run,
        "step": step,
        "adam_steps": adam.steps,
        "columns": columns,
        "count": tally.count,
        "since_best": tally.since_best,
    });
    file(&BTreeMap::from([(KEY.to_owned(), about.to_string())]), &tensors)
}

pub(crate) fn read(
    bytes: &[u8],
    run: &Value,
    parameters: &Parameters,
) -> Result<CheckpointContents, TrainError> {
    let broken = TrainError::Checkpoint;
    let tensors = read_tensors(bytes, &[""]).map_err(broken)?;
    let about = about(bytes)?;
    same_run("", run, &about["run"])?;
    let number = |key: &str| {
        let number = about[key].as_u64();
        number.ok_or_else(|| TrainError::Checkpoint(format!("no `{key}`")))
    };
    let take = |prefix: &str| -> Result<Vec<Vec<f32>>, TrainError> {
        let one = |p: &crate::train::autodiff::parameters::Parameter| {
            floats(&tensors, &format!("{prefix}{}", p.name), p.values.len())
        };
        parameters.iter().map(one).collect::<Result<_, _>>().map_err(broken)
    };
    let doubles = |name: &str| match tensors.get(name) {
        Some((_, Numbers::F64(values))) => Ok(values.clone()),
        _ => Err(broken(format!("tensor `{name}` is missing"))),
    };
    let columns = about["columns"].as_array().cloned().unwrap_or_default();
    let names = columns.iter().map(|name| name.as_str().unwrap_or_default().to_owned());
    let best = doubles("tally.best")?;
    Ok(CheckpointContents {
        parameters: take("")?,
        adam: AdamW {
            first: take("adam.first.")?,
            second: take("adam.second.")?,
            steps: number("adam_steps")?,
        },
        step: number("step")?,
        tally: CurveTally {
            sums: names.zip(doubles("tally.sums")?).collect(),
            count: number("count")?,
            best: best.first().copied().unwrap_or(f64::INFINITY),
            since_best: number("since_best")?,
        },
        state: tensors,
    })
}

fn about(bytes: &[u8]) -> Result<Value, TrainError> {
    let broken = TrainError::Checkpoint;
    let (_, header) =
        safetensors::SafeTensors::read_metadata(bytes).map_err(|e| broken(e.to_string()))?;
    let text = header.metadata().as_ref().and_then(|m| m.get(KEY));
    let text = text.ok_or_else(|| broken(format!("no `{KEY}` in its metadata")))?;
    serde_json::from_str(text).map_err(|e| broken(e.to_string()))
}

/// The first setting in which two runs differ, as an error.
fn same_run(path: &str, expected: &Value, found: &Value) -> Result<(), TrainError> {
    if let (Value::Object(wanted), Value::Object(had)) = (expected, found) {
        let mut keys: Vec<&String> = wanted.keys().chain(had.keys()).collect();
        keys.sort();
        keys.dedup();
        for key in keys {
            let field = match path.is_empty() {
                true => key.clone(),
                false => format!("{path}.{key}"),
            };
            same_run(&field, &expected[key], &found[key])?;
        }
        return Ok(());
    }
    match same_value(expected, found) {
        true => Ok(()),
        false => Err(TrainError::OtherRun {
            field: path.to_owned(),
            expected: in_words(expected),
            found: in_words(found),
        }),
    }
}

/// Numbers may lose their last bit on their way through text.
fn same_value(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same_value(a, b))
        }
        (Value::Number(x), Value::Number(y)) => {
            let near = |x: f64, y: f64| (x - y).abs() <= 1e-12 * x.abs();
            a == b || x.as_f64().zip(y.as_f64()).is_some_and(|(x, y)| near(x, y))
        }
        _ => a == b,
    }
}

fn in_words(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => {
            number.as_f64().map_or(String::new(), |number| (number as f32).to_string())
        }
        Value::Null => "nothing".into(),
        other => other.to_string(),
    }
}

pub(crate) fn weights_file(
    config: &ModelConfig,
    default_style: &str,
    provenance: &Value,
    tensors: &Tensors,
) -> Vec<u8> {
    let metadata = BTreeMap::from([
        ("format".to_owned(), FORMAT.to_owned()),
        ("config".to_owned(), serde_json::json!(config).to_string()),
        ("default_style".to_owned(), default_style.to_owned()),
        ("provenance".to_owned(), provenance.to_string()),
    ]);
    file(&metadata, tensors)
}
