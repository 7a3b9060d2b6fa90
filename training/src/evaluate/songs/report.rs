//! What the dances to songs showed: JSON for scripts, a table for people.

use super::SongDance;
use super::controls::ByMusic;
use super::dance_figures::DanceFigures;
use serde::Serialize;
use std::fmt::Write;

/// All figures of dances to songs; serialised as the JSON of `servodance evaluate --songs`.
#[derive(Clone, Debug, Serialize)]
pub struct SongEvaluation {
    pub(crate) style: String,
    pub(crate) seeds: usize,
    pub(crate) generated: DanceFigures,
    pub(crate) captured_clips: usize,
    /// The same of captured dance, where some was given.
    pub(crate) captured: Option<DanceFigures>,
    /// F1 of kinematic beats within 100 ms: against the beats of the songs, means.
    pub(crate) f1: ByMusic,
    /// Against those that the tracker found.
    pub(crate) f1_found: ByMusic,
    /// Shares of the pairs of song and seed that beat each control; `own`: all of them.
    pub(crate) wins: ByMusic,
    pub(crate) wins_found: ByMusic,
    /// Share of the pairs that beat all controls of other beats, by the beats found.
    pub(crate) wins_found_other_beats: f64,
    /// Correlation of the loudness of bars and the speed of the dancer in them, mean over
    /// the dances to music with dynamics.
    pub(crate) loudness_answer: Option<f64>,
    pub(crate) with_dynamics: usize,
    /// Share of the changes of section that have a change of figure within a beat.
    pub(crate) section_answer: Option<f64>,
    pub(crate) section_answer_by_chance: Option<f64>,
    pub(crate) section_changes: usize,
    /// Share of the dances that no other song's beats fit better.
    pub(crate) retrieved: f64,
    pub(crate) retrieved_by_chance: f64,
    pub(crate) dances: Vec<SongDance>,
}

/// Label of a figure of a dance, and where the figure stands.
type LabelledFigure = (&'static str, fn(&DanceFigures) -> f64);
const FIGURES: [LabelledFigure; 7] = [
    ("legs' share of energy", |f| f.richness.legs_share),
    ("effective dimensions of the poses", |f| f.richness.dimensions),
    ("turning, rad/s", |f| f.richness.turning_rad_s),
    ("travel, m/s", |f| f.richness.travel_m_s),
    ("new figures a minute", |f| f.richness.figures_per_min),
    ("mean jerk, m/s^3", |f| f.jerk_m_s3),
    ("foot skate, share of contact", |f| f.foot_skate),
];

impl SongEvaluation {
    pub(super) fn new(
        style: String,
        seeds: usize,
        dances: Vec<SongDance>,
        captured: &[DanceFigures],
    ) -> Self {
        let figures: Vec<DanceFigures> = dances.iter().map(|dance| dance.figures).collect();
        let [f1, f1_found] = [|d: &SongDance| d.f1, |d: &SongDance| d.f1_found]
            .map(|of| dances.iter().map(of).collect::<Vec<ByMusic>>());
        let answers: Vec<f64> = dances.iter().filter_map(|d| d.loudness_answer).collect();
        let (hits, changes, chance) = section_totals(&dances);
        let retrieved = dances.iter().filter(|dance| dance.retrieved).count();
        let share = |part: f64| (changes > 0).then(|| part / changes as f64);
        Self {
            style,
            seeds,
            generated: DanceFigures::mean(&figures),
            captured_clips: captured.len(),
            captured: (!captured.is_empty()).then(|| DanceFigures::mean(captured)),
            f1: ByMusic::mean(&f1),
            f1_found: ByMusic::mean(&f1_found),
            wins: ByMusic::wins(&f1),
            wins_found: ByMusic::wins(&f1_found),
            wins_found_other_beats: f1_found.iter().filter(|f1| f1.beats_other_beats()).count()
                as f64
                / dances.len().max(1) as f64,
            loudness_answer: (!answers.is_empty())
                .then(|| answers.iter().sum::<f64>() / answers.len() as f64),
            with_dynamics: answers.len(),
            section_answer: share(hits),
            section_answer_by_chance: share(chance),
            section_changes: changes,
            retrieved: retrieved as f64 / dances.len().max(1) as f64,
            retrieved_by_chance: seeds as f64 / dances.len().max(1) as f64,
            dances,
        }
    }

    /// The figures as a table for a terminal.
    pub fn table(&self) -> String {
        let captured = match self.captured_clips {
            0 => String::new(),
            clips => format!("captured ({clips})"),
        };
        let mut text = format!(
            "{}: {} dances, {} seeds\n\n{:<36}{:>10}{captured:>16}\n",
            self.style,
            self.dances.len(),
            self.seeds,
            "",
            "generated"
        );
        // Writing to a String cannot fail.
        for (name, of) in FIGURES {
            let real = self.captured.as_ref().map_or(String::new(), |r| format!("{:.2}", of(r)));
            let _ = writeln!(text, "{name:<36}{:>10.2}{real:>16}", of(&self.generated));
        }
        let _ = writeln!(
            text,
            "\n{:<36}{:>10}{:>12}{:>13}{:>10}{:>8}",
            "F1 within 100 ms", "own music", "same tempo", "other tempo", "shifted", "silent"
        );
        for (name, v, of) in [
            ("against the song's beats", &self.f1, 1.0),
            ("against the beats found live", &self.f1_found, 1.0),
            ("beaten, % (first: all of them)", &self.wins, 100.0),
            ("the same by the beats found live", &self.wins_found, 100.0),
        ] {
            let [same, other, shifted, silent] = v.controls().map(|value| of * value);
            let digits = if of > 1.0 { 0 } else { 3 };
            let _ = writeln!(
                text,
                "{name:<36}{:>10.digits$}{same:>12.digits$}{other:>13.digits$}{shifted:>10.digits$}{silent:>8.digits$}",
                of * v.own
            );
        }
        let _ = writeln!(
            text,
            "other tempo, shifted and silent all beaten, by the beats found live: {:.0} %\n",
            100.0 * self.wins_found_other_beats
        );
        let answer = self.loudness_answer.map_or("-".to_owned(), |r| format!("{r:.2}"));
        let _ = writeln!(
            text,
            "loudness of bars and speed of the dancer: correlation {answer} ({} dances to music with dynamics)",
            self.with_dynamics
        );
        if let (Some(hit), Some(chance)) = (self.section_answer, self.section_answer_by_chance) {
            let _ = writeln!(
                text,
                "changes of section with another figure within a beat: {:.0} % of {}, by chance {:.0} % ({:.2} times)",
                100.0 * hit,
                self.section_changes,
                100.0 * chance,
                hit / chance.max(1e-9)
            );
        }
        let _ = writeln!(
            text,
            "dances that no other song's beats fit better: {:.0} % (by chance {:.0} %)",
            100.0 * self.retrieved,
            100.0 * self.retrieved_by_chance
        );
        text
    }
}

/// Changes of section that were answered, all of them, and how many by chance.
fn section_totals(dances: &[SongDance]) -> (f64, usize, f64) {
    let (mut hits, mut changes, mut chance) = (0.0, 0, 0.0);
    for dance in dances {
        let Some([hit, by_chance]) = dance.section_answer else { continue };
        hits += hit * dance.section_changes as f64;
        chance += by_chance * dance.section_changes as f64;
        changes += dance.section_changes;
    }
    (hits, changes, chance)
}
