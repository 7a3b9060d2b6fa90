//! From sound to motion: audio in, one motion frame every 50 ms of audio out.
//!
//! [`Dancer`] does the work where it is called. [`DancerThread`] does it on a
//! thread of its own and hands frames over in a queue: motion ahead of time is
//! kept, never skipped, because a dance is only smooth if it is whole.

use crate::pipeline::audio_input::Audio;
use crate::pipeline::feature_extractor::Ears;
use crate::pipeline::load_shedding::{LeftOut, Overload};
use crate::pipeline::stage_source::StageSource;
use crate::process::failpoint;
use anyhow::Context;
use servodance_audio::MusicAnalyzer;
use servodance_audio::beats::{BeatTrack, track_offline};
use servodance_audio::capture::{CaptureEvent, CaptureStats};
use servodance_audio::source::SHORTEST_S;
use servodance_model::Dance;
use servodance_model::conditioning::{Encodec, HeardFrame};
use servodance_types::{MotionFrame, MusicFrame, Posture};
use std::sync::mpsc::{Receiver, Sender, SyncSender, TryRecvError, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::Instant;

/// Frames that a thread may be ahead of the robot: two seconds.
const QUEUE_FRAMES: usize = 40;

/// Dances beside the first, in other styles, at most.
pub const CHORUS: usize = 3;

/// How much of live music is remembered for its report, seconds.
const LIVE_HISTORY_S: f64 = 600.0;

/// One step of the dance, 50 ms.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// What the generator heard.
    pub music: MusicFrame,
    /// What it invented.
    pub motion: MotionFrame,
    /// The dancer's usual posture, if it came along.
    pub posture: Option<Posture>,
    /// What it invented beside it in other styles, with the number of each.
    pub chorus: [Option<(u8, MotionFrame)>; CHORUS],
    /// How long the features took, milliseconds.
    pub features_ms: f64,
    /// How long the model took, milliseconds.
    pub model_ms: f64,
    /// When the newest sample of the music frame was captured; `None` if the
    /// audio is not live.
    pub captured: Option<Instant>,
    /// When the step was ready.
    pub ready: Instant,
}

/// What may change while the dancer dances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Another style, as a place in the model's list.
    Style(usize),
    /// Another seed.
    Seed(u64),
    /// One more dance with this number, from 1, in this style; or in another.
    Voice(u8, usize),
    /// That dance is not wanted any more.
    Hush(u8),
}

/// What is known when the music is over.
#[derive(Clone, Debug, Default)]
pub struct Heard {
    /// Seconds of audio.
    pub audio_s: f64,
    /// Beats of the whole recording.
    pub beats: BeatTrack,
    /// Motion tokens that the generator writes for each frame.
    pub tokens_per_frame: u64,
    /// Music frames that had to be replaced because a number was not finite.
    pub replaced_music_frames: u64,
    /// What happened to live sound.
    pub capture: Option<CaptureStats>,
}

/// Told what the user should know about live sound.
pub type OnNotice = Box<dyn FnMut(&CaptureEvent) + Send>;

/// Listens and dances.
pub struct Dancer {
    audio: Audio,
    ears: Ears,
    generator: Dance,
    chorus: [Option<Dance>; CHORUS],
    block: Vec<f32>,
    features_ms: f64,
    samples: u64,
    ended: bool,
    on_notice: OnNotice,
    overload: Option<Overload>,
    /// The newest motion, for a figure that is held.
    shown: Option<MotionFrame>,
}

impl Dancer {
    /// A dancer for this audio; with an `encodec` for weights that hear through it.
    pub fn new(
        audio: Audio,
        generator: Dance,
        encodec: Option<&Encodec>,
        on_notice: OnNotice,
    ) -> anyhow::Result<Self> {
        let rate_hz = audio.sample_rate_hz();
        let analyzer = MusicAnalyzer::keeping_history(rate_hz)?;
        Ok(Self {
            ears: Ears::new(analyzer, rate_hz, encodec)?,
            audio,
            generator,
            chorus: Default::default(),
            block: Vec::new(),
            features_ms: 0.0,
            samples: 0,
            ended: false,
            on_notice,
            overload: None,
            shown: None,
        })
    }

    /// The same, leaving out what the machine is too slow for.
    pub fn sparing(mut self, overload: Overload) -> Self {
        self.overload = Some(overload);
        self
    }

    /// Listens to the first half second, so that audio that cannot be danced to
    /// is refused before the robot is powered.
    pub fn prime(&mut self) -> anyhow::Result<()> {
        let enough = (SHORTEST_S * f64::from(self.audio.sample_rate_hz())) as u64;
        while !self.ended && self.samples <= enough {
            self.listen()?;
        }
        Ok(())
    }

    /// The next step, or `None` when the music is over.
    pub fn next_step(&mut self) -> anyhow::Result<Option<Step>> {
        loop {
            if let Some(heard) = self.ears.pop() {
                let music = heard.frame;
                let start = Instant::now();
                let motion = self.invent(&heard)?;
                let chorus = self.invent_chorus(&heard)?;
                let features_ms = std::mem::take(&mut self.features_ms);
                let model_ms = milliseconds(start);
                if let Some(overload) = &mut self.overload {
                    overload.note(features_ms + model_ms);
                }
                return Ok(Some(Step {
                    music,
                    motion,
                    posture: None,
                    chorus,
                    features_ms,
                    model_ms,
                    captured: self.audio.captured_at(music.time_s),
                    ready: Instant::now(),
                }));
            }
            if self.ended {
                return Ok(None);
            }
            self.listen()?;
        }
    }

    /// The motion of a music frame; the last one again where the machine is far
    /// too slow to invent any.
    fn invent(&mut self, heard: &HeardFrame) -> anyhow::Result<MotionFrame> {
        let left_out = self.overload.as_ref().map(Overload::left_out);
        let left_out = left_out.unwrap_or_default();
        if let Some(held) = self.shown.filter(|_| left_out >= LeftOut::Generator) {
            let time_s = heard.frame.time_s;
            return Ok(MotionFrame { time_s, ..held });
        }
        self.generator.guide(left_out < LeftOut::Guidance)?;
        for _ in 0..self.generator.passes() {
            failpoint::pass("model");
        }
        let motion = self.generator.step_heard(heard);
        let motion = motion.context("the generator failed")?;
        self.shown = Some(motion);
        Ok(motion)
    }

    /// The motions of the other styles to the same music.
    fn invent_chorus(
        &mut self,
        heard: &HeardFrame,
    ) -> anyhow::Result<[Option<(u8, MotionFrame)>; CHORUS]> {
        let mut motions = [None; CHORUS];
        let places = self.chorus.iter_mut().zip(&mut motions);
        for (number, (dance, motion)) in (1..).zip(places) {
            if let Some(dance) = dance {
                let step = dance.step_heard(heard);
                *motion = Some((number, step.context("the generator failed")?));
            }
        }
        Ok(motions)
    }

    /// Dances on in another way.
    pub fn change(&mut self, change: Change) -> anyhow::Result<()> {
        match change {
            Change::Style(style) => {
                if let Some(name) = self.generator.styles().get(style).cloned() {
                    self.generator.set_style(&name)?;
                }
            }
            Change::Seed(seed) => self.generator.reseed(seed),
            Change::Voice(number, style) => {
                let place = usize::from(number).wrapping_sub(1);
                let style = self.generator.styles().get(style).cloned();
                if let (Some(place), Some(style)) = (self.chorus.get_mut(place), style) {
                    *place = Some(self.generator.beside(&style)?);
                }
            }
            Change::Hush(number) => {
                let place = usize::from(number).wrapping_sub(1);
                if let Some(place) = self.chorus.get_mut(place) {
                    *place = None;
                }
            }
        }
        Ok(())
    }

    /// Takes one block of audio in.
    fn listen(&mut self) -> anyhow::Result<()> {
        self.ended = !self.audio.next_block(&mut self.block)?;
        self.samples += self.block.len() as u64;
        if self.audio.is_live() {
            let now_s = self.samples as f64 / f64::from(self.audio.sample_rate_hz());
            self.ears.forget_before(now_s - LIVE_HISTORY_S);
        }
        while let Some(notice) = self.audio.next_notice() {
            (self.on_notice)(&notice);
        }
        let start = Instant::now();
        failpoint::pass("features");
        self.ears.push(&self.block)?;
        self.features_ms += milliseconds(start);
        Ok(())
    }

    /// What is known of the music so far.
    pub fn heard(&self) -> Heard {
        Heard {
            audio_s: self.samples as f64 / f64::from(self.audio.sample_rate_hz()),
            beats: self
                .ears
                .analyzer()
                .history()
                .map(track_offline)
                .unwrap_or_default(),
            tokens_per_frame: self.generator.codes().len() as u64,
            replaced_music_frames: self.generator.bad_music_frames(),
            capture: self.audio.capture_stats(),
        }
    }
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Where the control loop gets its motion from.
pub enum MotionSource {
    /// Made when asked for: simulated time waits for it.
    Inline(Box<Dancer>),
    /// Made ahead on another thread: the wall clock waits for nobody.
    Thread(DancerThread),
    /// Made elsewhere, with the time to show it.
    Stage(Box<StageSource>),
}

/// What a source has right now.
pub enum Next {
    /// A step.
    Step(Box<Step>),
    /// Nothing yet.
    Late,
    /// Whoever leads is away: idle.
    Away,
    /// The music is over.
    Ended,
}

impl MotionSource {
    /// The next step, if there is one now.
    pub fn poll(&mut self) -> anyhow::Result<Next> {
        match self {
            MotionSource::Inline(dancer) => Ok(match dancer.next_step()? {
                Some(step) => Next::Step(Box::new(step)),
                None => Next::Ended,
            }),
            MotionSource::Thread(thread) => thread.poll(),
            MotionSource::Stage(stage) => Ok(stage.poll()),
        }
    }

    /// Changes what comes next; a thread is up to two seconds ahead.
    pub fn change(&mut self, change: Change) -> anyhow::Result<()> {
        match self {
            MotionSource::Inline(dancer) => dancer.change(change)?,
            MotionSource::Thread(thread) => thread.change(change),
            // The leader alone can change what is led.
            MotionSource::Stage(_) => {}
        }
        Ok(())
    }

    /// What is known of the music once it is over, or once the dance was stopped.
    pub fn heard(self) -> anyhow::Result<Heard> {
        match self {
            MotionSource::Inline(dancer) => Ok(dancer.heard()),
            MotionSource::Thread(thread) => thread.heard(),
            MotionSource::Stage(_) => Ok(Heard::default()),
        }
    }
}

/// A [`Dancer`] on a thread of its own.
pub struct DancerThread {
    steps: Receiver<anyhow::Result<Step>>,
    changes: Sender<Change>,
    thread: JoinHandle<Heard>,
}

impl DancerThread {
    /// Starts the thread.
    pub fn start(mut dancer: Dancer) -> anyhow::Result<Self> {
        let (sender, steps) = sync_channel(QUEUE_FRAMES);
        let (changes, wanted) = channel();
        let thread = std::thread::Builder::new()
            .name("dancer".into())
            .spawn(move || {
                send_steps(&mut dancer, &sender, &wanted);
                dancer.heard()
            })?;
        Ok(Self {
            steps,
            changes,
            thread,
        })
    }

    /// The next step, if there is one now.
    ///
    /// # Errors
    /// Whatever failed on the thread.
    pub fn poll(&mut self) -> anyhow::Result<Next> {
        match self.steps.try_recv() {
            Ok(step) => Ok(Next::Step(Box::new(step?))),
            Err(TryRecvError::Empty) => Ok(Next::Late),
            Err(TryRecvError::Disconnected) => Ok(Next::Ended),
        }
    }

    /// Changes what comes next.
    pub fn change(&self, change: Change) {
        // A dancer who is done has nothing to change.
        let _ = self.changes.send(change);
    }

    /// What is known of the music; ends the thread.
    ///
    /// # Errors
    /// The thread broke down.
    pub fn heard(self) -> anyhow::Result<Heard> {
        // The thread ends at its next hand-over once nobody listens.
        drop(self.steps);
        self.thread
            .join()
            .map_err(|_| anyhow::anyhow!("the thread that hears and invents broke down; the robot went to rest, torque is off"))
    }
}

fn send_steps(
    dancer: &mut Dancer,
    sender: &SyncSender<anyhow::Result<Step>>,
    wanted: &Receiver<Change>,
) {
    let mut next = || {
        for change in wanted.try_iter() {
            dancer.change(change)?;
        }
        dancer.next_step()
    };
    while let Some(step) = next().transpose() {
        let failed = step.is_err();
        if sender.send(step).is_err() || failed {
            return;
        }
    }
}
