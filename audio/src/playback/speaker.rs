//! Loudspeakers of the system's sound interface, through cpal.
//!
//! The driver says how long a sample is on its way; the player aims for when it is heard.

use super::song_player::SongPlayer;
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{ErrorKind, FromSample, SampleFormat, SizedSample, StreamConfig, SupportedStreamConfig};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest delay that a driver is believed to have.
const LONGEST_DELAY: Duration = Duration::from_secs(2);

/// Why a loudspeaker cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SpeakerError {
    /// No output of the system has this id or name.
    #[error("no loudspeaker \"{name}\"; there are: {}", list(.known))]
    Unknown {
        /// The id or name as given by the user.
        name: String,
        /// Ids of the outputs of the system.
        known: Vec<String>,
    },
    /// The output cannot be opened.
    #[error("the loudspeaker: {0}")]
    Failed(String),
}

fn list(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        names => names.join(", "),
    }
}

/// An open loudspeaker; dropped, it falls silent.
pub struct Speaker {
    _stream: cpal::Stream,
    gone: Arc<AtomicBool>,
}

impl Speaker {
    /// Opens the named output, or the default one, and plays.
    /// Errors: there is no such output (the error lists the known ones), or it cannot be
    /// opened.
    pub fn start(name: Option<&str>, player: SongPlayer) -> Result<Self, SpeakerError> {
        #[cfg(target_os = "linux")]
        let _quiet = alsa::Output::local_error_handler();
        let device = find(name)?;
        let config = device.default_output_config().map_err(failed)?;
        let gone = Arc::new(AtomicBool::new(false));
        let stream = build(&device, &config, player, Arc::clone(&gone)).map_err(failed)?;
        stream.play().map_err(failed)?;
        Ok(Self { _stream: stream, gone })
    }

    /// Whether the device has gone away since; the dance goes on without it.
    pub fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }
}

fn find(name: Option<&str>) -> Result<cpal::Device, SpeakerError> {
    let host = cpal::default_host();
    let Some(name) = name else {
        let none = || SpeakerError::Failed("this machine has none".to_owned());
        return host.default_output_device().ok_or_else(none);
    };
    let mut known = Vec::new();
    for device in host.output_devices().map_err(failed)? {
        let Ok(id) = device.id() else { continue };
        let called = device.description().is_ok_and(|d| d.name().eq_ignore_ascii_case(name));
        if id.id() == name || called {
            return Ok(device);
        }
        known.push(id.id().to_owned());
    }
    Err(SpeakerError::Unknown { name: name.to_owned(), known })
}

fn build(
    device: &cpal::Device,
    config: &SupportedStreamConfig,
    player: SongPlayer,
    gone: Arc<AtomicBool>,
) -> Result<cpal::Stream, cpal::Error> {
    let format = config.sample_format();
    let config = config.config();
    match format {
        SampleFormat::F32 => play::<f32>(device, config, player, gone),
        SampleFormat::I16 => play::<i16>(device, config, player, gone),
        SampleFormat::I32 => play::<i32>(device, config, player, gone),
        SampleFormat::U16 => play::<u16>(device, config, player, gone),
        _ => play::<u8>(device, config, player, gone),
    }
}

fn play<T: SizedSample + FromSample<f32>>(
    device: &cpal::Device,
    config: StreamConfig,
    mut player: SongPlayer,
    gone: Arc<AtomicBool>,
) -> Result<cpal::Stream, cpal::Error> {
    let (channels, rate_hz) = (usize::from(config.channels), f64::from(config.sample_rate));
    let on_data = move |block: &mut [T], info: &cpal::OutputCallbackInfo| {
        let stamp = info.timestamp();
        let delay = stamp.playback.duration_since(stamp.callback).min(LONGEST_DELAY);
        player.fill(block, channels, rate_hz, Instant::now() + delay, T::from_sample);
    };
    let on_error = move |error: cpal::Error| match error.kind() {
        ErrorKind::Xrun | ErrorKind::DeviceChanged | ErrorKind::RealtimeDenied => {}
        _ => gone.store(true, Ordering::Relaxed),
    };
    device.build_output_stream(config, on_data, on_error, None)
}

fn failed(error: cpal::Error) -> SpeakerError {
    let text = error.to_string().replace('\n', " ");
    SpeakerError::Failed(text.trim_end_matches('.').to_owned())
}
