//! The loudspeaker of a dance: the system's, built in with the feature `speaker`, or a
//! simulated one.

use super::audio_input::AudioChoice;
use super::song_sound::song_sound;
use anyhow::Context;
use servodance_audio::playback::{
    Heard, MusicStart, SimulatedDevice, SimulatedSpeaker, SongPlayer,
};
use std::sync::{Arc, Mutex, PoisonError};

/// Which loudspeaker, and how much later than the robot it is heard.
#[derive(Clone, Debug)]
pub struct SpeakerConfig {
    /// The device.
    pub device: SpeakerDevice,
    /// Beyond the latency that the device tells of, seconds; earlier if negative.
    pub delay_s: f64,
}

/// What plays.
#[derive(Clone, Debug)]
pub enum SpeakerDevice {
    /// An output of the system by id or name; the default one if `None`.
    System(Option<String>),
    /// A device in software; what it played is there after the dance.
    Simulated(SimulatedDevice, Arc<Mutex<Option<Heard>>>),
}

/// The song of a dance as it is played; dropped, it falls silent.
pub struct PlayedSong {
    /// The control loop says here when the music begins.
    pub start: MusicStart,
    output: Output,
}

enum Output {
    #[cfg(feature = "speaker")]
    System(servodance_audio::playback::Speaker),
    Simulated(SimulatedSpeaker, Arc<Mutex<Option<Heard>>>),
}

impl PlayedSong {
    /// Decodes the song and opens the device: silence until the music begins.
    pub fn open(config: &SpeakerConfig, song: &AudioChoice) -> anyhow::Result<Self> {
        let sound = song_sound(song).context("--speaker")?;
        let start = MusicStart::default();
        let player = SongPlayer::new(sound, start.clone(), config.delay_s);
        let output = match &config.device {
            SpeakerDevice::System(name) => system(name.as_deref(), player)?,
            SpeakerDevice::Simulated(device, heard) => {
                Output::Simulated(SimulatedSpeaker::start(*device, player)?, Arc::clone(heard))
            }
        };
        Ok(Self { start, output })
    }

    /// Whether the device has gone away since the beginning.
    pub fn is_gone(&self) -> bool {
        match &self.output {
            #[cfg(feature = "speaker")]
            Output::System(speaker) => speaker.is_gone(),
            Output::Simulated(..) => false,
        }
    }
}

impl Drop for PlayedSong {
    fn drop(&mut self) {
        match &self.output {
            #[cfg(feature = "speaker")]
            Output::System(_) => {}
            Output::Simulated(speaker, kept) => {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                *kept = Some(speaker.heard());
            }
        }
    }
}

#[cfg(feature = "speaker")]
fn system(name: Option<&str>, player: SongPlayer) -> anyhow::Result<Output> {
    let speaker = servodance_audio::playback::Speaker::start(name, player);
    Ok(Output::System(speaker.context("--speaker")?))
}

/// Says how to build it in.
#[cfg(not(feature = "speaker"))]
fn system(_name: Option<&str>, _player: SongPlayer) -> anyhow::Result<Output> {
    anyhow::bail!(
        "--speaker: loudspeakers are not built in; build with: cargo build --release \
         --features speaker (on Debian first: apt install libasound2-dev pkg-config)"
    )
}
