//! Audio in, motion out: one step for every 50 ms of audio, on the thread that
//! asks for it. [`super::dancer_thread`] does the same ahead of time.

use super::audio_input::AudioInput;
use super::dance_step::{DanceChange, DanceStep, EXTRA_STYLES, MusicSummary};
use super::feature_extractor::FeatureExtractor;
use super::load_shedding::{LeftOut, OverloadWatch};
use crate::process::failpoint;
use crate::process::interrupted::Interrupted;
use anyhow::Context;
use servodance_audio::beats::{BeatHistory, track_offline};
use servodance_audio::capture::CaptureEvent;
use servodance_audio::source::SHORTEST_S;
use servodance_audio::{MusicAnalyzer, TempoRange};
use servodance_drivers::{EStop, SafetyError};
use servodance_model::Dance;
use servodance_model::conditioning::{Encodec, HeardFrame};
use servodance_types::MotionFrame;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// How much of live music is remembered for its report, seconds.
const LIVE_HISTORY_S: f64 = 600.0;

/// Gets what the user should know about live sound.
pub type OnNotice = Box<dyn FnMut(&CaptureEvent) + Send>;

/// Feature extractor and generator on one audio input.
pub struct Dancer {
    audio: AudioInput,
    features: FeatureExtractor,
    generator: Dance,
    extra_styles: [Option<Dance>; EXTRA_STYLES],
    block: Vec<f32>,
    features_ms: f64,
    samples: u64,
    ended: bool,
    on_notice: OnNotice,
    overload: Option<OverloadWatch>,
    /// The newest motion, held while the machine is far too slow.
    newest: Option<MotionFrame>,
}

impl Dancer {
    /// A dancer for this audio; with an `encodec` for weights that need its latents.
    pub fn new(
        audio: AudioInput,
        generator: Dance,
        encodec: Option<&Encodec>,
        on_notice: OnNotice,
    ) -> anyhow::Result<Self> {
        let rate_hz = audio.sample_rate_hz();
        let analyzer = MusicAnalyzer::keeping_history(rate_hz)?;
        Ok(Self {
            features: FeatureExtractor::new(analyzer, rate_hz, encodec)?,
            audio,
            generator,
            extra_styles: Default::default(),
            block: Vec::new(),
            features_ms: 0.0,
            samples: 0,
            ended: false,
            on_notice,
            overload: None,
            newest: None,
        })
    }

    /// Follows no other tempi.
    pub fn limit_tempo(&mut self, tempo: TempoRange) {
        self.features.limit_tempo(tempo);
    }

    pub fn shedding(mut self, overload: OverloadWatch) -> Self {
        self.overload = Some(overload);
        self
    }

    /// Reads the first half second, so that audio that cannot be danced to is
    /// refused before the robot is powered. Live sound may be long in coming:
    /// [`Interrupted`] where `stop` is set meanwhile, or `estop` pressed.
    pub fn prime(&mut self, stop: &AtomicBool, estop: &EStop) -> anyhow::Result<()> {
        let enough = (SHORTEST_S * f64::from(self.audio.sample_rate_hz())) as u64;
        while !self.ended && self.samples <= enough {
            if stop.load(Ordering::Relaxed) {
                return Err(Interrupted.into());
            }
            if estop.is_pressed() {
                return Err(SafetyError::EStop { cause: estop.cause() }.into());
            }
            self.read_block()?;
        }
        Ok(())
    }

    /// The next step, or `None` when the music is over.
    pub fn next_step(&mut self) -> anyhow::Result<Option<DanceStep>> {
        loop {
            if let Some(heard) = self.features.pop() {
                return self.step(&heard).map(Some);
            }
            if self.ended {
                return Ok(None);
            }
            self.read_block()?;
        }
    }

    fn step(&mut self, heard: &HeardFrame) -> anyhow::Result<DanceStep> {
        let start = Instant::now();
        let motion = self.motion(heard)?;
        let extra_styles = self.extra_motions(heard)?;
        let features_ms = std::mem::take(&mut self.features_ms);
        let model_ms = milliseconds(start);
        if let Some(overload) = &mut self.overload {
            overload.note(features_ms + model_ms);
        }
        Ok(DanceStep {
            music: heard.frame,
            motion,
            posture: None,
            extra_styles,
            features_ms,
            model_ms,
            captured: self.audio.captured_at(heard.frame.time_s),
            ready: Instant::now(),
        })
    }

    /// The motion of a music frame; the last one again while load shedding
    /// leaves the generator out.
    fn motion(&mut self, heard: &HeardFrame) -> anyhow::Result<MotionFrame> {
        let left_out = self.overload.as_ref().map(OverloadWatch::left_out);
        let left_out = left_out.unwrap_or_default();
        if let Some(held) = self.newest.filter(|_| left_out >= LeftOut::Generator) {
            let time_s = heard.frame.time_s;
            return Ok(MotionFrame { time_s, ..held });
        }
        self.generator.guide(left_out < LeftOut::Guidance)?;
        for _ in 0..self.generator.passes() {
            failpoint::pass("model");
        }
        let motion = self.generator.step_heard(heard);
        let motion = motion.context("the generator failed")?;
        self.newest = Some(motion);
        Ok(motion)
    }

    fn extra_motions(
        &mut self,
        heard: &HeardFrame,
    ) -> anyhow::Result<[Option<(u8, MotionFrame)>; EXTRA_STYLES]> {
        let mut motions = [None; EXTRA_STYLES];
        let places = self.extra_styles.iter_mut().zip(&mut motions);
        for (number, (dance, motion)) in (1..).zip(places) {
            if let Some(dance) = dance {
                let step = dance.step_heard(heard);
                *motion = Some((number, step.context("the generator failed")?));
            }
        }
        Ok(motions)
    }

    /// Takes effect with the next step. An unknown style or number changes nothing.
    pub fn change(&mut self, change: DanceChange) -> anyhow::Result<()> {
        let index = |number: u8| usize::from(number).wrapping_sub(1);
        match change {
            DanceChange::Style(style) => {
                if let Some(name) = self.generator.styles().get(style).cloned() {
                    self.generator.set_style(&name)?;
                }
            }
            DanceChange::Seed(seed) => self.generator.reseed(seed),
            DanceChange::Tap(time_s) => self.features.tap(time_s),
            DanceChange::AddExtra(number, style) => {
                let style = self.generator.styles().get(style).cloned();
                let extra = self.extra_styles.get_mut(index(number));
                if let (Some(extra), Some(style)) = (extra, style) {
                    *extra = Some(self.generator.beside(&style)?);
                }
            }
            DanceChange::DropExtra(number) => {
                if let Some(extra) = self.extra_styles.get_mut(index(number)) {
                    *extra = None;
                }
            }
        }
        Ok(())
    }

    fn read_block(&mut self) -> anyhow::Result<()> {
        self.ended = !self.audio.next_block(&mut self.block)?;
        self.samples += self.block.len() as u64;
        if self.audio.is_live() {
            self.features.forget_before(self.audio_s() - LIVE_HISTORY_S);
        }
        while let Some(notice) = self.audio.next_notice() {
            (self.on_notice)(&notice);
        }
        let start = Instant::now();
        failpoint::pass("features");
        self.features.push(&self.block)?;
        self.features_ms += milliseconds(start);
        Ok(())
    }

    fn audio_s(&self) -> f64 {
        self.samples as f64 / f64::from(self.audio.sample_rate_hz())
    }

    /// What is known of the music so far.
    pub fn summary(&self) -> MusicSummary {
        let history = self.features.analyzer().history();
        MusicSummary {
            audio_s: self.audio_s(),
            beats: history.map(track_offline).unwrap_or_default(),
            meter: history.and_then(BeatHistory::live_meter),
            tokens_per_frame: self.generator.codes().len() as u64,
            replaced_music_frames: self.generator.bad_music_frames(),
            damage: self.audio.damage(),
            capture: self.audio.capture_stats(),
        }
    }
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
