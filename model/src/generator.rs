//! Music frames in, motion frames out: the whole model behind one `step`.
//!
//! One motion frame per music frame (20 a second), known only from the music
//! up to that frame. Time and memory a frame are constant for any length of
//! music; the same seed, options and music give the same dance. Music that is
//! not finite is replaced by the last good frame and counted. A step allocates
//! nothing, but takes a millisecond: not for a motor control thread.

use std::path::Path;
use std::sync::Arc;

use servodance_types::{MotionFrame, MusicFrame};

use crate::conditioning::{HeardFrame, MusicKind};
use crate::error::ModelError;
use crate::motion::representation::{POSE_DIM, PoseVector, Recovery, contacts, heading_rad};
use crate::motion::{Pose, skeleton};
use crate::net::{
    DecoderState, Dtype, Echo, Engine, EngineOptions, ModelConfig, MotionSeq, Recent, Sampler,
    Sampling, SeqState, Team, VqDecoder, Weights,
};

/// The trained weights, part of the program so that it runs by itself.
pub(crate) const BUILT_IN: &[u8] = include_bytes!("../weights/live.safetensors");
/// Normalised features are clamped to this many deviations, except the beat.
const MUSIC_CLAMP: f32 = 6.0;
/// Inside this distance from the start the dancer goes where it wants, metres.
const FREE_RADIUS_M: f32 = 1.0;
/// At this distance no step leads further away, metres.
const WALL_RADIUS_M: f32 = 3.0;

/// Below this mean joint speed the dancer stands still, metres a frame.
const STILL_M: f32 = 0.1 / 20.0;
/// Standing still for so long while a beat is heard is a dance that stuck.
const STUCK_FRAMES: u32 = 20;
/// From this confidence on a beat is heard.
const HEARD_CONFIDENCE: f32 = 0.5;

/// What follows when the model says that the sequence ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AtEnd {
    /// The next sequence, from the codes of the last frame: motion goes on.
    #[default]
    Chain,
    /// Nothing: [`Dance::step`] gives [`ModelError::Ended`].
    Stop,
}

/// The style of a dance in no style: what the model learned where none was told.
pub const NO_STYLE: &str = "none";

/// How a dance is generated.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneratorOptions {
    /// Seed of everything random.
    pub seed: u64,
    /// A name out of [`Generator::styles`], or [`NO_STYLE`]; `None` is
    /// [`Generator::default_style`].
    pub style: Option<String>,
    /// A style that is no name but a vector, as wide as the weights' styles
    /// ([`crate::conditioning::ClipText`]); it comes before a name.
    pub style_vector: Option<Vec<f32>>,
    /// 0 (always the likeliest) up to 10; above 1 is wild.
    pub temperature: f32,
    /// Only the k likeliest codes a frame; 0 is all.
    pub top_k: usize,
    /// Only the likeliest codes that hold this share of the probability.
    pub top_p: f32,
    /// How much less likely a code gets by being repeated, 0 (not at all) to 20:
    /// its logit falls by this times its share of the last two seconds.
    pub repetition: f32,
    /// How much less likely it gets to go on as the last time that the dancer
    /// moved like now, 0 (not at all) to 20: so much a logit falls at most.
    pub variety: f32,
    /// Classifier-free guidance on the music: 1 is off, above 1 follows the
    /// music more and takes some more time.
    pub guidance: f32,
    /// For models that know an end.
    pub at_end: AtEnd,
}

impl Default for GeneratorOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            style: None,
            style_vector: None,
            temperature: 0.9,
            top_k: 0,
            top_p: 0.95,
            repetition: 0.0,
            variety: 9.0,
            guidance: 1.5,
            at_end: AtEnd::Chain,
        }
    }
}

/// The trained networks; start as many dances from it as you like.
#[derive(Clone, Debug)]
pub struct Generator {
    pub(crate) networks: Arc<Networks>,
}

#[derive(Debug)]
pub(crate) struct Networks {
    config: ModelConfig,
    default_style: usize,
    provenance: String,
    pub(crate) engine: Engine,
    decoder: VqDecoder,
    pub(crate) seq: MotionSeq,
    motion_mean: Vec<f32>,
    motion_std: Vec<f32>,
    music_mean: Vec<f32>,
    music_std: Vec<f32>,
    /// Codes to begin from, and the style each was seen in.
    start_codes: Vec<Vec<usize>>,
    start_styles: Vec<usize>,
}

impl Generator {
    /// The weights that ship inside this library (`model/MODEL_CARD.md`).
    pub fn built_in() -> Result<Self, ModelError> {
        Self::from_bytes(BUILT_IN, "built-in weights")
    }

    /// The same, computed otherwise than usual.
    pub fn built_in_with(options: EngineOptions) -> Result<Self, ModelError> {
        Self::from_bytes_with(BUILT_IN, "built-in weights", options)
    }

    /// Loads a weights file and checks every tensor of it.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        Self::load_with(path, EngineOptions::default())
    }

    /// The same, computed otherwise than usual.
    pub fn load_with(path: &Path, options: EngineOptions) -> Result<Self, ModelError> {
        let source = path.display().to_string();
        Self::from_bytes_with(&Weights::read(path)?, &source, options)
    }

    /// Loads weights from memory; `source` names them in errors.
    pub fn from_bytes(bytes: &[u8], source: &str) -> Result<Self, ModelError> {
        Self::from_bytes_with(bytes, source, EngineOptions::default())
    }

    /// The same, computed otherwise than usual.
    pub fn from_bytes_with(
        bytes: &[u8],
        source: &str,
        options: EngineOptions,
    ) -> Result<Self, ModelError> {
        let w = Weights::open(bytes, source)?;
        let engine = Engine::new(&w, options)?;
        let config = w.config().clone();
        if config.seq.cross_aligned && config.seq.lookahead > 0 {
            return Err(w.config_error(format!(
                "seq.lookahead is {}, expected 0: live music has no future",
                config.seq.lookahead
            )));
        }
        let rows = |name, columns, limit| w.integer_rows(name, columns, limit);
        let start_codes = rows("start.codes", config.parts.len(), config.codes)?;
        let start_styles = rows("start.styles", 1, config.seq.styles.len().max(1))?.concat();
        if start_codes.is_empty() || start_codes.len() != start_styles.len() {
            return Err(w.config_error(format!(
                "`start.codes` has {} rows and `start.styles` {}, expected the same number, not 0",
                start_codes.len(),
                start_styles.len()
            )));
        }
        let networks = Networks {
            decoder: VqDecoder::load(&w, &engine)?,
            seq: MotionSeq::load(&w, &engine)?,
            engine,
            motion_mean: w.floats("norm.motion_mean", &[POSE_DIM])?,
            motion_std: w.floats("norm.motion_std", &[POSE_DIM])?,
            music_mean: w.floats("norm.music_mean", &[config.music_dim])?,
            music_std: w.floats("norm.music_std", &[config.music_dim])?,
            start_codes,
            start_styles,
            provenance: w.provenance().to_owned(),
            default_style: w.default_style(),
            config,
        };
        let networks = Arc::new(networks);
        Ok(Self { networks })
    }

    /// The sizes of the networks.
    pub fn config(&self) -> &ModelConfig {
        &self.networks.config
    }

    /// The music features that the weights were trained to hear.
    pub fn music_kind(&self) -> MusicKind {
        self.networks.config.music
    }

    /// Number format of the weights in memory, and threads of a step.
    pub fn computed_with(&self) -> (Dtype, usize) {
        let engine = &self.networks.engine;
        (engine.dtype(), engine.pool().threads())
    }

    /// Where the weights came from: data, date, figures (JSON).
    pub fn provenance(&self) -> &str {
        &self.networks.provenance
    }

    /// Names of the styles that a dance can be asked for.
    pub fn styles(&self) -> &[String] {
        &self.networks.config.seq.styles
    }

    /// The style that is danced when none is asked for.
    pub fn default_style(&self) -> &str {
        &self.styles()[self.networks.default_style]
    }

    /// Where a style stands in [`Generator::styles`].
    ///
    /// # Errors
    /// There is none of that name; the message lists those there are.
    pub fn style_index(&self, name: &str) -> Result<usize, ModelError> {
        self.networks.style_index(name)
    }

    /// A new dance. Refuses options out of range and unknown styles.
    pub fn start(&self, options: GeneratorOptions) -> Result<Dance, ModelError> {
        let n = &self.networks;
        let style = match &options.style {
            Some(name) => n.style_index(name)?,
            None => n.default_style,
        };
        let style_dim = n.config.seq.style_dim;
        if let Some(vector) = &options.style_vector
            && (vector.len() != style_dim || vector.iter().any(|v| !v.is_finite()))
        {
            return Err(ModelError::StyleWidth {
                found: vector.len(),
                expected: style_dim,
            });
        }
        let vector = options.style_vector.clone();
        if !(0.0..=10.0).contains(&options.guidance) {
            return Err(ModelError::Option {
                option: "guidance",
                found: options.guidance.to_string(),
                expected: "0 to 10",
            });
        }
        if !(0.0..=20.0).contains(&options.variety) {
            return Err(ModelError::Option {
                option: "variety",
                found: options.variety.to_string(),
                expected: "0 to 20",
            });
        }
        let sampling = Sampling {
            temperature: options.temperature,
            top_k: options.top_k,
            top_p: options.top_p,
            repetition: options.repetition,
        };
        let mut sampler = Sampler::new(sampling, options.seed)?;
        let codes = n.starting_codes(style, &mut sampler);
        let lanes = if options.guidance == 1.0 { 1 } else { 2 };
        let mut dance = Dance {
            seq: n.seq.start(lanes),
            decoder: n.decoder.start(),
            networks: self.networks.clone(),
            sampler,
            recent: Recent::new(codes.len(), n.config.codes),
            echo: Echo::new(codes.len(), n.config.codes),
            logits: Vec::with_capacity(n.config.codes + 1),
            codes,
            music: vec![0.0; n.config.music_dim],
            features: Vec::with_capacity(n.config.music_dim),
            bad_music_frames: 0,
            frames: 0,
            sequence_frames: 0,
            recovery: Recovery::default(),
            stage: Stage::default(),
            style,
            style_vector: vector,
            watch: Watch::default(),
            options,
        };
        dance.wear();
        Ok(dance)
    }
}

impl Networks {
    fn style_index(&self, name: &str) -> Result<usize, ModelError> {
        let styles = &self.config.seq.styles;
        if name == NO_STYLE && !styles.iter().any(|style| style == name) {
            return Ok(styles.len()); // the null style's row is behind the others
        }
        let found = styles.iter().position(|style| style == name);
        found.ok_or_else(|| ModelError::UnknownStyle {
            found: name.to_owned(),
            known: styles.iter().cloned().chain([NO_STYLE.into()]).collect(),
        })
    }

    /// One of the stored beginnings, of this style if there is one.
    fn starting_codes(&self, style: usize, sampler: &mut Sampler) -> Vec<usize> {
        let all: Vec<usize> = (0..self.start_codes.len()).collect();
        let of_style = all
            .iter()
            .copied()
            .filter(|&i| self.start_styles[i] == style);
        let of_style: Vec<usize> = of_style.collect();
        let pool = if of_style.is_empty() { all } else { of_style };
        self.start_codes[pool[sampler.below(pool.len())]].clone()
    }

    /// The numbers as the network was trained on them, in `music`; false, and
    /// nothing is changed, if one of them is not finite.
    pub(crate) fn normalise_music(&self, features: &[f32], music: &mut [f32]) -> bool {
        if features.iter().any(|v| !v.is_finite()) {
            return false;
        }
        let measured = self.config.music.measured();
        for (i, value) in features.iter().enumerate() {
            music[i] = (value - self.music_mean[i]) / self.music_std[i];
            if i < measured {
                music[i] = music[i].clamp(-MUSIC_CLAMP, MUSIC_CLAMP);
            }
        }
        true
    }

    /// Decoder output in metres and radians.
    fn pose_vector(&self, normalised: &[f32]) -> PoseVector {
        std::array::from_fn(|i| normalised[i] * self.motion_std[i] + self.motion_mean[i])
    }
}

/// One dance in progress.
#[derive(Debug)]
pub struct Dance {
    networks: Arc<Networks>,
    /// With guidance a second lane dances the same without music.
    seq: SeqState,
    decoder: DecoderState,
    options: GeneratorOptions,
    sampler: Sampler,
    recent: Recent,
    echo: Echo,
    logits: Vec<f32>,
    codes: Vec<usize>,
    /// The last good music, normalised, and the newest as it came.
    music: Vec<f32>,
    features: Vec<f32>,
    bad_music_frames: u64,
    frames: u64,
    /// Frames of the sequence that the model sees.
    sequence_frames: u64,
    recovery: Recovery,
    stage: Stage,
    style: usize,
    /// The style, if it has no name.
    style_vector: Option<Vec<f32>>,
    watch: Watch,
}

impl Dance {
    /// The motion of the next frame. After an error the dance stands where it
    /// stood; start a new one.
    ///
    /// # Errors
    /// Weights that hear Encodec latents: they need [`Dance::step_heard`].
    pub fn step(&mut self, music: &MusicFrame) -> Result<MotionFrame, ModelError> {
        self.step_heard(&HeardFrame::from(*music))
    }

    /// The same with what else was listened for.
    ///
    /// # Errors
    /// Weights of another feature kind than what was listened for.
    pub fn step_heard(&mut self, heard: &HeardFrame) -> Result<MotionFrame, ModelError> {
        let networks = self.networks.clone();
        let (kind, music) = (networks.config.music, &heard.frame);
        if !heard.features(kind, &mut self.features) {
            return Err(ModelError::MusicKind {
                wanted: kind.name(),
                fed: MusicKind::default().name(),
            });
        }
        if !networks.normalise_music(&self.features, &mut self.music) {
            self.bad_music_frames += 1;
        }
        let team = networks.engine.pool().team();
        self.next_codes(&networks.seq, &team)?;
        let normalised = networks.decoder.step(&team, &mut self.decoder, &self.codes);
        let vector = networks.pose_vector(normalised);
        drop(team);
        if vector.iter().any(|v| !v.is_finite()) {
            return Err(ModelError::Diverged { frame: self.frames });
        }
        self.frames += 1;
        let pose = skeleton::fit(&self.recovery.push(&vector), 1.0);
        let positions = self.stage.place(pose);
        if self.watch.stuck(&positions, music.beat.confidence) {
            self.wake();
        }
        Ok(MotionFrame {
            time_s: music.time_s,
            positions,
            contacts: contacts(&vector),
        })
    }

    /// Lives through the codes of a motion ([`crate::Codec::encode_all`]) that
    /// ended in the pose `last`, without hearing music: the next step goes on
    /// from there. Call it before the first step.
    pub fn follow(&mut self, codes: &[Vec<usize>], last: &Pose) -> Result<(), ModelError> {
        let networks = self.networks.clone();
        let team = networks.engine.pool().team();
        let silence = &[None, None][..self.seq.lanes()];
        for row in codes {
            let seq = &networks.seq;
            seq.step(&team, &mut self.seq, &self.codes, silence);
            let normalised = networks.decoder.step(&team, &mut self.decoder, row);
            self.recovery.push(&networks.pose_vector(normalised));
            self.codes.clone_from(row);
        }
        drop(team);
        self.sequence_frames += codes.len() as u64;
        let [x, _, z] = last[0];
        let root_xz_m = [f64::from(x), f64::from(z)];
        self.recovery.move_to(root_xz_m, heading_rad(last));
        self.stage = Stage {
            recovered: [x, z],
            shown: [x, z],
        };
        Ok(())
    }

    /// Dances on in another style, from the pose that it is in.
    ///
    /// # Errors
    /// An unknown style; the message lists those there are.
    pub fn restyle(&mut self, style: &str) -> Result<(), ModelError> {
        self.style = self.networks.style_index(style)?;
        self.style_vector = None;
        self.wear();
        self.chain();
        Ok(())
    }

    /// Takes on its style.
    fn wear(&mut self) {
        let seq = &self.networks.seq;
        match &self.style_vector {
            Some(vector) => seq.restyle(&mut self.seq, vector),
            None => seq.restyle(&mut self.seq, &seq.style(Some(self.style))),
        }
    }

    /// Begins a new sequence from the codes of the last frame: the model forgets
    /// what was danced, not the pose, and motion goes on without a seam.
    pub fn chain(&mut self) {
        self.seq.restart();
        self.sequence_frames = 0;
    }

    /// Back to before the first frame, with another seed.
    pub fn reset(&mut self, seed: u64) {
        self.sampler.reseed(seed);
        self.codes = self.networks.starting_codes(self.style, &mut self.sampler);
        self.chain();
        self.decoder.restart();
        self.recent.clear();
        self.echo.clear();
        self.music.fill(0.0);
        (self.bad_music_frames, self.frames) = (0, 0);
        (self.recovery, self.stage) = (Recovery::default(), Stage::default());
        self.watch = Watch::default();
    }

    /// Leaves guidance out from the next step on, which then takes less time, or
    /// takes it up again from the pose that the dancer is in.
    pub fn guide(&mut self, guided: bool) {
        let seq = &self.networks.seq;
        if !guided && self.seq.lanes() > 1 {
            self.seq = seq.first_lane(&self.seq);
        } else if guided && self.seq.lanes() == 1 && self.options.guidance != 1.0 {
            // Both lanes remember the same past: none.
            self.seq = seq.start(2);
            self.wear();
            self.chain();
        }
    }

    /// How often a step goes through the network: twice if it is guided.
    pub fn passes(&self) -> u32 {
        self.seq.lanes() as u32
    }

    /// A new dance of the same networks and options in another style; it takes
    /// as long again for each step.
    ///
    /// # Errors
    /// There is no such style.
    pub fn beside(&self, style: &str) -> Result<Dance, ModelError> {
        let generator = Generator {
            networks: self.networks.clone(),
        };
        generator.start(GeneratorOptions {
            style: Some(style.to_owned()),
            style_vector: None,
            ..self.options.clone()
        })
    }

    /// Names of the styles, as [`Generator::styles`].
    pub fn styles(&self) -> &[String] {
        &self.networks.config.seq.styles
    }

    /// Dances on with the random numbers of another seed.
    pub fn reseed(&mut self, seed: u64) {
        self.sampler.reseed(seed);
    }

    /// Forgets the past, in which the dancer stood: a model that continues
    /// what it sees would go on standing. From the second time in a row on it
    /// also begins at another moment of the style.
    fn wake(&mut self) {
        self.chain();
        if self.watch.in_a_row > 1 {
            self.codes = self.networks.starting_codes(self.style, &mut self.sampler);
        }
    }

    /// Draws the codes of the next frame.
    fn next_codes(&mut self, seq: &MotionSeq, team: &Team) -> Result<(), ModelError> {
        let music = [Some(&self.music[..]), None];
        let lanes = self.seq.lanes();
        seq.step(team, &mut self.seq, &self.codes, &music[..lanes]);
        self.sequence_frames += 1;
        for part in 0..self.codes.len() {
            let code = self.draw(seq, team, part)?;
            if code == self.networks.config.codes {
                return match self.options.at_end {
                    AtEnd::Stop => Err(ModelError::Ended { frame: self.frames }),
                    AtEnd::Chain => {
                        self.chain();
                        self.next_codes(seq, team)
                    }
                };
            }
            self.codes[part] = code;
        }
        self.recent.push(&self.codes);
        self.echo.push(&self.codes);
        Ok(())
    }

    /// One part's code, or the number of codes for the end, which does not come
    /// at once.
    fn draw(&mut self, seq: &MotionSeq, team: &Team, part: usize) -> Result<usize, ModelError> {
        let mut lanes = seq.logits(team, &mut self.seq, part, &self.codes[..part]);
        self.logits.clear();
        self.logits.extend(lanes.next().unwrap_or_default());
        if let Some(deaf) = lanes.next() {
            for (with, without) in self.logits.iter_mut().zip(deaf) {
                *with = without + self.options.guidance * (*with - without);
            }
        }
        let codes = self.networks.config.codes;
        if self.sequence_frames == 1 {
            self.logits.truncate(codes);
        }
        self.recent
            .discourage(part, self.options.repetition, &mut self.logits[..codes]);
        self.echo
            .discourage(part, self.options.variety, &mut self.logits[..codes]);
        let drawn = self.sampler.draw(&self.logits);
        drawn.ok_or(ModelError::Diverged { frame: self.frames })
    }

    /// The codes of the last frame, one per body part.
    pub fn codes(&self) -> &[usize] {
        &self.codes
    }

    /// How often the dance stood still while a beat was heard, and was woken.
    pub fn awakenings(&self) -> u64 {
        self.watch.awakenings
    }

    /// Music frames that were not finite so far.
    pub fn bad_music_frames(&self) -> u64 {
        self.bad_music_frames
    }
}

/// Keeps the dancer near where it began: the further out, the less of every
/// outward step counts. Inward steps and standing feet are left alone.
#[derive(Clone, Copy, Debug, Default)]
struct Stage {
    /// Root of the last frame as recovered, and as shown (x, z).
    recovered: [f32; 2],
    shown: [f32; 2],
}

impl Stage {
    fn place(&mut self, mut pose: Pose) -> Pose {
        let root = [pose[0][0], pose[0][2]];
        let mut step = [root[0] - self.recovered[0], root[1] - self.recovered[1]];
        let distance = self.shown[0].hypot(self.shown[1]);
        if distance > FREE_RADIUS_M {
            let out = self.shown.map(|v| v / distance);
            let outward = step[0] * out[0] + step[1] * out[1];
            let share = (distance - FREE_RADIUS_M) / (WALL_RADIUS_M - FREE_RADIUS_M);
            let taken = outward.max(0.0) * share.min(1.0);
            step = [step[0] - taken * out[0], step[1] - taken * out[1]];
        }
        self.recovered = root;
        self.shown = [self.shown[0] + step[0], self.shown[1] + step[1]];
        let shift = [self.shown[0] - root[0], self.shown[1] - root[1]];
        for point in &mut pose {
            point[0] += shift[0];
            point[2] += shift[1];
        }
        pose
    }
}

/// Notices a dancer who stands still although a beat is heard.
#[derive(Clone, Copy, Debug, Default)]
struct Watch {
    last: Option<Pose>,
    still_frames: u32,
    /// Awakenings since the last time that the dancer moved.
    in_a_row: u32,
    awakenings: u64,
}

impl Watch {
    /// Whether it is time to wake the dancer; counts it.
    fn stuck(&mut self, pose: &Pose, confidence: f32) -> bool {
        let moved_m = self
            .last
            .map_or(f32::INFINITY, |last| mean_step_m(&last, pose));
        self.last = Some(*pose);
        if moved_m > STILL_M {
            self.still_frames = 0;
            if moved_m > 4.0 * STILL_M {
                self.in_a_row = 0;
            }
        } else if confidence >= HEARD_CONFIDENCE {
            self.still_frames += 1;
        }
        if self.still_frames < STUCK_FRAMES {
            return false;
        }
        self.still_frames = 0;
        self.in_a_row += 1;
        self.awakenings += 1;
        true
    }
}

/// How far the joints moved on average.
fn mean_step_m(a: &Pose, b: &Pose) -> f32 {
    let step = |(p, q): (&[f32; 3], &[f32; 3])| {
        let squared: f32 = p.iter().zip(q).map(|(x, y)| (y - x).powi(2)).sum();
        squared.sqrt()
    };
    a.iter().zip(b).map(step).sum::<f32>() / a.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::JOINT_COUNT;

    #[test]
    fn a_still_dancer_is_woken_only_while_a_beat_is_heard() {
        let pose = [[0.0; 3]; JOINT_COUNT];
        let mut watch = Watch::default();
        assert!((0..200).all(|_| !watch.stuck(&pose, 0.0)));
        let woken = (0..100).filter(|_| watch.stuck(&pose, 0.9)).count();
        assert_eq!((woken, watch.in_a_row), (5, 5));
        let moving = (0..100).filter(|i| watch.stuck(&[[0.03 * *i as f32; 3]; JOINT_COUNT], 0.9));
        assert_eq!(moving.count(), 0);
        assert_eq!((watch.in_a_row, watch.awakenings), (0, 5));
    }

    #[test]
    fn a_straight_walk_stays_on_the_stage() {
        let mut stage = Stage::default();
        for i in 0..20_000 {
            let root = [0.05 * i as f32, 1.0, 0.02 * i as f32];
            let placed = stage.place([root; JOINT_COUNT]);
            let distance = placed[0][0].hypot(placed[0][2]);
            assert!(distance < WALL_RADIUS_M + 0.1, "{distance} m at frame {i}");
        }
    }

    #[test]
    fn near_the_start_nothing_is_moved() {
        let mut stage = Stage::default();
        let pose = [[0.3, 1.0, -0.5]; JOINT_COUNT];
        assert_eq!(stage.place(pose), pose);
    }
}
