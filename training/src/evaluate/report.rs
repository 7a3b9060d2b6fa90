//! What an evaluation found: JSON for scripts, a table for people.

use super::figures::{Distances, Scores, mean};
use super::texts::TextFigures;
use super::{Codes, Repeat, Request};
use serde::Serialize;
use std::fmt::Write;

/// A mean with its 95 % interval (1.96 standard errors to each side).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Estimate {
    /// The mean over repeats.
    pub mean: f64,
    /// Half the width of the interval.
    pub ci95: f64,
}

impl Estimate {
    pub(super) fn of(values: &[f64]) -> Self {
        let mean = mean(values);
        let n = values.len() as f64;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let ci95 = if n > 1.0 {
            1.96 * (squares / (n - 1.0) / n).sqrt()
        } else {
            0.0
        };
        Self { mean, ci95 }
    }
}

/// Agreement of the motion's beats with the music's.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BeatEstimates {
    /// From each kinematic beat to the nearest music beat (AIST++/FACT).
    pub fact: Estimate,
    /// From each music beat to the nearest kinematic beat (Bailando).
    pub bailando: Estimate,
    /// F1 within 100 ms.
    pub f1: Estimate,
}

/// The generator's, with the F1 of three controls.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ControlledBeat {
    /// Against the music that was danced to.
    #[serde(flatten)]
    pub own: BeatEstimates,
    /// F1 of the same dances against another clip's beats.
    pub wrong_song: Estimate,
    /// F1 of the same dances against the moments between the beats.
    pub shifted: Estimate,
    /// F1 of dances to silence against the beats that they did not hear.
    pub silence: Estimate,
}

/// The same figures of the real dances.
#[derive(Clone, Copy, Debug, Serialize)]
#[allow(missing_docs)] // as in `Evaluation`
pub struct RealFigures {
    pub beat: BeatEstimates,
    pub dist_k: Estimate,
    pub dist_g: Estimate,
    pub pfc: Estimate,
    pub foot_skate: Estimate,
    pub jerk: Estimate,
    pub freeze_ratio: Estimate,
    pub figure_gap_m: Estimate,
}

/// One long dance.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LongDance {
    /// Its length.
    pub minutes: usize,
    /// Mean joint speed of the last minute over that of the first.
    pub speed_kept: f64,
    /// The slowest minute over the mean of all.
    pub slowest_minute: f64,
    /// Mean height of the pelvis in the last minute less that in the first, metres.
    pub height_drift_m: f64,
    /// Mean jerk, m/s^3.
    pub jerk: f64,
    /// Mean jerk of the last minute over that of the first.
    pub jerk_kept: f64,
    /// Share of contact frames in which a foot skates.
    pub foot_skate: f64,
    /// The furthest from where it began, metres.
    pub furthest_m: f64,
    /// How often it stood still while a beat was heard, and was woken.
    pub awakenings: u64,
}

/// All figures.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// `captured and choreographed` from a training file, or `choreography`.
    pub reference: String,
    /// Times that everything was danced.
    pub repeats: usize,
    /// Held-out clips.
    pub clips: usize,
    /// Windows of ten seconds in them.
    pub windows: usize,
    /// Stage 1: mean joint error of the held-out clips, millimetres; interval over
    /// windows.
    pub mpjpe_mm: Estimate,
    /// Stage 1: share of codes that the held-out clips use; interval over body parts.
    pub codes_used: Estimate,
    /// Fréchet distance of kinetic features, normalised by real motion.
    pub fid_k: Estimate,
    /// The same with the published extractor's acceleration.
    pub fid_k_published: Estimate,
    /// Fréchet distance of geometric features.
    pub fid_g: Estimate,
    /// One half of the real windows against the other: what `fid_k` could be.
    pub fid_k_floor: Estimate,
    /// What `fid_g` could be.
    pub fid_g_floor: Estimate,
    /// Mean distance between two generated windows, kinetic.
    pub dist_k: Estimate,
    /// Mean distance between two generated windows, geometric.
    pub dist_g: Estimate,
    /// Real motion of the same clips.
    pub real: RealFigures,
    /// On the beat, with controls.
    pub beat: ControlledBeat,
    /// Physical foot contact (EDGE); lower is better.
    pub pfc: Estimate,
    /// Share of contact frames in which the foot skates.
    pub foot_skate: Estimate,
    /// Mean jerk, m/s^3.
    pub jerk: Estimate,
    /// Share of seconds in which the dancer stands.
    pub freeze_ratio: Estimate,
    /// From a figure of four beats to the most similar one of the same dance,
    /// metres a joint: small where the dance repeats itself.
    pub figure_gap_m: Estimate,
    /// Two dances to one song with two seeds, metres a joint apart.
    pub seeds_gap_m: Estimate,
    /// One long dance, if asked for.
    pub long: Option<LongDance>,
    /// Motions and what texts say of them, if asked for.
    pub text: Option<TextFigures>,
}

impl Evaluation {
    pub(super) fn new(
        request: &Request,
        codes: &Codes,
        repeats: &[Repeat],
        clips: usize,
        windows: usize,
    ) -> Self {
        let over = |value: &dyn Fn(&Repeat) -> f64| {
            Estimate::of(&repeats.iter().map(value).collect::<Vec<_>>())
        };
        let generated = |value: &dyn Fn(&Scores) -> f64| over(&|r| value(&r.generated));
        let real = |value: &dyn Fn(&Scores) -> f64| over(&|r| value(&r.real));
        let distance = |of: &dyn Fn(&Distances) -> f64| {
            let value = |scores: &Scores| scores.distances.as_ref().map_or(f64::NAN, of);
            (generated(&value), real(&value))
        };
        let beat = |side: fn(&Repeat) -> &Scores| BeatEstimates {
            fact: over(&|r| side(r).fact),
            bailando: over(&|r| side(r).bailando),
            f1: over(&|r| side(r).f1),
        };
        let (fid_k, fid_k_floor) = distance(&|d| d.kinetic.fid);
        let (fid_g, fid_g_floor) = distance(&|d| d.geometric.fid);
        let (dist_k, _) = distance(&|d| d.kinetic.dist);
        let (dist_g, _) = distance(&|d| d.geometric.dist);
        // The generated set was normalised by all real windows: so is its real twin.
        let real_dist = |of: &dyn Fn(&Distances) -> f64| {
            generated(&|s| s.distances.as_ref().map_or(f64::NAN, of))
        };
        Self {
            reference: match request.data {
                Some(_) => "held-out clips of the training file".into(),
                None => "choreography (give --data for captured dance)".into(),
            },
            repeats: repeats.len(),
            clips,
            windows,
            mpjpe_mm: Estimate::of(&codes.mpjpe_mm),
            codes_used: Estimate::of(&codes.used),
            fid_k,
            fid_k_published: distance(&|d| d.kinetic_published.fid).0,
            fid_g,
            fid_k_floor,
            fid_g_floor,
            dist_k,
            dist_g,
            real: RealFigures {
                beat: beat(|r| &r.real),
                dist_k: real_dist(&|d| d.kinetic.dist_real),
                dist_g: real_dist(&|d| d.geometric.dist_real),
                pfc: real(&|s| s.pfc),
                foot_skate: real(&|s| s.foot_skate),
                jerk: real(&|s| s.jerk),
                freeze_ratio: real(&|s| s.freeze_ratio),
                figure_gap_m: real(&|s| s.figure_gap_m),
            },
            beat: ControlledBeat {
                own: beat(|r| &r.generated),
                wrong_song: over(&|r| r.wrong_song),
                shifted: over(&|r| r.shifted),
                silence: over(&|r| r.silence),
            },
            pfc: generated(&|s| s.pfc),
            foot_skate: generated(&|s| s.foot_skate),
            jerk: generated(&|s| s.jerk),
            freeze_ratio: generated(&|s| s.freeze_ratio),
            figure_gap_m: generated(&|s| s.figure_gap_m),
            seeds_gap_m: over(&|r| r.seeds_gap_m),
            long: None,
            text: None,
        }
    }

    /// A table for people.
    pub fn table(&self) -> String {
        let (real, beat) = (&self.real, &self.beat);
        let mut text = format!(
            "{}: {} clips, {} windows of 10 s, {} repeats\n\n{:<34}{:>20}{:>20}\n",
            self.reference, self.clips, self.windows, self.repeats, "", "generated", "real"
        );
        for (name, generated, real) in [
            (
                "beat: kinematic to music (FACT)",
                beat.own.fact,
                Some(real.beat.fact),
            ),
            (
                "beat: music to kinematic (Bailando)",
                beat.own.bailando,
                Some(real.beat.bailando),
            ),
            ("beat: F1 within 100 ms", beat.own.f1, Some(real.beat.f1)),
            ("  control: another song", beat.wrong_song, None),
            ("  control: between the beats", beat.shifted, None),
            ("  control: danced to silence", beat.silence, None),
            (
                "FID kinetic (real: its floor)",
                self.fid_k,
                Some(self.fid_k_floor),
            ),
            (
                "FID geometric (real: its floor)",
                self.fid_g,
                Some(self.fid_g_floor),
            ),
            (
                "FID kinetic, published extractor",
                self.fid_k_published,
                None,
            ),
            ("diversity kinetic", self.dist_k, Some(real.dist_k)),
            ("diversity geometric", self.dist_g, Some(real.dist_g)),
            ("physical foot contact (PFC)", self.pfc, Some(real.pfc)),
            (
                "foot skate, share of contact",
                self.foot_skate,
                Some(real.foot_skate),
            ),
            ("mean jerk, m/s^3", self.jerk, Some(real.jerk)),
            (
                "seconds frozen, share",
                self.freeze_ratio,
                Some(real.freeze_ratio),
            ),
            (
                "nearest other figure of 4 beats, m",
                self.figure_gap_m,
                Some(real.figure_gap_m),
            ),
            ("two seeds on one song, m apart", self.seeds_gap_m, None),
            ("tokens: joint error, mm", self.mpjpe_mm, None),
            ("tokens: share of codes used", self.codes_used, None),
        ] {
            let real = real.map_or(String::new(), cell);
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{name:<36}{:>18}{real:>20}", cell(generated));
        }
        if let Some(long) = &self.long {
            let _ = writeln!(
                text,
                "\n{} minutes in one go: speed of the last minute {:.2} of the first, of the slowest \
                 {:.2} of the mean;\nroot {:+.3} m, jerk {:.0} m/s^3 ({:.2} of the first minute's), \
                 foot skate {:.3}, at most {:.1} m away, woken {} times",
                long.minutes,
                long.speed_kept,
                long.slowest_minute,
                long.height_drift_m,
                long.jerk,
                long.jerk_kept,
                long.foot_skate,
                long.furthest_m,
                long.awakenings
            );
        }
        if let Some(figures) = &self.text {
            text.push('\n');
            text.push_str(&figures.table());
        }
        text
    }
}

pub(super) fn cell(estimate: Estimate) -> String {
    format!("{:.3} +- {:.3}", estimate.mean, estimate.ci95)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_the_textbook() {
        // Standard deviation 2, four values: 1.96 * 2 / 2.
        let s = 3f64.sqrt();
        let estimate = Estimate::of(&[5.0 - s, 5.0 - s, 5.0 + s, 5.0 + s]);
        assert!((estimate.mean - 5.0).abs() < 1e-12);
        assert!((estimate.ci95 - 1.96).abs() < 1e-9, "{estimate:?}");
    }
}
