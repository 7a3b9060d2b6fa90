//! What an evaluation found: JSON for scripts, a table for people.

use super::estimate::{MeanEstimate, cell};
use super::figures::{DanceScores, FeatureDistances};
use super::reconstruction::CodeUsage;
use super::repeat::EvaluationRepeat;
use super::request::EvaluationRequest;
use super::texts::TextFigures;
use serde::Serialize;
use std::fmt::Write;

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct BeatEstimates {
    /// From each kinematic beat to the nearest music beat (AIST++/FACT).
    pub(crate) fact: MeanEstimate,
    /// From each music beat to the nearest kinematic beat (Bailando).
    pub(crate) bailando: MeanEstimate,
    /// F1 within 100 ms.
    pub(crate) f1: MeanEstimate,
}

/// The generator's, with the F1 of three controls.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct ControlledBeat {
    #[serde(flatten)]
    pub(crate) own: BeatEstimates,
    /// F1 of the same dances against another clip's beats.
    pub(crate) wrong_song: MeanEstimate,
    /// F1 of the same dances against the moments between the beats.
    pub(crate) shifted: MeanEstimate,
    /// F1 of dances to silence against the beats that they did not hear.
    pub(crate) silence: MeanEstimate,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct PhysicalFigures {
    /// Physical foot contact (EDGE); lower is better.
    pub(crate) pfc: MeanEstimate,
    pub(crate) foot_skate: MeanEstimate,
    /// Mean jerk of all joints, m/s^3.
    pub(crate) jerk: MeanEstimate,
    /// Share of seconds in which the dancer stands.
    pub(crate) freeze_ratio: MeanEstimate,
    /// Metres a joint from a figure of four beats to the most similar one of the same dance.
    pub(crate) figure_gap_m: MeanEstimate,
}

/// Label of a figure, and where the figure stands.
type EstimateRow<T> = (&'static str, fn(&T) -> MeanEstimate);

impl PhysicalFigures {
    fn over(repeats: &[EvaluationRepeat], side: fn(&EvaluationRepeat) -> &DanceScores) -> Self {
        let over = |value: fn(&DanceScores) -> f64| {
            MeanEstimate::of(&repeats.iter().map(|r| value(side(r))).collect::<Vec<_>>())
        };
        Self {
            pfc: over(|s| s.pfc),
            foot_skate: over(|s| s.foot_skate),
            jerk: over(|s| s.jerk),
            freeze_ratio: over(|s| s.freeze_ratio),
            figure_gap_m: over(|s| s.figure_gap_m),
        }
    }
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct RealFigures {
    pub(crate) beat: BeatEstimates,
    pub(crate) dist_k: MeanEstimate,
    pub(crate) dist_g: MeanEstimate,
    #[serde(flatten)]
    pub(crate) physical: PhysicalFigures,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct LongDance {
    pub(crate) minutes: usize,
    /// Mean joint speed of the last minute over that of the first.
    pub(crate) speed_kept: f64,
    pub(crate) slowest_minute: f64,
    /// Mean height of the pelvis in the last minute less that in the first, metres.
    pub(crate) height_drift_m: f64,
    pub(crate) jerk: f64,
    /// Mean jerk of the last minute over that of the first.
    pub(crate) jerk_kept: f64,
    pub(crate) foot_skate: f64,
    /// The furthest from where it began, metres.
    pub(crate) furthest_m: f64,
    /// How often it stood still while a beat was heard, and was woken.
    pub(crate) awakenings: u64,
}

/// All figures of an evaluation; serialised as the JSON of `servodance evaluate`.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// `captured and choreographed` from a training file, or `choreography`.
    pub(crate) reference: String,
    pub(crate) repeats: usize,
    pub(crate) clips: usize,
    /// Windows of ten seconds in them.
    pub(crate) windows: usize,
    /// The VQ-VAE: mean joint error of the held-out clips, millimetres; interval over windows.
    pub(crate) mpjpe_mm: MeanEstimate,
    /// The VQ-VAE: share of codes that the held-out clips use; interval over body parts.
    pub(crate) codes_used: MeanEstimate,
    /// Fréchet distance of kinetic features, normalised by real motion.
    pub(crate) fid_k: MeanEstimate,
    /// The same with the published extractor's acceleration.
    pub(crate) fid_k_published: MeanEstimate,
    /// Fréchet distance of geometric features.
    pub(crate) fid_g: MeanEstimate,
    /// One half of the real windows against the other: what `fid_k` could be.
    pub(crate) fid_k_floor: MeanEstimate,
    /// What `fid_g` could be.
    pub(crate) fid_g_floor: MeanEstimate,
    /// Mean distance between two generated windows, kinetic.
    pub(crate) dist_k: MeanEstimate,
    /// Mean distance between two generated windows, geometric.
    pub(crate) dist_g: MeanEstimate,
    pub(crate) real: RealFigures,
    pub(crate) beat: ControlledBeat,
    #[serde(flatten)]
    pub(crate) physical: PhysicalFigures,
    /// Two dances to one song with two seeds, metres a joint apart.
    pub(crate) seeds_gap_m: MeanEstimate,
    pub(crate) long: Option<LongDance>,
    /// Motions and what texts say of them, if asked for.
    pub(crate) text: Option<TextFigures>,
}

impl Evaluation {
    pub(super) fn new(
        request: &EvaluationRequest,
        codes: &CodeUsage,
        repeats: &[EvaluationRepeat],
        clips: usize,
        windows: usize,
    ) -> Self {
        let over = |value: &dyn Fn(&EvaluationRepeat) -> f64| {
            MeanEstimate::of(&repeats.iter().map(value).collect::<Vec<_>>())
        };
        let generated = |value: &dyn Fn(&DanceScores) -> f64| over(&|r| value(&r.generated));
        let real = |value: &dyn Fn(&DanceScores) -> f64| over(&|r| value(&r.real));
        let distance = |of: &dyn Fn(&FeatureDistances) -> f64| {
            let value = |scores: &DanceScores| scores.distances.as_ref().map_or(f64::NAN, of);
            (generated(&value), real(&value))
        };
        let beat = |side: fn(&EvaluationRepeat) -> &DanceScores| BeatEstimates {
            fact: over(&|r| side(r).fact),
            bailando: over(&|r| side(r).bailando),
            f1: over(&|r| side(r).f1),
        };
        let (fid_k, fid_k_floor) = distance(&|d| d.kinetic.fid);
        let (fid_g, fid_g_floor) = distance(&|d| d.geometric.fid);
        let (dist_k, _) = distance(&|d| d.kinetic.dist);
        let (dist_g, _) = distance(&|d| d.geometric.dist);
        // The generated set was normalised by all real windows: so is its real twin.
        let real_dist = |of: &dyn Fn(&FeatureDistances) -> f64| {
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
            mpjpe_mm: MeanEstimate::of(&codes.mpjpe_mm),
            codes_used: MeanEstimate::of(&codes.used),
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
                physical: PhysicalFigures::over(repeats, |r| &r.real),
            },
            beat: ControlledBeat {
                own: beat(|r| &r.generated),
                wrong_song: over(&|r| r.wrong_song),
                shifted: over(&|r| r.shifted),
                silence: over(&|r| r.silence),
            },
            physical: PhysicalFigures::over(repeats, |r| &r.generated),
            seeds_gap_m: over(&|r| r.seeds_gap_m),
            long: None,
            text: None,
        }
    }

    /// The figures as a table for a terminal.
    pub fn table(&self) -> String {
        let (real, beat) = (&self.real, &self.beat);
        let mut text = format!(
            "{}: {} clips, {} windows of 10 s, {} repeats\n\n{:<34}{:>20}{:>20}\n",
            self.reference, self.clips, self.windows, self.repeats, "", "generated", "real"
        );
        let mut row = |name: &str, generated: MeanEstimate, real: Option<MeanEstimate>| {
            let real = real.map_or(String::new(), cell);
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{name:<36}{:>18}{real:>20}", cell(generated));
        };
        let beats: [EstimateRow<BeatEstimates>; 3] = [
            ("beat: kinematic to music (FACT)", |b| b.fact),
            ("beat: music to kinematic (Bailando)", |b| b.bailando),
            ("beat: F1 within 100 ms", |b| b.f1),
        ];
        for (name, of) in beats {
            row(name, of(&beat.own), Some(of(&real.beat)));
        }
        row("  control: another song", beat.wrong_song, None);
        row("  control: between the beats", beat.shifted, None);
        row("  control: danced to silence", beat.silence, None);
        let floor = Some(self.fid_k_floor);
        row("FID kinetic (real: its floor)", self.fid_k, floor);
        let floor = Some(self.fid_g_floor);
        row("FID geometric (real: its floor)", self.fid_g, floor);
        let published = self.fid_k_published;
        row("FID kinetic, published extractor", published, None);
        row("diversity kinetic", self.dist_k, Some(real.dist_k));
        row("diversity geometric", self.dist_g, Some(real.dist_g));
        let physical: [EstimateRow<PhysicalFigures>; 5] = [
            ("physical foot contact (PFC)", |p| p.pfc),
            ("foot skate, share of contact", |p| p.foot_skate),
            ("mean jerk, m/s^3", |p| p.jerk),
            ("seconds frozen, share", |p| p.freeze_ratio),
            ("nearest other figure of 4 beats, m", |p| p.figure_gap_m),
        ];
        for (name, of) in physical {
            row(name, of(&self.physical), Some(of(&real.physical)));
        }
        row("two seeds on one song, m apart", self.seeds_gap_m, None);
        row("tokens: joint error, mm", self.mpjpe_mm, None);
        row("tokens: share of codes used", self.codes_used, None);
        if let Some(long) = &self.long {
            let LongDance { minutes, speed_kept, slowest_minute, height_drift_m, .. } = long;
            let LongDance { jerk, jerk_kept, foot_skate, furthest_m, awakenings, .. } = long;
            let _ = writeln!(
                text,
                "\n{minutes} minutes in one go: speed of the last minute {speed_kept:.2} of the first, \
                 of the slowest {slowest_minute:.2} of the mean;\nroot {height_drift_m:+.3} m, \
                 jerk {jerk:.0} m/s^3 ({jerk_kept:.2} of the first minute's), foot skate \
                 {foot_skate:.3}, at most {furthest_m:.1} m away, woken {awakenings} times"
            );
        }
        if let Some(figures) = &self.text {
            text.push('\n');
            text.push_str(&figures.table());
        }
        text
    }
}
