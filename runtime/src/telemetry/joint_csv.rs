//! Joint positions as CSV: `time_s`, then a column a joint, radians.

use crate::telemetry::pending_file::PendingFile;
use anyhow::Context;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// A file under construction; without [`JointCsv::finish`] none appears.
pub struct JointCsv {
    pending: PendingFile,
    writer: BufWriter<File>,
}

impl JointCsv {
    pub fn create(path: &Path, names: &[String]) -> anyhow::Result<Self> {
        let pending = PendingFile::create(path)?;
        let mut writer = pending.writer()?;
        let columns: Vec<String> = names.iter().map(|name| quoted(name)).collect();
        writeln!(writer, "time_s,{}", columns.join(","))?;
        Ok(Self { pending, writer })
    }

    pub fn write(
        &mut self,
        time_s: f64,
        positions_rad: impl Iterator<Item = f64>,
    ) -> anyhow::Result<()> {
        write!(self.writer, "{time_s:.4}")?;
        for position in positions_rad {
            write!(self.writer, ",{position:.6}")?;
        }
        writeln!(self.writer)?;
        Ok(())
    }

    pub fn finish(mut self) -> anyhow::Result<()> {
        let flushed = self.writer.flush();
        flushed.context("cannot write the joint positions")?;
        drop(self.writer);
        self.pending.finish()
    }
}

/// A column's name; quoted where it would fall apart.
fn quoted(name: &str) -> String {
    match name.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name.to_owned(),
    }
}
