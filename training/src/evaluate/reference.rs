//! Held-out dance with its music: what the generator is compared with.

use super::request::EvaluationRequest;
use crate::dataset;
use crate::dataset::clip_entry::Split;
use crate::dataset::styles::STYLES;
use crate::dataset::training_file::{self, TrainingClip};
use anyhow::bail;
use servodance_model::conditioning::{ENCODEC_RATE_HZ, Encodec, HeardFrame, Latent, MusicKind};
use servodance_model::motion::{Pose, decode};
use servodance_runtime::pipeline::feature_extractor;
use servodance_types::{Beat, FRAME_RATE_HZ, MusicFrame, SPECTRAL_DIM};

/// A choreography seed that no training file is made with.
const FRESH_SEED: u64 = 770_077;
/// Beats that the tracker is less sure of do not count.
const SURE: f32 = 0.5;

pub struct HeldOutClip {
    pub style: String,
    pub poses: Vec<Pose>,
    pub music: Vec<HeardFrame>,
    /// Where the tracker found beats, seconds.
    pub beats_s: Vec<f64>,
}

pub struct EvaluationReference {
    /// Music to dance to, and what a dancer did to it.
    pub held: Vec<HeldOutClip>,
    /// All held-out dance, whole, with and without music; no copies.
    pub real: Vec<Vec<Pose>>,
}

impl EvaluationReference {
    /// Test clips of the training file, or fresh choreography, with music as features of this kind.
    pub fn open(
        request: &EvaluationRequest,
        kind: MusicKind,
        encodec: Option<&Encodec>,
    ) -> anyhow::Result<Self> {
        let mut clips = match &request.data {
            Some(path) => training_file::read(path)?,
            None => choreography(request, encodec)?,
        };
        let fresh = request.data.is_none();
        clips.retain(|clip| clip.dance && (fresh || clip.split == Split::Test));
        let seconds = request.seconds_of_clips();
        let frames = (seconds * FRAME_RATE_HZ) as usize;
        let held: Vec<HeldOutClip> =
            clips.iter().filter_map(|clip| excerpt(clip, frames)).collect();
        let deaf = |clip: &HeldOutClip| clip.music.iter().any(|heard| heard.latent.is_none());
        if kind == MusicKind::Encodec128 && held.iter().any(deaf) {
            bail!(
                "--data: the weights hear encodec128, the file has no such latents: build it with \
                 `servodance dataset build --music-features encodec128`"
            );
        }
        if held.len() < 2 {
            bail!(
                "the reference has {} held-out clips of dance with music of {seconds} s, at least 2 are needed",
                held.len()
            );
        }
        let originals = clips.iter().filter(|clip| clip.variant == 0);
        let real = originals.map(|clip| decode(&clip.motion)).collect();
        Ok(Self { held, real })
    }
}

fn choreography(
    request: &EvaluationRequest,
    encodec: Option<&Encodec>,
) -> anyhow::Result<Vec<TrainingClip>> {
    let file = tempfile::NamedTempFile::new()?;
    let options = dataset::DatasetOptions {
        motion: None,
        out: file.path().to_owned(),
        songs: 1,
        figures: 0.0,
        tilted: 0.0,
        choreography: request.clips as f64,
        features: dataset::FeatureArgs::default(),
        seed: FRESH_SEED,
        quiet: true,
    };
    dataset::build(&options, encodec, &|_| {})?;
    Ok(training_file::read(file.path())?)
}

/// The middle of a clip, if it is long enough and has a beat.
fn excerpt(clip: &TrainingClip, frames: usize) -> Option<HeldOutClip> {
    let from = clip.motion.len().checked_sub(frames)? / 2;
    let rows = from..from + frames;
    let heard = clip.music.as_ref()?[rows.clone()].iter().enumerate();
    let music: Vec<HeardFrame> = heard
        .map(|(i, vector)| HeardFrame {
            frame: MusicFrame::from_vector(vector, i as f64 / FRAME_RATE_HZ),
            latent: clip.latents.as_ref().map(|latents| latents[rows.start + i]),
        })
        .collect();
    let beats_s = tracked_beats_s(&music);
    (beats_s.len() >= 4).then(|| HeldOutClip {
        style: STYLES[clip.style].to_owned(),
        poses: decode(&clip.motion[rows]),
        music,
        beats_s,
    })
}

/// The moments at which the tracked phase passes zero, seconds.
pub fn tracked_beats_s(music: &[HeardFrame]) -> Vec<f64> {
    let sure = |pair: &&[HeardFrame]| pair.iter().all(|heard| heard.frame.beat.confidence > SURE);
    let passes = music.windows(2).filter(sure).filter_map(|pair| {
        let [a, b] = [0, 1].map(|k| f64::from(pair[k].frame.beat.phase));
        (a > 0.5 && b < 0.5)
            .then(|| pair[0].frame.time_s + (1.0 - a) / (1.0 - a + b).max(1e-6) / FRAME_RATE_HZ)
    });
    passes.collect()
}

pub fn between(beats_s: &[f64]) -> Vec<f64> {
    beats_s.windows(2).map(|b| (b[0] + b[1]) / 2.0).collect()
}

pub struct SilentMusic {
    latents: Option<Vec<Latent>>,
}

impl SilentMusic {
    /// Silence of `frames` frames, as Encodec hears it where one is given.
    pub fn new(encodec: Option<&Encodec>, frames: usize) -> anyhow::Result<Self> {
        let nothing = vec![0.0; frames * (f64::from(ENCODEC_RATE_HZ) / FRAME_RATE_HZ) as usize];
        let heard =
            encodec.map(|encodec| feature_extractor::latents(encodec, &nothing, ENCODEC_RATE_HZ));
        Ok(Self { latents: heard.transpose()? })
    }

    /// The same moments without a sound: the features of digital silence (the
    /// first cepstral coefficient is the level, at its lowest).
    pub fn in_place_of(&self, music: &[HeardFrame]) -> Vec<HeardFrame> {
        let mut spectral = [0.0; SPECTRAL_DIM];
        spectral[1] = -2.0;
        let silent = |(i, heard): (usize, &HeardFrame)| HeardFrame {
            frame: MusicFrame {
                time_s: heard.frame.time_s,
                spectral,
                beat: Beat::default(),
                presence: 0.0,
            },
            latent: self.latents.as_ref().map(|latents| latents[i]),
        };
        music.iter().enumerate().map(silent).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beats_are_where_the_phase_passes_zero() {
        let music: Vec<HeardFrame> = (0..60)
            .map(|i| {
                let time_s = f64::from(i) / FRAME_RATE_HZ;
                MusicFrame {
                    time_s,
                    beat: Beat {
                        phase: ((time_s - 0.23) / 0.5).rem_euclid(1.0) as f32,
                        tempo_bpm: 120.0,
                        confidence: if i < 40 { 1.0 } else { 0.2 },
                        ..Beat::default()
                    },
                    ..MusicFrame::default()
                }
            })
            .map(HeardFrame::from)
            .collect();
        let found = tracked_beats_s(&music);
        assert_eq!(found.len(), 4, "{found:?}");
        for (found, wanted) in found.iter().zip([0.23, 0.73, 1.23, 1.73]) {
            assert!((found - wanted).abs() < 1e-6, "{found}");
        }
        assert!((between(&found)[0] - 0.48).abs() < 1e-6);
    }
}
