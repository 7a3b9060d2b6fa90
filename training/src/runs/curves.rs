//! The curves of a run: a CSV file with a line a report, and a picture of it.
//!
//! A run that goes on keeps the lines up to where it goes on from.

use crate::train::{CurveRow, StageKind};
use anyhow::{Context, ensure};
use servodance_runtime::output::write_whole;
use servodance_runtime::picture::curves::{Curve, Curves, Panel};
use std::path::{Path, PathBuf};

/// The curves so far.
pub struct CurveFile {
    csv: PathBuf,
    png: PathBuf,
    stage: StageKind,
    columns: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl CurveFile {
    /// Those in the folder up to a step.
    pub fn open(folder: &Path, up_to: u64, stage: StageKind) -> anyhow::Result<Self> {
        let mut curves = Self {
            csv: folder.join("curves.csv"),
            png: folder.join("curves.png"),
            stage,
            columns: Vec::new(),
            rows: Vec::new(),
        };
        if up_to > 0 && curves.csv.exists() {
            curves.read(up_to)?;
        }
        Ok(curves)
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

    /// Another line; writes both files.
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
            let fields = row.iter().map(|v| {
                if v.is_finite() {
                    v.to_string()
                } else {
                    String::new()
                }
            });
            text += &(fields.collect::<Vec<_>>().join(",") + "\n");
        }
        write_whole(&self.csv, text.as_bytes())?;
        write_whole(&self.png, &self.picture().png()?)
    }

    fn picture(&self) -> Curves {
        let panel = |title: &str, wanted: &dyn Fn(&str) -> bool| Panel {
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
        let (score, parts): (&[&str], &str) = match self.stage {
            StageKind::VqVae => (&["loss", "val_loss"], "_used"),
            StageKind::MotionSeq => (&["loss", "val_nll", "wrong_nll", "silent_nll"], "acc_"),
        };
        let last = self.rows.last().map_or(0.0, |row| row[0]);
        Curves {
            title: format!("Training of {}", self.stage.name()),
            subtitle: format!("{last} steps; val: held-out clips"),
            panels: vec![
                panel("Loss", &|name| score.contains(&name)),
                panel("Codes", &|name| {
                    name.contains(parts) && name != "codes_used"
                }),
                panel("Learning rate", &|name| name == "learning_rate"),
                panel("Gradient", &|name| name == "gradient"),
            ],
        }
    }
}
