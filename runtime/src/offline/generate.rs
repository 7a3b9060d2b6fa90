//! Motion by itself: music in, a file of 22 joints out, no robot.
//!
//! The same analyzer and generator as in a dance, so what a researcher scores
//! is what a robot dances. Also stage 1 alone: motion through the codes and back.

use crate::pipeline::audio_input::Audio;
use crate::pipeline::conditioning::Conditioning;
use crate::pipeline::feature_extractor::Ears;
use crate::process::progress::Progress;
use crate::session::config::AudioChoice;
use crate::session::config::Speed;
use crate::session::dance::open_generator;
use crate::telemetry::pending_file::{PendingFile, write_whole};
use anyhow::{Context, bail};
use servodance_audio::MusicAnalyzer;
use servodance_model::conditioning::{Encodec, HeardFrame};
use servodance_model::engine::EngineOptions;
use servodance_model::motion::mpjpe_m;
use servodance_model::motion::{Clip, bvh_write};
use servodance_model::{Codec, GeneratorOptions, ModelError};
use servodance_types::{FRAME_RATE_HZ, MusicFrame};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// Longest look into the future, seconds.
pub const LOOKAHEAD_MAX_S: f64 = 5.0;
/// Longest motion, seconds: a day.
const SECONDS_MAX: f64 = 86_400.0;

/// What motion is to be made.
#[derive(Clone, Debug)]
pub struct Request {
    /// The music.
    pub audio: AudioChoice,
    /// How much motion, seconds; all of the music if left out. Music that is
    /// over sooner is played again from its start.
    pub seconds: Option<f64>,
    /// Seed of the generator.
    pub seed: u64,
    /// Style, if not the default one.
    pub style: Option<String>,
    /// How codes are drawn; its seed and style are not looked at.
    pub sampling: GeneratorOptions,
    /// How the model's steps are computed.
    pub engine: EngineOptions,
    /// A motion to go on from.
    pub start: Option<PathBuf>,
    /// How far the beat is known ahead of the motion, seconds; 0 as when live.
    pub lookahead_s: f64,
    /// Weights, if not the built-in ones.
    pub model: Option<PathBuf>,
    /// What those weights may need beside them, and a style in words.
    pub conditioning: Conditioning,
    /// No progress bar.
    pub quiet: bool,
}

/// How a motion file is written; told by its ending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionFormat {
    /// `positions` [T, 22, 3] and `fps`, for programs.
    Npz,
    /// Joint angles, for animation programs.
    Bvh,
}

impl MotionFormat {
    /// The format that a file's name asks for.
    pub fn of(path: &Path) -> anyhow::Result<Self> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("npz") => Ok(Self::Npz),
            Some("bvh") => Ok(Self::Bvh),
            _ => bail!(
                "{}: a motion file ends in .npz (positions) or .bvh (joint angles)",
                path.display()
            ),
        }
    }
}

/// Writes the clip, whole or not at all.
pub fn write_motion(path: &Path, clip: &Clip) -> anyhow::Result<()> {
    match MotionFormat::of(path)? {
        MotionFormat::Npz => {
            let pending = PendingFile::create(path)?;
            clip.write_npz(pending.path())?;
            pending.finish()
        }
        MotionFormat::Bvh => write_whole(path, bvh_write::bvh(clip).as_bytes()),
    }
}

/// Makes the motion.
///
/// # Errors
/// What was asked for that cannot be used, before any work is done.
pub fn generate(request: &Request) -> anyhow::Result<Clip> {
    if let Some(seconds) = request.seconds
        && !(0.05..=SECONDS_MAX).contains(&seconds)
    {
        bail!("--seconds {seconds} is outside 0.05..{SECONDS_MAX}");
    }
    if !(0.0..=LOOKAHEAD_MAX_S).contains(&request.lookahead_s) {
        let lookahead_s = request.lookahead_s;
        bail!("--lookahead {lookahead_s} is outside 0..{LOOKAHEAD_MAX_S}");
    }
    let generator = open_generator(request.model.as_deref(), request.engine)?;
    let encodec = request.conditioning.encodec(&generator)?;
    let mut dance = generator.start(GeneratorOptions {
        seed: request.seed,
        style: request.style.clone(),
        style_vector: request.conditioning.style_vector(&generator)?,
        ..request.sampling.clone()
    })?;
    if let Some(start) = &request.start {
        let past = Clip::read_npz(start)?;
        let codes = open_codec(request.model.as_deref())?.encode_all(&past)?;
        match past.poses.last() {
            Some(last) if !codes.is_empty() => dance.follow(&codes, last)?,
            _ => bail!("{}: one frame is no motion to go on from", start.display()),
        }
    }
    let mut music = Music::open(request, encodec.as_ref())?;
    let progress = Progress::new(request.seconds.or(music.audio.duration_s()), request.quiet);
    let mut poses = Vec::new();
    while let Some(heard) = music.next()? {
        match dance.step_heard(&heard) {
            Ok(motion) => poses.push(motion.positions),
            Err(ModelError::Ended { .. }) if !poses.is_empty() => break,
            Err(error) => return Err(error.into()),
        }
        progress.at(poses.len() as f64 / FRAME_RATE_HZ);
    }
    progress.done();
    Ok(Clip {
        name: "generated".into(),
        fps: FRAME_RATE_HZ,
        poses,
    })
}

/// A motion, and what stage 1 makes of it.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The original at 20 FPS on the common skeleton, without its last frame.
    pub original: Clip,
    /// The same through the codes.
    pub reconstructed: Clip,
    /// Mean per-joint position error, metres.
    pub mpjpe_m: f64,
}

/// Sends a motion file through the codes and back.
pub fn reconstruct(motion: &Path, model: Option<&Path>) -> anyhow::Result<Reconstruction> {
    let mut original = Clip::read_npz(motion)?.normalised();
    let codec = open_codec(model)?;
    let codes = codec.encode(&original)?;
    let reconstructed = codec.decode("reconstructed", &codes)?;
    original.poses.truncate(codes.len());
    let mpjpe_m = mpjpe_m(&original.poses, &reconstructed.poses)
        .with_context(|| format!("{}: one frame is no motion", motion.display()))?;
    Ok(Reconstruction {
        original,
        reconstructed,
        mpjpe_m,
    })
}

/// Stage 1 of the weights in a file, or of those that are built in.
pub fn open_codec(model: Option<&Path>) -> anyhow::Result<Codec> {
    Ok(match model {
        Some(path) => Codec::load(path)?,
        None => Codec::built_in()?,
    })
}

/// Music frames, as many as asked for, with the beat known some frames ahead.
struct Music {
    choice: AudioChoice,
    audio: Audio,
    ears: Ears,
    block: Vec<f32>,
    /// Frames still to give; `None` is until the music is over.
    left: Option<usize>,
    waiting: VecDeque<HeardFrame>,
    lookahead: usize,
    ended: bool,
}

impl Music {
    fn open(request: &Request, encodec: Option<&Encodec>) -> anyhow::Result<Self> {
        let audio = Audio::open(&request.audio, Speed::Max)?;
        let rate_hz = audio.sample_rate_hz();
        let analyzer = MusicAnalyzer::new(rate_hz)?;
        let frames = |seconds: f64| (seconds * FRAME_RATE_HZ).round() as usize;
        Ok(Self {
            choice: request.audio.clone(),
            ears: Ears::new(analyzer, rate_hz, encodec)?,
            audio,
            block: Vec::new(),
            left: request.seconds.map(frames),
            waiting: VecDeque::new(),
            lookahead: frames(request.lookahead_s),
            ended: false,
        })
    }

    fn next(&mut self) -> anyhow::Result<Option<HeardFrame>> {
        if self.left == Some(0) {
            return Ok(None);
        }
        while self.waiting.len() <= self.lookahead && !self.ended {
            match self.ears.pop() {
                Some(heard) => self.waiting.push_back(heard),
                None => self.listen()?,
            }
        }
        let ahead = self.waiting.back().copied();
        let Some(mut heard) = self.waiting.pop_front() else {
            return Ok(None);
        };
        let frame = &mut heard.frame;
        if let Some(ahead) = ahead {
            frame.beat = rolled_back(&ahead.frame, frame.time_s).unwrap_or(frame.beat);
        }
        self.left = self.left.map(|left| left - 1);
        Ok(Some(heard))
    }

    fn listen(&mut self) -> anyhow::Result<()> {
        if self.audio.next_block(&mut self.block)? {
            self.ears.push(&self.block)?;
        } else if self.left.is_some() {
            self.audio = Audio::open(&self.choice, Speed::Max)?;
        } else {
            self.ended = true;
        }
        Ok(())
    }
}

/// The beat at `time_s` as known at the later frame `ahead`; `None` while no
/// tempo is known.
fn rolled_back(ahead: &MusicFrame, time_s: f64) -> Option<servodance_types::Beat> {
    let mut beat = ahead.beat;
    let beats = (ahead.time_s - time_s) * f64::from(beat.tempo_bpm) / 60.0;
    beat.phase = (f64::from(beat.phase) - beats).rem_euclid(1.0) as f32;
    (beat.tempo_bpm > 0.0).then_some(beat)
}
