//! The variants beside each other: CSV for scripts, a table for people, a picture.

use super::row::{AblationRow, AblationScores, COLUMNS, MeanAndInterval};
use servodance_runtime::telemetry::picture::{Dot, DotChart, DotPanel};
use std::fmt::Write;

/// All variants, the whole model first.
#[derive(Clone, Debug)]
pub struct AblationTable {
    /// In the order of [`super::VARIANTS`].
    pub(super) rows: Vec<AblationRow>,
}

impl AblationTable {
    /// A line a variant; two fields a figure, the mean and half the interval.
    pub fn csv(&self) -> String {
        let mut text = "variant,nll,nll_for_music".to_owned();
        for (name, _) in COLUMNS {
            text += &format!(",{name},{name}_ci95");
        }
        text.push('\n');
        for row in &self.rows {
            text += &format!("{},{},{}", row.name, row.nll, row.nll_for_music);
            for (_, figure) in COLUMNS {
                let (mean, ci95) = figure(&row.scores);
                text += &format!(",{mean},{ci95}");
            }
            text.push('\n');
        }
        text
    }

    /// The table in Markdown, one row a variant.
    pub fn text(&self) -> String {
        let mut text = "| variant | error, mm | codes used | nll | for music | FACT | F1 \
                        | to silence | FID kinetic | FID geometric | jerk |\n\
                        |---|---|---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
        for row in &self.rows {
            let cell = |figure: fn(&AblationScores) -> MeanAndInterval, digits: usize| {
                let (mean, ci95) = figure(&row.scores);
                format!("{mean:.digits$} ± {ci95:.digits$}")
            };
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "| {}: {} | {} | {} | {:.2} | {:+.2} | {} | {} | {} | {} | {} | {} |",
                row.name,
                row.what,
                cell(|s| s.mpjpe_mm, 1),
                cell(|s| s.codes_used, 2),
                row.nll,
                row.nll_for_music,
                cell(|s| s.fact, 3),
                cell(|s| s.f1, 3),
                cell(|s| s.f1_silence, 3),
                cell(|s| s.fid_k, 0),
                cell(|s| s.fid_g, 1),
                cell(|s| s.jerk, 0),
            );
        }
        text
    }

    /// A panel a figure, a dot with its interval a variant.
    pub fn picture(&self) -> DotChart {
        let panel = |title: &str, figure: fn(&AblationScores) -> MeanAndInterval| DotPanel {
            title: title.into(),
            dots: self
                .rows
                .iter()
                .map(|row| Dot { name: row.name.clone(), figure: Some(figure(&row.scores)) })
                .collect(),
        };
        DotChart {
            title: "What each part is good for".into(),
            subtitle: "each variant trained and scored alike; mean and 95 % interval over dances"
                .into(),
            panels: vec![
                panel("reconstruction error, mm (lower is better)", |s| s.mpjpe_mm),
                panel("share of codes used (higher)", |s| s.codes_used),
                panel("on the beat: F1 within 100 ms (higher)", |s| s.f1),
                panel("FID kinetic (lower)", |s| s.fid_k),
                panel("FID geometric (lower)", |s| s.fid_g),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_as_many_fields_as_the_header() {
        let [a, b] = [(0.5, 0.25), (2.0, 1.0)];
        let row = AblationRow {
            name: "encodec".into(),
            what: "other ears".into(),
            nll: 12.5,
            nll_for_music: 0.25,
            scores: AblationScores {
                mpjpe_mm: a,
                codes_used: a,
                fact: a,
                f1: b,
                f1_silence: a,
                fid_k: a,
                fid_g: a,
                dist_k: a,
                dist_g: a,
                jerk: a,
            },
        };
        let table = AblationTable { rows: vec![row] };
        let csv = table.csv();
        let fields: Vec<usize> = csv.lines().map(|l| l.split(',').count()).collect();
        assert_eq!(fields, [3 + 2 * COLUMNS.len(); 2], "{csv}");
        let text = table.text();
        assert!(text.contains("| 12.50 | +0.25 | 0.500 ± 0.250 | 2.000 ± 1.000 |"), "{text}");
        assert_eq!(table.picture().png().unwrap()[1..4], *b"PNG");
    }
}
