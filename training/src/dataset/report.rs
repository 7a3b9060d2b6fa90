//! What is in a folder of clips: minutes by source and terms, tempi, how sound
//! the motion is, and a sheet of pictures.

use super::sources::terms;
use crate::dataset::clip_entry::ClipEntry;
use crate::dataset::index;
use crate::dataset::styles::STYLES;
use crate::metrics::quality::foot_skate_ratio;
use crate::motion::tempo;
use anyhow::bail;
use serde::Serialize;
use servodance_model::motion::Clip;
use servodance_runtime::telemetry::picture::{ContactSheet, PoseRow, StickFigure};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// Width of a bar of the histogram, beats a minute, and where it begins and ends.
const BAR_BPM: usize = 10;
const TEMPI_BPM: (usize, usize) = (60, 180);
/// Motions on the sheet, and poses of each.
const ROWS: usize = 16;
const POSES: usize = 9;

#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct SourceReport {
    pub(crate) source: String,
    pub(crate) licence: String,
    pub(crate) clips: usize,
    pub(crate) minutes: f64,
    pub(crate) dance_minutes: f64,
    pub(crate) music_minutes: f64,
    /// Of the worst clip, a share; see [`ClipEntry::bone_change`]; none where it was not measured.
    pub(crate) bone_change: Option<f64>,
    /// Mean share of contact frames in which a foot skates.
    pub(crate) foot_skate: f64,
}

/// What a folder of clips holds; serialised as the JSON of `dataset report`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct DatasetReport {
    pub(crate) sources: Vec<SourceReport>,
    pub(crate) splits: BTreeMap<&'static str, f64>,
    pub(crate) styles: BTreeMap<&'static str, f64>,
    /// Minutes of dance by tempo of the motion: from so many beats a minute on.
    pub(crate) tempi: BTreeMap<usize, f64>,
    /// Minutes of dance too short or too slow to have a tempo.
    pub(crate) no_tempo_minutes: f64,
    pub(crate) unreadable: Vec<String>,
    #[serde(skip)]
    rows: Vec<PoseRow>,
}

impl DatasetReport {
    /// Reads all clips of a folder. `on_progress` receives the share that is done. Fails on an
    /// index that cannot be read, or that lists nothing.
    pub fn of(folder: &Path, on_progress: impl Fn(f64)) -> anyhow::Result<Self> {
        let entries = index::read(folder)?;
        if entries.is_empty() {
            bail!("{}: the index lists no clips", folder.display());
        }
        let mut report = Self::default();
        for bpm in (TEMPI_BPM.0..TEMPI_BPM.1).step_by(BAR_BPM) {
            report.tempi.insert(bpm, 0.0);
        }
        let every = entries.len().div_ceil(ROWS);
        for (number, entry) in entries.iter().enumerate() {
            on_progress(number as f64 / entries.len() as f64);
            match Clip::read_npz(entry.path(folder)) {
                Ok(clip) => {
                    let clip = clip.normalised();
                    report.add(entry, &clip);
                    if number % every == 0 {
                        report.rows.push(row(entry, &clip));
                    }
                }
                Err(error) => report.unreadable.push(error.to_string()),
            }
        }
        Ok(report)
    }

    fn add(&mut self, entry: &ClipEntry, clip: &Clip) {
        let minutes = clip.duration_s() / 60.0;
        *self.splits.entry(entry.split.name()).or_default() += minutes;
        *self.styles.entry(STYLES[entry.style()]).or_default() += minutes;
        if entry.dance {
            self.add_tempo(clip, minutes);
        }
        let licence = terms(&entry.source, &entry.licence);
        let is_it = |known: &SourceReport| known.source == entry.source && known.licence == licence;
        let at = self.sources.iter().position(is_it).unwrap_or_else(|| {
            self.sources.push(SourceReport {
                source: entry.source.clone(),
                licence: licence.to_owned(),
                ..SourceReport::default()
            });
            self.sources.len() - 1
        });
        let source = &mut self.sources[at];
        let clips = source.clips as f64;
        let skate = foot_skate_ratio(clip).unwrap_or(0.0);
        source.foot_skate = (source.foot_skate * clips + skate) / (clips + 1.0);
        source.clips += 1;
        source.minutes += minutes;
        source.dance_minutes += if entry.dance { minutes } else { 0.0 };
        source.music_minutes += if entry.music { minutes } else { 0.0 };
        source.bone_change = match (source.bone_change, entry.bone_change) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
    }

    fn add_tempo(&mut self, clip: &Clip, minutes: f64) {
        match tempo::estimate(clip) {
            Some(tempo) => {
                let (lowest, highest) = TEMPI_BPM;
                let bpm = (60.0 / tempo.period_s) as usize / BAR_BPM * BAR_BPM;
                let bar = bpm.clamp(lowest, highest - BAR_BPM);
                *self.tempi.entry(bar).or_default() += minutes;
            }
            None => self.no_tempo_minutes += minutes,
        }
    }

    /// The report as a table for a terminal.
    pub fn table(&self) -> String {
        let mut text = format!(
            "{:<16}{:>6}{:>9}{:>9}{:>9}{:>13}{:>12}  terms\n",
            "source", "clips", "minutes", "dance", "music", "bone change", "foot skate"
        );
        // Writing to a String cannot fail.
        for s in &self.sources {
            let change = s.bone_change;
            let change = change.map_or("-".to_owned(), |v| format!("{:.1} %", 100.0 * v));
            let skate = format!("{:.1} %", 100.0 * s.foot_skate);
            let _ = writeln!(
                text,
                "{:<16}{:>6}{:>9.1}{:>9.1}{:>9.1}{change:>13}{skate:>12}  {}",
                s.source, s.clips, s.minutes, s.dance_minutes, s.music_minutes, s.licence
            );
        }
        for (title, minutes) in [("split", &self.splits), ("style", &self.styles)] {
            let parts = minutes.iter().map(|(name, minutes)| format!("{name} {minutes:.1}"));
            let parts: Vec<String> = parts.collect();
            let _ = writeln!(text, "\nminutes by {title}: {}", parts.join(", "));
        }
        let _ = writeln!(text, "\nminutes of dance by tempo of the motion, beats a minute:");
        let highest = self.tempi.values().copied().fold(1e-9, f64::max);
        for (bpm, minutes) in &self.tempi {
            let bar = "#".repeat((40.0 * minutes / highest).round() as usize);
            let _ = writeln!(text, "{bpm:>5}{minutes:>7.1}  {bar}");
        }
        let _ = writeln!(text, " none{:>7.1}", self.no_tempo_minutes);
        for reason in &self.unreadable {
            let _ = writeln!(text, "unreadable: {reason}");
        }
        text
    }

    /// A sheet of pictures of the motions as a PNG file.
    pub fn sheet(&self, title: &str) -> anyhow::Result<Vec<u8>> {
        let (mut clips, mut minutes, mut dance) = (0, 0.0, 0.0);
        for source in &self.sources {
            clips += source.clips;
            minutes += source.minutes;
            dance += source.dance_minutes;
        }
        let bars = self.tempi.iter().map(|(bpm, minutes)| (bpm.to_string(), *minutes));
        let sheet = ContactSheet {
            title: title.to_owned(),
            subtitle: format!("{clips} clips, {minutes:.1} minutes, {dance:.1} of them dance"),
            bars: Some((
                "minutes of dance by tempo of the motion, beats a minute".into(),
                bars.collect(),
            )),
            rows: self.rows.clone(),
        };
        sheet.png()
    }
}

fn row(entry: &ClipEntry, clip: &Clip) -> PoseRow {
    let last = clip.poses.len() - 1;
    let figure = |i: usize| StickFigure::dancer(&clip.poses[last * i / (POSES - 1)]);
    let name = entry.name.rsplit('/').next().unwrap_or(&entry.name);
    let kind = if entry.dance { "dance" } else { "no dance" };
    PoseRow {
        label: vec![
            name.chars().take(32).collect(),
            entry.source.clone(),
            format!("{:.1} s, {kind}", clip.duration_s()),
            format!("{}, {}", STYLES[entry.style()], entry.split.name()),
        ],
        figures: (0..POSES).map(figure).collect(),
    }
}
