//! Weights files: what they hold, and what another number format costs.

use std::fmt;
use std::path::Path;

use crate::motion::corpus::{self, CorpusClip};
use crate::motion::index::{STYLES, Split};
use anyhow::bail;
use serde::Serialize;
use servodance_model::motion::mpjpe_m;
use servodance_model::motion::{Clip, decode};
use servodance_model::weights::{Dtype, Weights, convert};
use servodance_model::{Codec, Generator, ModelError};
use servodance_types::{FRAME_RATE_HZ, MusicFrame};

/// Clips shorter than this are left out, seconds.
const SHORTEST_S: f64 = 5.0;

/// What a weights file holds.
#[derive(Clone, Debug, Serialize)]
pub struct Info {
    /// The file.
    pub file: String,
    /// Its preset.
    pub preset: String,
    /// The narrowest number format of its matrices.
    pub dtype: &'static str,
    /// Bytes of the file.
    pub bytes: usize,
    /// Whether the encoders are in it.
    pub encoders: bool,
    /// Styles that it knows.
    pub styles: Vec<String>,
    /// Where it came from (JSON).
    pub provenance: String,
}

impl Info {
    /// Loads everything, so that whatever is wrong is said.
    pub fn of(file: Option<&Path>, preset: Option<&str>) -> anyhow::Result<Self> {
        let (bytes, name) = read(file)?;
        let weights = Weights::open(&bytes, &name)?;
        if let Some(preset) = preset {
            weights.expect_preset(preset)?;
        }
        let generator = Generator::from_bytes(&bytes, &name)?;
        let encoders = match Codec::from_bytes(&bytes, &name) {
            Ok(_) => true,
            // A file made for dancing alone.
            Err(ModelError::MissingTensor { tensor, .. }) if tensor.starts_with("vq.encoder.") => {
                false
            }
            Err(error) => return Err(error.into()),
        };
        Ok(Self {
            file: name,
            preset: generator.config().preset.clone(),
            dtype: weights.dtype().name(),
            bytes: bytes.len(),
            encoders,
            styles: generator.styles().to_vec(),
            provenance: generator.provenance().to_owned(),
        })
    }
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size_mb = self.bytes as f64 / 1e6;
        let encoders = if self.encoders { "with" } else { "without" };
        writeln!(
            f,
            "{}: preset {}, {}, {size_mb:.1} MB, {encoders} encoders, every tensor sound",
            self.file, self.preset, self.dtype
        )?;
        writeln!(f, "styles: {}", self.styles.join(", "))?;
        write!(f, "provenance: {}", self.provenance)
    }
}

fn read(file: Option<&Path>) -> anyhow::Result<(Vec<u8>, String)> {
    Ok(match file {
        Some(path) => (Weights::read(path)?, path.display().to_string()),
        None => (
            servodance_model::built_in_weights().to_vec(),
            "built-in weights".to_owned(),
        ),
    })
}

/// What one number format makes of held-out motion.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The format of the matrices.
    pub dtype: &'static str,
    /// Bytes of such a file.
    pub bytes: usize,
    /// Clips of motion scored.
    pub clips: usize,
    /// Stage 1: mean joint error of motion through codes and back, millimetres.
    pub mpjpe_mm: f64,
    /// Share of the codes that are those of f32.
    pub codes_kept: f64,
    /// Frames of dance with music scored.
    pub frames: usize,
    /// Stage 2: negative log likelihood of a frame, nats.
    pub nll: f64,
    /// Share of the likeliest codes that are those of f32.
    pub likeliest_kept: f64,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:4}  {:5.1} MB  stage 1: {:.2} mm ({} clips), {:.2} % of codes as in f32  \
             stage 2: {:.4} nats a frame ({} frames), {:.2} % of likeliest codes as in f32",
            self.dtype,
            self.bytes as f64 / 1e6,
            self.mpjpe_mm,
            self.clips,
            100.0 * self.codes_kept,
            self.nll,
            self.frames,
            100.0 * self.likeliest_kept
        )
    }
}

/// A held-out clip, and what f32 makes of it.
struct Held {
    original: Clip,
    music: Option<Vec<MusicFrame>>,
    style: Option<usize>,
    codes: Vec<Vec<usize>>,
    likeliest: Vec<Vec<usize>>,
}

/// Scores every format of a weights file on the test clips of a training file.
///
/// # Errors
/// A file that cannot be used; too little held-out dance.
pub fn compare(file: Option<&Path>, data: &Path, most: usize) -> anyhow::Result<Vec<Comparison>> {
    let (bytes, name) = read(file)?;
    let mut held = held_out(data, most)?;
    let mut rows = Vec::new();
    for dtype in Dtype::ALL {
        let converted = convert(&bytes, &name, dtype)?;
        rows.push(score(&converted, dtype, &mut held)?);
    }
    Ok(rows)
}

fn held_out(data: &Path, most: usize) -> anyhow::Result<Vec<Held>> {
    let mut clips = corpus::read(data)?;
    let shortest = (SHORTEST_S * FRAME_RATE_HZ) as usize;
    clips.retain(|c| c.split == Split::Test && c.variant == 0 && c.motion.len() >= shortest);
    let (dance, other): (Vec<_>, Vec<_>) = clips.into_iter().partition(|c| c.dance);
    let held: Vec<Held> = [dance, other]
        .into_iter()
        .flat_map(|kind| kind.into_iter().take(most).map(Held::of))
        .collect();
    if held.iter().filter(|clip| clip.music.is_some()).count() < 2 {
        bail!(
            "{}: fewer than 2 held-out clips of dance with music",
            data.display()
        );
    }
    Ok(held)
}

impl Held {
    fn of(clip: CorpusClip) -> Self {
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

fn score(bytes: &[u8], dtype: Dtype, held: &mut [Held]) -> anyhow::Result<Comparison> {
    let codec = Codec::from_bytes(bytes, dtype.name())?;
    let generator = Generator::from_bytes(bytes, dtype.name())?;
    let (mut mpjpe_mm, mut nll) = (0.0, 0.0);
    let (mut kept, mut same, mut frames) = (Kept::default(), Kept::default(), 0);
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
    Ok(Comparison {
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

/// How many codes are what they were.
#[derive(Default)]
struct Kept {
    same: usize,
    all: usize,
}

impl Kept {
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
