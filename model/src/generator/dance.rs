//! One dance: music frames in, motion frames out.
//!
//! A step allocates nothing, but takes a millisecond: not for a motor control
//! thread.

use std::sync::Arc;

use servodance_types::{MotionFrame, MusicFrame};

use super::floor::FloorBounds;
use super::motion_size::MotionSize;
use super::options::{AtEnd, GeneratorOptions};
use super::phrases::Phrases;
use super::smooth_motion::SmoothMotion;
use super::speed_by_music::SpeedByMusic;
use super::stall::StallDetector;
use super::standing_feet::StandingFeet;
use super::style_by_phrase::StyleByPhrase;
use super::{Generator, Networks};
use crate::conditioning::{HeardFrame, MusicKind};
use crate::engine::Team;
use crate::error::ModelError;
use crate::motion::representation::{Recovery, contacts, heading_rad};
use crate::motion::{Pose, skeleton};
use crate::motionseq::{MotionSeq, SeqState};
use crate::sampling::{PenaltyStrength, RepetitionPenalty, Sampler};
use crate::vqvae::DecoderState;

/// Share of the option `variety` within a phrase.
const VARIETY_IN_PHRASE: f32 = 0.5;

/// One dance in progress.
#[derive(Debug)]
pub struct Dance {
    networks: Arc<Networks>,
    /// With guidance a second lane dances the same without music and style.
    seq: SeqState,
    decoder: DecoderState,
    options: GeneratorOptions,
    sampler: Sampler,
    penalty: RepetitionPenalty,
    logits: Vec<f32>,
    codes: Vec<usize>,
    /// The last good music, normalised, and the newest as it came.
    music: Vec<f32>,
    features: Vec<f32>,
    bad_music_frames: u64,
    frames: u64,
    /// Frames of the sequence that the model sees.
    sequence_frames: u64,
    size: MotionSize,
    smooth: SmoothMotion,
    recovery: Recovery,
    floor: FloorBounds,
    feet: StandingFeet,
    style: usize,
    style_vector: Option<Vec<f32>>,
    /// In a medley.
    by_phrase: Option<StyleByPhrase>,
    phrases: Phrases,
    speed: SpeedByMusic,
    stall: StallDetector,
}

impl Dance {
    /// A dance from one of the stored beginnings; the options are checked.
    pub(super) fn new(
        networks: Arc<Networks>,
        style: usize,
        mut sampler: Sampler,
        options: GeneratorOptions,
    ) -> Self {
        let config = &networks.config;
        let by_phrase = match options.style_vector {
            Some(_) => None,
            None => networks.by_phrase(style),
        };
        let own = networks.own_style(style);
        let style = by_phrase.as_ref().map_or(own, StyleByPhrase::home);
        let codes = networks.starting_codes(style, &mut sampler);
        let lanes = if options.guidance == 1.0 { 1 } else { 2 };
        let mut dance = Self {
            seq: networks.seq.start(lanes),
            decoder: networks.decoder.start(),
            sampler,
            penalty: RepetitionPenalty::new(config.parts.len(), config.codes),
            logits: Vec::with_capacity(config.codes + 1),
            codes,
            music: vec![0.0; config.music_dim],
            features: Vec::with_capacity(config.music_dim),
            bad_music_frames: 0,
            frames: 0,
            sequence_frames: 0,
            size: MotionSize::default(),
            smooth: SmoothMotion::default(),
            recovery: Recovery::default(),
            floor: FloorBounds::default(),
            feet: StandingFeet::default(),
            style,
            style_vector: options.style_vector.clone(),
            by_phrase,
            phrases: Phrases::default(),
            speed: SpeedByMusic::default(),
            stall: StallDetector::default(),
            options,
            networks,
        };
        dance.apply_style();
        dance
    }

    /// The motion of the next frame. After an error the dance stands where it
    /// stood; start a new one.
    /// Weights that hear Encodec latents need [`Dance::step_heard`].
    pub fn step(&mut self, music: &MusicFrame) -> Result<MotionFrame, ModelError> {
        self.step_heard(&HeardFrame::from(*music))
    }

    /// The same with what else was listened for; fails for weights
    /// of another feature kind.
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
        if self.phrases.observe(music) {
            self.begin_phrase();
        }
        self.speed.observe(music.beat, self.phrases.level_db(), &self.options);
        let team = networks.engine.pool().team();
        self.next_codes(&networks.seq, &team)?;
        let normalised = networks.decoder.step(&team, &mut self.decoder, &self.codes)?;
        let vector = networks.pose_vector(normalised);
        drop(team);
        if vector.iter().any(|v| !v.is_finite()) {
            return Err(ModelError::Diverged { frame: self.frames });
        }
        self.frames += 1;
        let vector = self.size.apply(
            self.smooth.push(vector),
            &networks.motion_mean,
            self.phrases.level_db(),
            self.options.dynamics,
        );
        let pose = skeleton::fit(&self.recovery.push(&vector), 1.0);
        let positions = self.feet.place(self.floor.place(pose));
        if self.stall.stalled(&positions, music.beat.confidence) {
            self.restart_sequence();
        }
        Ok(MotionFrame { time_s: music.time_s, positions, contacts: contacts(&vector) })
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
            seq.step(&team, &mut self.seq, &self.codes, silence)?;
            let normalised = networks.decoder.step(&team, &mut self.decoder, row)?;
            self.recovery.push(&networks.pose_vector(normalised));
            self.codes.clone_from(row);
        }
        drop(team);
        self.sequence_frames += codes.len() as u64;
        let [x, _, z] = last[0];
        let root_xz_m = [f64::from(x), f64::from(z)];
        self.recovery.move_to(root_xz_m, heading_rad(last));
        self.floor = FloorBounds::at([x, z]);
        Ok(())
    }

    /// Dances on in another style, from the pose that it is in.
    /// Fails for: an unknown style; the message lists those there are.
    pub fn set_style(&mut self, style: &str) -> Result<(), ModelError> {
        let style = self.networks.style_index(style)?;
        self.by_phrase = self.networks.by_phrase(style);
        let own = self.networks.own_style(style);
        self.style = self.by_phrase.as_ref().map_or(own, StyleByPhrase::home);
        self.style_vector = None;
        self.apply_style();
        self.chain();
        Ok(())
    }

    /// Another figure, and in a medley another style.
    fn begin_phrase(&mut self) {
        if let Some(styles) = &mut self.by_phrase {
            self.style = styles.next_style(self.phrases.loudness());
            self.apply_style();
        }
        self.codes = self.networks.starting_codes(self.style, &mut self.sampler);
        self.chain();
    }

    fn apply_style(&mut self) {
        let seq = &self.networks.seq;
        let own = match &self.style_vector {
            Some(vector) => vector,
            None => seq.style(Some(self.style)),
        };
        let lanes = self.seq.lanes();
        seq.set_styles(&mut self.seq, &[own, seq.style(None)][..lanes]);
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
        self.phrases = Phrases::default();
        if let Some(by_phrase) = &mut self.by_phrase {
            by_phrase.reset();
            self.style = by_phrase.home();
            self.apply_style();
        }
        self.codes = self.networks.starting_codes(self.style, &mut self.sampler);
        self.speed = SpeedByMusic::default();
        self.size = MotionSize::default();
        self.smooth = SmoothMotion::default();
        self.chain();
        self.decoder.restart();
        self.penalty.clear();
        self.music.fill(0.0);
        (self.bad_music_frames, self.frames) = (0, 0);
        (self.recovery, self.floor) = (Recovery::default(), FloorBounds::default());
        (self.feet, self.stall) = (StandingFeet::default(), StallDetector::default());
    }

    /// Leaves guidance out from the next step on, which then takes less time, or
    /// takes it up again from the pose that the dancer is in.
    pub fn guide(&mut self, guided: bool) -> Result<(), ModelError> {
        let seq = &self.networks.seq;
        if !guided && self.seq.lanes() > 1 {
            self.seq = seq.first_lane(&self.seq)?;
        } else if guided && self.seq.lanes() == 1 && self.options.guidance != 1.0 {
            // Both lanes remember the same past: none.
            self.seq = seq.start(2);
            self.apply_style();
            self.chain();
        }
        Ok(())
    }

    /// How often a step goes through the network: twice if it is guided.
    pub fn passes(&self) -> u32 {
        self.seq.lanes() as u32
    }

    /// A new dance of the same networks and options in another style; it takes
    /// as long again for each step.
    /// Fails for: there is no such style.
    pub fn beside(&self, style: &str) -> Result<Dance, ModelError> {
        let generator = Generator { networks: self.networks.clone() };
        generator.start(GeneratorOptions {
            style: Some(style.to_owned()),
            style_vector: None,
            ..self.options.clone()
        })
    }

    /// Names of the styles, as [`Generator::styles`].
    pub fn styles(&self) -> &[String] {
        &self.networks.styles
    }

    /// Dances on with the random numbers of another seed.
    pub fn reseed(&mut self, seed: u64) {
        self.sampler.reseed(seed);
    }

    /// Forgets the past, in which the dancer stood: a model that continues
    /// what it sees would go on standing. From the second time in a row on it
    /// also begins at another moment of the style.
    fn restart_sequence(&mut self) {
        self.chain();
        if self.stall.in_a_row > 1 {
            self.codes = self.networks.starting_codes(self.style, &mut self.sampler);
        }
    }

    fn next_codes(&mut self, seq: &MotionSeq, team: &Team) -> Result<(), ModelError> {
        let music = [Some(&self.music[..]), None];
        let lanes = self.seq.lanes();
        seq.step(team, &mut self.seq, &self.codes, &music[..lanes])?;
        self.sequence_frames += 1;
        for index in 0..self.codes.len() {
            let code = self.draw(seq, team, index)?;
            if code == self.networks.config.codes {
                return match self.options.at_end {
                    AtEnd::Stop => Err(ModelError::Ended { frame: self.frames }),
                    AtEnd::Chain => {
                        self.chain();
                        self.next_codes(seq, team)
                    }
                };
            }
            self.codes[index] = code;
        }
        self.penalty.push(&self.codes[..self.networks.config.parts.len()]);
        Ok(())
    }

    /// One code of a frame, or the number of codes for the end (never in the first frame).
    fn draw(&mut self, seq: &MotionSeq, team: &Team, index: usize) -> Result<usize, ModelError> {
        let mut lanes = seq.logits(team, &mut self.seq, index, &self.codes[..index])?;
        self.logits.clear();
        self.logits.extend(lanes.next().unwrap_or_default());
        if let Some(unheard) = lanes.next() {
            for (with, without) in self.logits.iter_mut().zip(unheard) {
                *with = without + self.options.guidance * (*with - without);
            }
        }
        let codes = self.networks.config.codes;
        if self.sequence_frames == 1 {
            self.logits.truncate(codes);
        }
        drop(lanes);
        // What is left of a part says nothing of the figure.
        if index < self.networks.config.parts.len() {
            self.discourage(index);
            self.speed.favour(self.networks.code_speeds.of(index), &mut self.logits);
        }
        let drawn = self.sampler.draw(&self.logits);
        drawn.ok_or(ModelError::Diverged { frame: self.frames })
    }

    /// Repetition penalties of one part.
    fn discourage(&mut self, part: usize) {
        let codes = self.networks.config.codes;
        let bar_frames = self.phrases.bar_to_repeat();
        let in_phrase = if bar_frames.is_some() { VARIETY_IN_PHRASE } else { 1.0 };
        let strength = PenaltyStrength {
            repetition: self.options.repetition,
            variety: self.options.variety * in_phrase,
            bar_repeat: self.options.bar_repeat,
            bar_frames,
        };
        self.penalty.apply(part, strength, &mut self.logits[..codes]);
    }

    /// The codes of the last frame ([`ModelConfig::code_names`](crate::config::ModelConfig::code_names)).
    pub fn codes(&self) -> &[usize] {
        &self.codes
    }

    /// How often the dance stood still while a beat was heard, and was restarted.
    pub fn restarts(&self) -> u64 {
        self.stall.restarts
    }

    /// Music frames that were not finite so far.
    pub fn bad_music_frames(&self) -> u64 {
        self.bad_music_frames
    }
}
