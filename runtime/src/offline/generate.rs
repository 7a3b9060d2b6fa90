//! Music in, a file of 22 joints out, no robot: the same features and generator
//! as in a dance. Also the VQ-VAE alone: motion through the codes and back.

use crate::physics::TrialDance;
use crate::pipeline::audio_input::{AudioChoice, AudioInput};
use crate::pipeline::conditioning::Conditioning;
use crate::pipeline::feature_extractor::FeatureExtractor;
use crate::pipeline::model_args::{EngineArgs, SamplingArgs};
use crate::process::number_range::within;
use crate::process::progress::Progress;
use crate::process::speed::Speed;
use crate::process::wrong_usage::misused;
use crate::session::dance::open_generator;
use crate::telemetry::pending_file::{PendingFile, write_whole};
use anyhow::{Context, bail};
use servodance_audio::MusicAnalyzer;
use servodance_audio::playback::Sound;
use servodance_audio::song::SongSpec;
use servodance_model::conditioning::{Encodec, HeardFrame};
use servodance_model::motion::{Clip, Pose, bvh_write, mpjpe_m};
use servodance_model::{AtEnd, Codec, Dance, GeneratorOptions, ModelError};
use servodance_types::{FRAME_RATE_HZ, MusicFrame};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// Longest look into the future, seconds.
const LOOKAHEAD_MAX_S: f64 = 5.0;
/// Longest motion, seconds: a day.
const SECONDS_MAX: f64 = 86_400.0;

const TRIAL_S: f64 = 20.0;
/// Of the first six, the three whose arms swing hardest.
const TRIAL_SEEDS: [u64; 3] = [1, 2, 5];
/// Seeds of the songs, of other styles and tempos, that a robot is tried with besides, and the
/// style that swings hardest.
const TRIAL_SONGS: [u64; 3] = [1, 2, 3];
const WILD_STYLE: &str = "hype";

/// The motion that is wanted.
#[derive(Clone, Debug, clap::Args)]
pub struct GenerateRequest {
    /// The recording (wav, flac, mp3, ogg); the built-in song if left out.
    #[arg(value_name = "AUDIO")]
    pub audio: Option<PathBuf>,
    /// The file to write: .npz (positions) or .bvh (joint angles).
    #[arg(long, value_name = "FILE.npz|FILE.bvh")]
    pub out: PathBuf,
    /// How much motion; a recording that is shorter is played again.
    #[arg(long, value_name = "SECONDS", value_parser = within(0.05..=SECONDS_MAX))]
    pub seconds: Option<f64>,
    /// The same seed and the same input give the same dance.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Dance style; an unknown one lists those that the model knows.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,
    /// A motion (.npz) that the dance goes on from.
    #[arg(long, value_name = "MOTION.npz")]
    pub start: Option<PathBuf>,
    /// How many seconds of music after a frame help to find the beat in it; 0
    /// is what a live robot hears.
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    #[arg(value_parser = within(0.0..=LOOKAHEAD_MAX_S))]
    pub lookahead: f64,
    /// Weights to use in place of the built-in ones.
    #[arg(long, value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,
    /// What weights may need beside them, and a style in words.
    #[command(flatten)]
    pub conditioning: Conditioning,
    /// How codes are drawn.
    #[command(flatten)]
    pub sampling: SamplingArgs,
    /// Stop where a model that knows an end says so; else a new sequence
    /// goes on from there.
    #[arg(long)]
    pub until_end: bool,
    /// How the model's steps are computed.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Print only errors
    #[arg(long, short)]
    pub quiet: bool,
}

impl GenerateRequest {
    /// A dance of the built-in model to a recording, or to the built-in song, that goes
    /// to no file.
    pub fn plain(audio: Option<PathBuf>, seconds: f64, seed: u64, style: Option<String>) -> Self {
        Self {
            audio,
            out: PathBuf::new(),
            seconds: Some(seconds),
            seed,
            style,
            start: None,
            lookahead: 0.0,
            model: None,
            conditioning: Conditioning::default(),
            sampling: SamplingArgs::default(),
            until_end: false,
            engine: EngineArgs::default(),
            quiet: true,
        }
    }
}

/// Format of a motion file, by the ending of its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionFormat {
    /// `positions` [T, 22, 3] and `fps`, for programs.
    Npz,
    /// Joint angles, for animation programs.
    Bvh,
}

impl MotionFormat {
    /// The format for this file name; refuses other endings.
    pub fn of(path: &Path) -> anyhow::Result<Self> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("npz") => Ok(Self::Npz),
            Some("bvh") => Ok(Self::Bvh),
            _ => misused!(
                "{}: a motion file ends in .npz (positions) or .bvh (joint angles)",
                path.display()
            ),
        }
    }
}

/// Writes the whole clip, or no file.
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

/// Generates the motion; refuses bad requests before any work is done.
pub fn generate(request: &GenerateRequest) -> anyhow::Result<Clip> {
    let choice = request.audio.clone().map_or(AudioChoice::BuiltIn, AudioChoice::File);
    generate_to(&choice, request)
}

fn generate_to(choice: &AudioChoice, request: &GenerateRequest) -> anyhow::Result<Clip> {
    let lookahead_s = request.lookahead;
    let generator = open_generator(request.model.as_deref(), request.engine)?;
    let encodec = request.conditioning.encodec(&generator)?;
    let mut dance = generator.start(GeneratorOptions {
        seed: request.seed,
        style: request.style.clone(),
        style_vector: request.conditioning.style_vector(&generator)?,
        at_end: if request.until_end { AtEnd::Stop } else { AtEnd::Chain },
        ..request.sampling.options()
    })?;
    if let Some(start) = &request.start {
        let past = Clip::read_npz(start)?;
        let codes = open_codec(request.model.as_deref())?.encode_all(&past)?;
        match past.poses.last() {
            Some(last) if !codes.is_empty() => dance.follow(&codes, last)?,
            _ => bail!("{}: one frame is no motion to go on from", start.display()),
        }
    }
    let mut audio = AudioInput::open(choice, Speed::Max)?;
    let features = extractor(audio.sample_rate_hz(), encodec.as_ref())?;
    let progress = Progress::new(request.seconds.or(audio.duration_s()), request.quiet);
    let repeats = request.seconds.is_some();
    let blocks = |block: &mut Vec<f32>| {
        let heard = audio.next_block(block)?;
        if !heard && repeats {
            audio = AudioInput::open(choice, Speed::Max)?;
            return audio.next_block(block);
        }
        Ok(heard)
    };
    let mut music = MusicFeed::new(features, blocks, lookahead_s);
    music.left = request.seconds.map(frames);
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
    Ok(Clip { name: "generated".into(), fps: FRAME_RATE_HZ, poses })
}

/// Dances of 20 s each to try a robot with in the simulated world: three of the default style to
/// the built-in song, and a wild one, `hype`, to each of three others.
pub fn trial_dances() -> anyhow::Result<Vec<TrialDance>> {
    let usual = dances_of_built_in_song()?.into_iter();
    let mut dances: Vec<_> = usual.map(|clip| TrialDance { clip, wild: false }).collect();
    for seed in TRIAL_SONGS {
        let song = SongSpec::random(TRIAL_S, seed)?.render()?;
        let samples = song.samples.into_iter().map(Sound::level).collect();
        let sound = Sound { samples, rate_hz: song.sample_rate_hz };
        let request = GenerateRequest::plain(None, TRIAL_S, seed, Some(WILD_STYLE.into()));
        let clip = generate_to(&AudioChoice::Recorded(sound), &request)?;
        dances.push(TrialDance { clip, wild: true });
    }
    Ok(dances)
}

/// Three dances of the default style to the built-in song, 20 s each.
pub fn dances_of_built_in_song() -> anyhow::Result<Vec<Clip>> {
    let dance = |seed| generate(&GenerateRequest::plain(None, TRIAL_S, seed, None));
    TRIAL_SEEDS.into_iter().map(dance).collect()
}

/// A motion, and what the VQ-VAE makes of it.
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
    Ok(Reconstruction { original, reconstructed, mpjpe_m })
}

/// The VQ-VAE of the weights in a file, or of those that are built in.
pub fn open_codec(model: Option<&Path>) -> anyhow::Result<Codec> {
    Ok(match model {
        Some(path) => Codec::load(path)?,
        None => Codec::built_in()?,
    })
}

/// The motion to all of `samples`, mono; `lookahead_s` as in [`GenerateRequest`].
pub fn poses_of_samples(
    dance: &mut Dance,
    samples: &[f32],
    sample_rate_hz: u32,
    lookahead_s: f64,
) -> anyhow::Result<Vec<Pose>> {
    let mut waiting = Some(samples);
    let blocks = |block: &mut Vec<f32>| {
        block.clear();
        block.extend_from_slice(waiting.unwrap_or_default());
        Ok(waiting.take().is_some())
    };
    let mut music = MusicFeed::new(extractor(sample_rate_hz, None)?, blocks, lookahead_s);
    let mut poses = Vec::new();
    while let Some(heard) = music.next()? {
        poses.push(dance.step_heard(&heard)?.positions);
    }
    Ok(poses)
}

fn extractor(sample_rate_hz: u32, encodec: Option<&Encodec>) -> anyhow::Result<FeatureExtractor> {
    FeatureExtractor::new(MusicAnalyzer::new(sample_rate_hz)?, sample_rate_hz, encodec)
}

fn frames(seconds: f64) -> usize {
    (seconds * FRAME_RATE_HZ).round() as usize
}

/// Music frames, as many as asked for, with the beat known some frames ahead; `blocks`
/// writes the next samples and says whether there were any.
struct MusicFeed<B> {
    blocks: B,
    features: FeatureExtractor,
    block: Vec<f32>,
    /// Frames still to give; `None` is until the music is over.
    left: Option<usize>,
    waiting: VecDeque<HeardFrame>,
    lookahead: usize,
    ended: bool,
}

impl<B: FnMut(&mut Vec<f32>) -> anyhow::Result<bool>> MusicFeed<B> {
    fn new(features: FeatureExtractor, blocks: B, lookahead_s: f64) -> Self {
        Self {
            blocks,
            features,
            block: Vec::new(),
            left: None,
            waiting: VecDeque::new(),
            lookahead: frames(lookahead_s),
            ended: false,
        }
    }

    fn next(&mut self) -> anyhow::Result<Option<HeardFrame>> {
        if self.left == Some(0) {
            return Ok(None);
        }
        while self.waiting.len() <= self.lookahead && !self.ended {
            match self.features.pop() {
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
        match (self.blocks)(&mut self.block)? {
            true => self.features.push(&self.block)?,
            false => self.ended = true,
        }
        Ok(())
    }
}

/// The beat at `time_s` by what the later frame `ahead` knows, if it has a tempo.
fn rolled_back(ahead: &MusicFrame, time_s: f64) -> Option<servodance_types::Beat> {
    let mut beat = ahead.beat;
    let beats = (ahead.time_s - time_s) * f64::from(beat.tempo_bpm) / 60.0;
    beat.phase = (f64::from(beat.phase) - beats).rem_euclid(1.0) as f32;
    (beat.tempo_bpm > 0.0).then_some(beat)
}
