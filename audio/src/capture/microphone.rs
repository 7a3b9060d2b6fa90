//! Microphones and other inputs of the system's sound interface, through cpal.
//!
//! The callback copies into the link and returns. Blocks are short (3.3 ms where
//! the device allows it), because each waits for its own last sample.

use super::keeper::{Failure, Keeper, LinkEvent, Opener};
use super::link::{LinkFormat, LinkReader, LinkWriter, link};
use super::listener::{Kind, Listener};
use crate::source::SourceError;
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{
    BufferSize, ErrorKind, FromSample, Sample as _, SampleFormat, SizedSample, StreamConfig,
    SupportedBufferSize, SupportedStreamConfigRange,
};
use std::time::{Duration, Instant};

/// Blocks a second asked of a device.
const BLOCKS_HZ: u32 = 300;
/// Rates from the best to the least; all hold what the analysis hears.
const PREFERRED_RATES_HZ: [u32; 6] = [48_000, 44_100, 96_000, 32_000, 22_050, 16_000];
/// How long opening a device may take before it is given up.
const OPEN_PATIENCE: Duration = Duration::from_secs(10);
/// A driver that claims a longer delay than this is not believed.
const LONGEST_DELAY: Duration = Duration::from_millis(250);

/// An input of the system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// What `--mic` takes.
    pub id: String,
    /// What people call it.
    pub name: String,
    /// Rates that it can deliver, hertz; a range as its two ends.
    pub rates_hz: Vec<(u32, u32)>,
    /// Numbers of channels that it can deliver.
    pub channels: Vec<u16>,
    /// Whether it is taken when none is named.
    pub is_default: bool,
}

/// The inputs there are, the default one first.
///
/// # Errors
/// The system's sound interface does not answer.
pub fn devices() -> Result<Vec<Device>, SourceError> {
    keep_quiet();
    let host = cpal::default_host();
    let default = host.default_input_device().and_then(|d| d.id().ok());
    let inputs = host.input_devices().map_err(|error| SourceError::Device {
        name: "the sound interface".to_owned(),
        reason: in_one_line(&error),
    })?;
    let mut found: Vec<Device> = Vec::new();
    for input in inputs {
        let (Ok(id), Ok(configs)) = (input.id(), input.supported_input_configs()) else {
            continue;
        };
        let configs: Vec<_> = configs.collect();
        if configs.is_empty() || found.iter().any(|d| d.id == id.id()) {
            continue;
        }
        found.push(Device {
            is_default: default.as_ref() == Some(&id),
            id: id.id().to_owned(),
            name: input.description().map_or_else(
                |_| id.id().to_owned(),
                |description| first_line(description.name()),
            ),
            rates_hz: distinct(
                configs
                    .iter()
                    .map(|c| (c.min_sample_rate(), c.max_sample_rate())),
            ),
            channels: distinct(configs.iter().map(SupportedStreamConfigRange::channels)),
        });
    }
    found.sort_by_key(|device| !device.is_default);
    Ok(found)
}

/// ALSA's library prints what it tries and cannot open on standard error.
/// What matters is in the errors that it returns; the text goes to a buffer of
/// this thread, a new one at each call.
fn keep_quiet() {
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

/// Listens to the named input, or to the default one.
///
/// # Errors
/// There is no such input (the error lists those there are), or it cannot be
/// opened.
pub(crate) fn listen_to_microphone(name: Option<&str>) -> Result<Listener, SourceError> {
    let id = choose(name)?;
    let opener = MicrophoneOpener { id: id.clone() };
    let unreadable = |reason: String| SourceError::Device {
        name: device_name(&id),
        reason,
    };
    let keeper = Keeper::start(opener).map_err(|error| unreadable(error.to_string()))?;
    match keeper.first_event(OPEN_PATIENCE) {
        Some(LinkEvent::Opened(link)) => {
            let mut listener = Listener::new(Kind::Device, keeper, Instant::now());
            listener.connect(link);
            Ok(listener)
        }
        Some(LinkEvent::Failed(reason)) => Err(unreadable(reason)),
        None => Err(unreadable("opening it takes too long".to_owned())),
    }
}

/// What errors call the device.
pub(crate) fn device_name(id: &Option<String>) -> String {
    match id {
        Some(id) => format!("microphone {id}"),
        None => "the default microphone".to_owned(),
    }
}

/// The id of the input with this id or name.
fn choose(name: Option<&str>) -> Result<Option<String>, SourceError> {
    let Some(name) = name else { return Ok(None) };
    let known = devices()?;
    let is_meant = |d: &&Device| d.id == name || d.name.eq_ignore_ascii_case(name);
    match known.iter().find(is_meant) {
        Some(device) => Ok(Some(device.id.clone())),
        None => Err(SourceError::UnknownDevice {
            name: name.to_owned(),
            known: known.into_iter().map(|d| d.id).collect(),
        }),
    }
}

/// Opens one device, again and again.
struct MicrophoneOpener {
    /// The default input if `None`.
    id: Option<String>,
}

impl Opener for MicrophoneOpener {
    type Stream = cpal::Stream;

    fn open(&mut self, failure: Failure) -> Result<(LinkReader, cpal::Stream), String> {
        keep_quiet();
        let device = self.find().ok_or("it is not there")?;
        let configs = device.supported_input_configs();
        let configs = configs.map_err(|error| in_one_line(&error))?;
        let (config, format) = best(configs).ok_or("it has no format that can be used")?;
        let (writer, reader) = link(LinkFormat {
            sample_rate_hz: config.sample_rate,
            channels: config.channels,
        });
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

/// The best of what a device can do: a rate that is common, few channels, a
/// format that is copied without rounding.
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

/// Formats that can be read, the best first.
const FORMATS: [SampleFormat; 5] = [
    SampleFormat::I16,
    SampleFormat::F32,
    SampleFormat::I32,
    SampleFormat::U16,
    SampleFormat::U8,
];

fn build(
    device: &cpal::Device,
    config: StreamConfig,
    format: SampleFormat,
    writer: LinkWriter,
    failure: Failure,
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
    mut writer: LinkWriter,
    failure: Failure,
) -> Result<cpal::Stream, cpal::Error>
where
    f32: FromSample<T>,
{
    let frames_a_second = f64::from(config.sample_rate) * f64::from(config.channels);
    let on_data = move |block: &[T], info: &cpal::InputCallbackInfo| {
        // The driver says when the first sample was captured; the newest came
        // a block later, and no driver knows the future.
        let stamp = info.timestamp();
        let delay = stamp
            .callback
            .duration_since(stamp.capture)
            .min(LONGEST_DELAY);
        let length = Duration::from_secs_f64(block.len() as f64 / frames_a_second);
        let now = Instant::now();
        let captured = now.checked_sub(delay.saturating_sub(length)).unwrap_or(now);
        writer.write(block.iter().map(|s| f32::from_sample(*s)), captured);
    };
    let on_error = move |error: cpal::Error| match error.kind() {
        // The stream goes on. What an overrun of the device lost is seen by
        // the listener as sound that stayed away.
        ErrorKind::Xrun | ErrorKind::DeviceChanged | ErrorKind::RealtimeDenied => {}
        _ => failure.tell(in_one_line(&error)),
    };
    device.build_input_stream(config, on_data, on_error, None)
}

fn in_one_line(error: &cpal::Error) -> String {
    let text = error.to_string().replace('\n', " ");
    text.trim_end_matches('.').to_owned()
}
