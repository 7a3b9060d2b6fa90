//! What another number format costs, on held-out motion.

use std::fmt;
use std::path::Path;

use super::info::read;
use crate::dataset::clip_entry::Split;
use crate::dataset::styles::STYLES;
use crate::dataset::training_file::{self, TrainingClip};
use anyhow::bail;
use serde::Serialize;
use servodance_model::motion::{Clip, decode, mpjpe_m};
use servodance_model::weights::{Dtype, Keep, convert};
use servodance_model::{Codec, Generator};
use servodance_types::{FRAME_RATE_HZ, MusicFrame};

/// Clips shorter than this are left out, seconds.
const SHORTEST_S: f64 = 5.0;

/// What one number format makes of held-out motion.
#[derive(Clone, Debug, Serialize)]
pub struct FormatComparison {
    dtype: &'static str,
    bytes: usize,
    clips: usize,
    /// The VQ-VAE: mean joint error of motion through codes and back, millimetres.
    mpjpe_mm: f64,
    /// Share of the codes that are those of f32.
    codes_kept: f64,
    frames: usize,
    /// MotionSeq: negative log likelihood of a frame, nats.
    nll: f64,
    /// Share of the likeliest codes that are those of f32.
    likeliest_kept: f64,
}

impl fmt::Display for FormatComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { dtype, clips, mpjpe_mm, frames, nll, .. } = self;
        let megabytes = self.bytes as f64 / 1e6;
        let [codes, likeliest] = [self.codes_kept, self.likeliest_kept].map(|share| 100.0 * share);
        write!(
            f,
            "{dtype:4}  {megabytes:5.1} MB  stage 1: {mpjpe_mm:.2} mm ({clips} clips), {codes:.2} % of codes \
             as in f32  stage 2: {nll:.4} nats a frame ({frames} frames), {likeliest:.2} % of likeliest codes as in f32"
        )
    }
}

/// A held-out clip, and what f32 makes of it.
struct HeldOutMotion {
    original: Clip,
    music: Option<Vec<MusicFrame>>,
    style: Option<usize>,
    codes: Vec<Vec<usize>>,
    likeliest: Vec<Vec<usize>>,
}

/// Scores every format of a weights file on the test clips of a training file. Fails on a file
/// that cannot be used; too little held-out dance.
pub fn compare(file: &Path, data: &Path, most: usize) -> anyhow::Result<Vec<FormatComparison>> {
    let (bytes, name) = read(Some(file))?;
    let mut held = held_out(data, most)?;
    let mut rows = Vec::new();
    for dtype in Dtype::ALL {
        let converted = convert(&bytes, &name, dtype, Keep::Everything)?;
        rows.push(score(&converted, dtype, &mut held)?);
    }
    Ok(rows)
}

fn held_out(data: &Path, most: usize) -> anyhow::Result<Vec<HeldOutMotion>> {
    let mut clips = training_file::read(data)?;
    let shortest = (SHORTEST_S * FRAME_RATE_HZ) as usize;
    clips.retain(|c| c.split == Split::Test && c.variant == 0 && c.motion.len() >= shortest);
    let (dance, other): (Vec<_>, Vec<_>) = clips.into_iter().partition(|c| c.dance);
    let held: Vec<HeldOutMotion> = [dance, other]
        .into_iter()
        .flat_map(|kind| kind.into_iter().take(most).map(HeldOutMotion::of))
        .collect();
    if held.iter().filter(|clip| clip.music.is_some()).count() < 2 {
        bail!("{}: fewer than 2 held-out clips of dance with music", data.display());
    }
    Ok(held)
}

impl HeldOutMotion {
    fn of(clip: TrainingClip) -> Self {
        let frame = |(i, v)| MusicFrame::from_vector(v, i as f64 / FRAME_RATE_HZ);
        let music = clip.music.as_ref().filter(|_| clip.dance);
        Self {
            original: Clip {
                name: clip.name.clone(),
                fps: FRAME_RATE_HZ,
                poses: decode(&clip.motion),
            }
            .normalised(),
            music: music.map(|rows| rows.iter().enumerate().map(frame).collect()),
            style: Some(clip.style).filter(|style| *style < STYLES.len()),
            codes: Vec::new(),
            likeliest: Vec::new(),
        }
    }
}

fn score(
    bytes: &[u8],
    dtype: Dtype,
    held: &mut [HeldOutMotion],
) -> anyhow::Result<FormatComparison> {
    let codec = Codec::from_bytes(bytes, dtype.name())?;
    let generator = Generator::from_bytes(bytes, dtype.name())?;
    let (mut mpjpe_mm, mut nll) = (0.0, 0.0);
    let (mut kept, mut same, mut frames) =
        (AgreementCount::default(), AgreementCount::default(), 0);
    for clip in held.iter_mut() {
        let codes = codec.encode(&clip.original)?;
        let back = codec.decode("", &codes)?;
        mpjpe_mm += 1e3 * mpjpe_m(&clip.original.poses[..codes.len()], &back.poses).unwrap_or(0.0);
        if dtype == Dtype::F32 {
            clip.codes.clone_from(&codes);
        }
        kept.count(&clip.codes, &codes);
        if let Some(music) = &clip.music {
            let found = generator.likelihood(&clip.codes, music, clip.style)?;
            frames += found.likeliest.len();
            nll += found.nll * found.likeliest.len() as f64;
            if dtype == Dtype::F32 {
                clip.likeliest.clone_from(&found.likeliest);
            }
            same.count(&clip.likeliest, &found.likeliest);
        }
    }
    Ok(FormatComparison {
        dtype: dtype.name(),
        bytes: bytes.len(),
        clips: held.len(),
        mpjpe_mm: mpjpe_mm / held.len() as f64,
        codes_kept: kept.share(),
        frames,
        nll: nll / frames.max(1) as f64,
        likeliest_kept: same.share(),
    })
}

#[derive(Default)]
struct AgreementCount {
    same: usize,
    all: usize,
}

impl AgreementCount {
    fn count(&mut self, before: &[Vec<usize>], now: &[Vec<usize>]) {
        for (before, now) in before.iter().flatten().zip(now.iter().flatten()) {
            self.all += 1;
            self.same += usize::from(before == now);
        }
    }

    fn share(&self) -> f64 {
        self.same as f64 / self.all.max(1) as f64
    }
}
