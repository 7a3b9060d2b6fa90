//! The curves of a run: a CSV file with a line a report, and a picture of it.
//!
//! A run that goes on keeps the lines up to where it goes on from.

use crate::train::{CurveRow, TrainedNetwork};
use anyhow::{Context, ensure};
use servodance_runtime::telemetry::pending_file::write_whole;
use servodance_runtime::telemetry::picture::{Curve, CurveChart, CurvePanel};
use std::path::{Path, PathBuf};

pub struct CurveFile {
    csv: PathBuf,
    png: PathBuf,
    network: TrainedNetwork,
    columns: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl CurveFile {
    /// Those in the folder up to a step; none where there is no file yet.
    pub fn open(folder: &Path, up_to: u64, network: TrainedNetwork) -> anyhow::Result<Self> {
        let mut curves = Self::empty(folder, network);
        if up_to > 0 && curves.csv.exists() {
            curves.read(up_to)?;
        }
        Ok(curves)
    }

    /// All of a run that has ended. Fails where the file is missing, torn or without a line.
    pub fn finished(folder: &Path, network: TrainedNetwork) -> anyhow::Result<Self> {
        let mut curves = Self::empty(folder, network);
        curves.read(u64::MAX)?;
        let name = curves.csv.display();
        ensure!(!curves.rows.is_empty(), "{name}: no line of a training");
        Ok(curves)
    }

    fn empty(folder: &Path, network: TrainedNetwork) -> Self {
        Self {
            csv: folder.join("curves.csv"),
            png: folder.join("curves.png"),
            network,
            columns: Vec::new(),
            rows: Vec::new(),
        }
    }

    fn read(&mut self, up_to: u64) -> anyhow::Result<()> {
        let name = self.csv.display().to_string();
        let text =
            std::fs::read_to_string(&self.csv).with_context(|| format!("cannot read {name}"))?;
        let mut lines = text.lines();
        let header = lines.next().unwrap_or_default();
        self.columns = header.split(',').map(str::to_owned).collect();
        for (i, line) in lines.enumerate() {
            let value = |field: &str| match field {
                "" => Ok(f64::NAN),
                _ => field.parse::<f64>(),
            };
            let row: Result<Vec<f64>, _> = line.split(',').map(value).collect();
            let row = row.with_context(|| format!("{name}:{}: not a number", i + 2))?;
            ensure!(
                row.len() == self.columns.len(),
                "{name}:{}: not as many fields as the header",
                i + 2
            );
            if row[0] <= up_to as f64 {
                self.rows.push(row);
            }
        }
        Ok(())
    }

    pub fn add(&mut self, line: &CurveRow) -> anyhow::Result<()> {
        let names = line.values.iter().map(|(name, _)| name.clone());
        let columns: Vec<String> = std::iter::once("step".to_owned()).chain(names).collect();
        if self.rows.is_empty() {
            self.columns = columns;
        }
        let of_column = |column: &String| {
            let value = line.values.iter().find(|(name, _)| name == column);
            value.map_or(f64::NAN, |(_, value)| *value)
        };
        let values = self.columns[1..].iter().map(of_column);
        let row = std::iter::once(line.step as f64).chain(values).collect();
        self.rows.push(row);
        let mut text = self.columns.join(",") + "\n";
        for row in &self.rows {
            let fields =
                row.iter().map(|v| if v.is_finite() { v.to_string() } else { String::new() });
            text += &(fields.collect::<Vec<_>>().join(",") + "\n");
        }
        write_whole(&self.csv, text.as_bytes())?;
        write_whole(&self.png, &self.picture().png()?)
    }

    /// The line with the least finite value in a column, as the values of some
    /// columns; not a number where a column is missing or never finite.
    pub fn best<const N: usize>(&self, by: &str, columns: [&str; N]) -> [f64; N] {
        let place = |name: &str| self.columns.iter().position(|column| column == name);
        let value = |row: &[f64], name: &str| place(name).map_or(f64::NAN, |at| row[at]);
        let finite = self.rows.iter().filter(|row| value(row, by).is_finite());
        let best = finite.min_by(|a, b| value(a, by).total_cmp(&value(b, by)));
        columns.map(|name| best.map_or(f64::NAN, |row| value(row, name)))
    }

    fn picture(&self) -> CurveChart {
        let panel = |title: &str, wanted: &dyn Fn(&str) -> bool| CurvePanel {
            title: title.into(),
            curves: (1..self.columns.len())
                .filter(|c| wanted(&self.columns[*c]))
                .take(4)
                .map(|c| Curve {
                    name: self.columns[c].clone(),
                    samples: self.rows.iter().map(|row| (row[0], row[c])).collect(),
                })
                .collect(),
        };
        let (score, parts): (&[&str], &str) = match self.network {
            TrainedNetwork::VqVae => (&["loss", "val_loss"], "_used"),
            TrainedNetwork::MotionSeq => (&["loss", "val_nll", "wrong_nll", "silent_nll"], "acc_"),
        };
        let last = self.rows.last().map_or(0.0, |row| row[0]);
        CurveChart {
            title: format!("Training of {}", self.network.name()),
            subtitle: format!("{last} steps; val: held-out clips"),
            panels: vec![
                panel("Loss", &|name| score.contains(&name)),
                panel("Codes", &|name| name.contains(parts) && name != "codes_used"),
                panel("Learning rate", &|name| name == "learning_rate"),
                panel("Gradient", &|name| name == "gradient"),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_of_an_ended_run_that_are_missing_or_torn_are_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let finished = || CurveFile::finished(folder.path(), TrainedNetwork::MotionSeq);
        let error = finished().err().unwrap();
        assert!(error.to_string().contains("cannot read"), "{error}");
        for (text, says) in [
            ("", "no line of a training"),
            ("step,val_nll,wrong_nll\n", "no line of a training"),
            ("step,val_nll,wrong_nll\n20,3.5\n", ":2: not as many fields"),
            ("step,val_nll,wrong_nll\n20,3.5,4.x\n", ":2: not a number"),
        ] {
            std::fs::write(folder.path().join("curves.csv"), text).unwrap();
            let error = finished().err().unwrap();
            assert!(error.to_string().contains(says), "{error}");
        }
        let text = "step,val_nll,wrong_nll\n20,3.5,4.5\n40,3.0,4.25\n60,,\n";
        std::fs::write(folder.path().join("curves.csv"), text).unwrap();
        let curves = finished().unwrap();
        assert_eq!(curves.best("val_nll", ["val_nll", "wrong_nll"]), [3.0, 4.25]);
    }
}
