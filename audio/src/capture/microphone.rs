//! Microphones and other inputs of the system's sound interface, through cpal.
//!
//! The callback copies into the ring and returns. Blocks are short (3.3 ms where
//! the device allows it), because each waits for its own last sample.

use super::live_stream::LiveStream;
use super::ring::{RingFormat, RingReader, RingWriter, ring};
use super::stall::InputKind;
use super::supervisor::{DeviceOpener, DeviceSupervisor, FailureReporter, SupervisorEvent};
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{
    BufferSize, ErrorKind, FromSample, Sample as _, SampleFormat, SizedSample, StreamConfig,
    SupportedBufferSize, SupportedStreamConfigRange,
};
use std::time::{Duration, Instant};

/// Blocks a second requested from a device.
const BLOCKS_HZ: u32 = 300;
/// Rates in order of preference; all carry the band of the analysis.
const PREFERRED_RATES_HZ: [u32; 6] = [48_000, 44_100, 96_000, 32_000, 22_050, 16_000];
/// Longest time that opening a device may take.
const OPEN_PATIENCE: Duration = Duration::from_secs(10);
/// Longest delay that a driver is believed to have.
const LONGEST_DELAY: Duration = Duration::from_millis(250);

/// Why an input of the system cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// No input of the system has this id or name.
    #[error("no microphone \"{name}\"; there are: {}", list(.known))]
    Unknown {
        /// The id or name as given by the user.
        name: String,
        /// Ids of the inputs of the system.
        known: Vec<String>,
    },
    /// The input cannot be opened or queried.
    #[error("{name}: {reason}")]
    Failed {
        /// Name of the input for the user.
        name: String,
        /// The error of the sound interface in one line.
        reason: String,
    },
}

fn list(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        names => names.join(", "),
    }
}

/// An input of the system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputDevice {
    /// Identifier, the argument of `--mic`.
    pub id: String,
    /// Name for display, in one line.
    pub name: String,
    /// Rates that the device can deliver, hertz; a range as its two ends.
    pub rates_hz: Vec<(u32, u32)>,
    /// Numbers of channels that the device can deliver.
    pub channels: Vec<u16>,
    /// Whether the system uses this device when none is named.
    pub is_default: bool,
}

/// The inputs of the system, the default one first.
/// Errors: the system's sound interface does not answer.
pub fn devices() -> Result<Vec<InputDevice>, DeviceError> {
    silence_alsa();
    let host = cpal::default_host();
    let default = host.default_input_device().and_then(|d| d.id().ok());
    let inputs = host.input_devices().map_err(|error| DeviceError::Failed {
        name: "the sound interface".to_owned(),
        reason: in_one_line(&error),
    })?;
    let mut found: Vec<InputDevice> = Vec::new();
    for input in inputs {
        let (Ok(id), Ok(configs)) = (input.id(), input.supported_input_configs()) else {
            continue;
        };
        let configs: Vec<_> = configs.collect();
        if configs.is_empty() || found.iter().any(|d| d.id == id.id()) {
            continue;
        }
        found.push(InputDevice {
            is_default: default.as_ref() == Some(&id),
            id: id.id().to_owned(),
            name: input
                .description()
                .map_or_else(|_| id.id().to_owned(), |description| first_line(description.name())),
            rates_hz: distinct(configs.iter().map(|c| (c.min_sample_rate(), c.max_sample_rate()))),
            channels: distinct(configs.iter().map(SupportedStreamConfigRange::channels)),
        });
    }
    found.sort_by_key(|device| !device.is_default);
    Ok(found)
}

/// Keeps ALSA's library from printing failed attempts on standard error; the
/// errors that it returns are enough. The text goes to a buffer of this thread.
fn silence_alsa() {
    #[cfg(target_os = "linux")]
    let _ = alsa::Output::local_error_handler();
}

fn distinct<T: Ord>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut values: Vec<T> = values.collect();
    values.sort();
    values.dedup();
    values
}

fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().to_owned()
}

/// Opens the named input, or the default one.
/// Errors: there is no such input (the error lists the known ones), or it cannot be opened.
pub(crate) fn open_microphone(name: Option<&str>) -> Result<LiveStream, DeviceError> {
    let id = choose(name)?;
    let opener = MicrophoneOpener { id: id.clone() };
    let failed = |reason: String| DeviceError::Failed {
        name: match &id {
            Some(id) => format!("microphone {id}"),
            None => "the default microphone".to_owned(),
        },
        reason,
    };
    let supervisor = DeviceSupervisor::start(opener).map_err(|error| failed(error.to_string()))?;
    match supervisor.first_event(OPEN_PATIENCE) {
        Some(SupervisorEvent::Opened(ring)) => {
            let mut stream = LiveStream::new(InputKind::Device, supervisor, Instant::now());
            stream.connect(ring);
            Ok(stream)
        }
        Some(SupervisorEvent::Failed(reason)) => Err(failed(reason)),
        None => Err(failed("opening it takes too long".to_owned())),
    }
}

/// The id of the input with this id or name.
fn choose(name: Option<&str>) -> Result<Option<String>, DeviceError> {
    let Some(name) = name else { return Ok(None) };
    let known = devices()?;
    let is_meant = |d: &&InputDevice| d.id == name || d.name.eq_ignore_ascii_case(name);
    match known.iter().find(is_meant) {
        Some(device) => Ok(Some(device.id.clone())),
        None => Err(DeviceError::Unknown {
            name: name.to_owned(),
            known: known.into_iter().map(|d| d.id).collect(),
        }),
    }
}

struct MicrophoneOpener {
    /// Identifier; `None` for the default input.
    id: Option<String>,
}

impl DeviceOpener for MicrophoneOpener {
    type Open = cpal::Stream;

    fn open(&mut self, failure: FailureReporter) -> Result<(RingReader, cpal::Stream), String> {
        silence_alsa();
        let device = self.find().ok_or("it is not there")?;
        let configs = device.supported_input_configs();
        let configs = configs.map_err(|error| in_one_line(&error))?;
        let (config, format) = best(configs).ok_or("it has no format that can be used")?;
        let (writer, reader) =
            ring(RingFormat { sample_rate_hz: config.sample_rate, channels: config.channels });
        let stream = build(&device, config, format, writer, failure);
        let stream = stream.map_err(|error| in_one_line(&error))?;
        stream.play().map_err(|error| in_one_line(&error))?;
        Ok((reader, stream))
    }
}

impl MicrophoneOpener {
    fn find(&self) -> Option<cpal::Device> {
        let host = cpal::default_host();
        let Some(id) = &self.id else {
            return host.default_input_device();
        };
        let is_meant = |device: &cpal::Device| device.id().is_ok_and(|found| found.id() == id);
        host.input_devices().ok()?.find(is_meant)
    }
}

/// The best configuration of a device: a common rate, few channels, an exact format.
fn best(
    configs: impl Iterator<Item = SupportedStreamConfigRange>,
) -> Option<(StreamConfig, SampleFormat)> {
    let rated = configs.filter_map(|range| {
        let format_rank = FORMATS.iter().position(|f| *f == range.sample_format())?;
        let rates = range.min_sample_rate()..=range.max_sample_rate();
        let rate_rank = PREFERRED_RATES_HZ.iter().position(|r| rates.contains(r))?;
        Some(((rate_rank, range.channels(), format_rank), range))
    });
    let ((rate_rank, ..), range) = rated.min_by_key(|(rank, _)| *rank)?;
    let sample_rate = PREFERRED_RATES_HZ[rate_rank];
    let frames = sample_rate / BLOCKS_HZ;
    let config = StreamConfig {
        channels: range.channels(),
        sample_rate,
        buffer_size: match range.buffer_size() {
            SupportedBufferSize::Range { min, max } => BufferSize::Fixed(frames.clamp(*min, *max)),
            SupportedBufferSize::Unknown => BufferSize::Default,
        },
    };
    Some((config, range.sample_format()))
}

/// Supported formats in order of preference.
const FORMATS: [SampleFormat; 5] =
    [SampleFormat::I16, SampleFormat::F32, SampleFormat::I32, SampleFormat::U16, SampleFormat::U8];

fn build(
    device: &cpal::Device,
    config: StreamConfig,
    format: SampleFormat,
    writer: RingWriter,
    failure: FailureReporter,
) -> Result<cpal::Stream, cpal::Error> {
    match format {
        SampleFormat::I16 => capture::<i16>(device, config, writer, failure),
        SampleFormat::F32 => capture::<f32>(device, config, writer, failure),
        SampleFormat::I32 => capture::<i32>(device, config, writer, failure),
        SampleFormat::U16 => capture::<u16>(device, config, writer, failure),
        _ => capture::<u8>(device, config, writer, failure),
    }
}

fn capture<T: SizedSample>(
    device: &cpal::Device,
    config: StreamConfig,
    mut writer: RingWriter,
    failure: FailureReporter,
) -> Result<cpal::Stream, cpal::Error>
where
    f32: FromSample<T>,
{
    let frames_a_second = f64::from(config.sample_rate) * f64::from(config.channels);
    let on_data = move |block: &[T], info: &cpal::InputCallbackInfo| {
        // The driver reports the capture time of the first sample; the newest came
        // a block later, and not in the future.
        let stamp = info.timestamp();
        let delay = stamp.callback.duration_since(stamp.capture).min(LONGEST_DELAY);
        let length = Duration::from_secs_f64(block.len() as f64 / frames_a_second);
        let now = Instant::now();
        let captured = now.checked_sub(delay.saturating_sub(length)).unwrap_or(now);
        writer.write(block.iter().map(|s| f32::from_sample(*s)), captured);
    };
    let on_error = move |error: cpal::Error| match error.kind() {
        // The stream goes on. An overrun of the device is seen by the live stream
        // as sound that stayed away.
        ErrorKind::Xrun | ErrorKind::DeviceChanged | ErrorKind::RealtimeDenied => {}
        _ => failure.report(in_one_line(&error)),
    };
    device.build_input_stream(config, on_data, on_error, None)
}

fn in_one_line(error: &cpal::Error) -> String {
    let text = error.to_string().replace('\n', " ");
    text.trim_end_matches('.').to_owned()
}
