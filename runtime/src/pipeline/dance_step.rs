//! What the pipeline hands to the control loop, and what may be asked of it.

// Extra styles are for the leader of a stage, a feature.
#![cfg_attr(not(feature = "stage"), allow(dead_code))]

use servodance_audio::beats::BeatTrack;
use servodance_audio::capture::CaptureStats;
use servodance_types::{MotionFrame, MusicFrame, Posture};
use std::time::Instant;

/// Dances beside the main one, each in another style, at most.
pub const EXTRA_STYLES: usize = 3;

/// One step of the dance: 50 ms of music and the motion made from it.
#[derive(Clone, Copy, Debug)]
pub struct DanceStep {
    pub music: MusicFrame,
    pub motion: MotionFrame,
    /// Baseline posture of the dancer, where a leader sent it along.
    pub posture: Option<Posture>,
    /// The same moment in other styles, with the number of each.
    pub extra_styles: [Option<(u8, MotionFrame)>; EXTRA_STYLES],
    /// Time that the features took, milliseconds.
    pub features_ms: f64,
    /// Time that the model took, milliseconds.
    pub model_ms: f64,
    /// When the newest sample of the music frame was captured; `None` if the
    /// audio is not live.
    pub captured: Option<Instant>,
    pub ready: Instant,
}

impl DanceStep {
    /// A step that came from elsewhere, as of now.
    pub fn received(music: MusicFrame, motion: MotionFrame, posture: Posture) -> Self {
        Self {
            music,
            motion,
            posture: Some(posture),
            extra_styles: [None; EXTRA_STYLES],
            features_ms: 0.0,
            model_ms: 0.0,
            captured: None,
            ready: Instant::now(),
        }
    }
}

/// A request to dance on in another way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DanceChange {
    Style(usize),
    Seed(u64),
    /// A listener taps the beat at this time of the music, seconds.
    Tap(f64),
    /// Begins the extra dance of this number, from 1, in this style.
    AddExtra(u8, usize),
    DropExtra(u8),
}

/// What a motion source has at this moment.
pub enum Polled {
    Step(Box<DanceStep>),
    Late,
    /// The leader of the stage is away: idle.
    Away,
    Ended,
}

/// What is known of the music when it is over.
#[derive(Clone, Debug, Default)]
pub struct MusicSummary {
    /// Length of the audio, seconds.
    pub audio_s: f64,
    pub beats: BeatTrack,
    /// Beats a bar as heard live, and how sure, 0 to 1.
    pub meter: Option<(u8, f32)>,
    /// Motion tokens that the generator writes for each frame.
    pub tokens_per_frame: u64,
    /// Music frames that were replaced because a number was not finite.
    pub replaced_music_frames: u64,
    /// What the recording lacks, in words.
    pub damage: Option<String>,
    /// Totals of live capture: gaps, stalls, dropped samples.
    pub capture: Option<CaptureStats>,
}
