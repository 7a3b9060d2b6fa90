//! Recordings, decoded packet by packet with symphonia.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use symphonia::core::codecs::audio::{AudioDecoder, AudioDecoderOptions};
use symphonia::core::errors::Error as Fault;
use symphonia::core::formats::probe::Hint;
use symphonia::core::formats::{FormatOptions, FormatReader, Track, TrackType};
use symphonia::core::io::{MediaSourceStream, MediaSourceStreamOptions};
use symphonia::core::meta::MetadataOptions;

use super::error::{SHORTEST_S, SourceError, SourceFault};

/// A recording that never rises above this (-80 dB of full scale) is silent.
const AUDIBLE: f32 = 1e-4;

/// First bytes of the known kinds of file.
const MAGICS: [&[u8; 4]; 3] = [b"RIFF", b"fLaC", b"OggS"];

/// Broken packets in a row after which reading ends.
const PATIENCE: u64 = 1000;

/// Time missing between two packets that counts as loss: shorter is rounding,
/// longer is a new beginning.
const GAP_S: std::ops::Range<f64> = 0.005..30.0;

/// What may lack of the length that a file states, seconds.
const MISSED_S: f64 = 0.5;

/// Decodes one track of a file. Silence replaces lost packets, so that everything
/// after them stays in time.
pub(super) struct FileReader {
    name: String,
    format: Box<dyn FormatReader>,
    decoder: Box<dyn AudioDecoder>,
    track: u32,
    sample_rate_hz: u32,
    duration_s: Option<f64>,
    interleaved: Vec<f32>,
    /// Seconds of one tick of the packets' time stamps.
    tick_s: Option<f64>,
    /// Time stamp of the first packet, seconds.
    origin_s: Option<f64>,
    delivered: u64,
    decoded: u64,
    skipped: u64,
    /// Value of `skipped` at the last gap.
    skipped_before: u64,
    skipped_in_a_row: u64,
    fault: Option<String>,
    /// The end came in the middle of something.
    is_cut: bool,
    has_ended: bool,
}

/// Reads a file until it is known to be long enough and audible.
pub(super) fn check(path: &Path) -> Result<(), SourceError> {
    let mut reader = FileReader::open(path)?;
    let mut block = Vec::new();
    let mut samples = 0;
    let mut audible = false;
    loop {
        block.clear();
        let more = reader.next_block(&mut block)?;
        samples += block.len();
        audible |= block.iter().any(|s| s.abs() > AUDIBLE);
        let seconds = samples as f64 / f64::from(reader.sample_rate_hz);
        match more {
            true if audible && seconds >= SHORTEST_S => return Ok(()),
            true => {}
            false => return Err(reader.verdict(seconds)),
        }
    }
}

impl FileReader {
    pub(super) fn open(path: &Path) -> Result<Self, SourceError> {
        let name = path.display().to_string();
        let unreadable = |error| SourceFault::io(error).of(&name);
        let file = File::open(path).map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        if metadata.is_dir() {
            let error = std::io::Error::other("it is a folder");
            return Err(SourceFault::Unreadable(error).of(&name));
        }
        if metadata.is_file() && metadata.len() == 0 {
            return Err(SourceFault::Empty.of(&name));
        }
        let stream = MediaSourceStream::new(Box::new(file), MediaSourceStreamOptions::default());
        let format = symphonia::default::get_probe()
            .probe(&Hint::new(), stream, FormatOptions::default(), MetadataOptions::default())
            .map_err(|fault| not_probed(&name, fault))?;
        Self::on_format(name, format)
    }

    fn on_format(name: String, format: Box<dyn FormatReader>) -> Result<Self, SourceError> {
        let no_rate = SourceFault::Corrupt("it does not say its sample rate".to_owned());
        let track = audio_track(&name, &*format)?;
        let decoder = decoder_for(&name, track)?;
        let sample_rate_hz = decoder
            .codec_params()
            .sample_rate
            .filter(|rate| *rate > 0)
            .ok_or_else(|| no_rate.of(&name))?;
        let duration_s = track
            .num_frames
            .filter(|&frames| frames > 0)
            .map(|frames| frames as f64 / f64::from(sample_rate_hz));
        Ok(Self {
            track: track.id,
            decoder,
            sample_rate_hz,
            duration_s,
            interleaved: Vec::new(),
            tick_s: track
                .time_base
                .map(|base| f64::from(base.numer.get()) / f64::from(base.denom.get())),
            origin_s: None,
            delivered: 0,
            decoded: 0,
            skipped: 0,
            skipped_before: 0,
            skipped_in_a_row: 0,
            fault: None,
            is_cut: false,
            has_ended: false,
            format,
            name,
        })
    }

    pub(super) fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    pub(super) fn duration_s(&self) -> Option<f64> {
        self.duration_s
    }

    pub(super) fn skipped_packets(&self) -> u64 {
        self.skipped
    }

    /// What the file lacks, in words: all of it once the end was read.
    pub(super) fn damage(&self) -> Option<String> {
        let heard_s = self.delivered as f64 / f64::from(self.sample_rate_hz);
        let promised_s = self.duration_s.filter(|_| self.says_its_length());
        let lacks = promised_s.is_some_and(|promised_s| promised_s > heard_s + MISSED_S);
        match (self.has_ended, promised_s) {
            (true, Some(promised_s)) if lacks => {
                Some(format!("cut short: {heard_s:.1} of {promised_s:.1} s are there"))
            }
            (true, _) if self.is_cut && !self.says_its_length() => {
                Some(format!("cut short after {heard_s:.1} s"))
            }
            _ if self.skipped > 0 => Some(format!("{} broken packets left out", self.skipped)),
            _ => None,
        }
    }

    /// Whether the length is written in the file, unless a program wrote it as it went: of
    /// MP3 it may be an estimate.
    fn says_its_length(&self) -> bool {
        matches!(self.format.format_info().short_name, "wave" | "flac")
    }

    /// Appends the next packet that can be decoded; `false` at the end.
    pub(super) fn next_block(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        let more = self.next_packet(block)?;
        self.has_ended |= !more;
        Ok(more)
    }

    fn next_packet(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        while self.skipped_in_a_row < PATIENCE {
            let packet = match self.format.next_packet() {
                Ok(Some(packet)) if packet.track_id == self.track => packet,
                Ok(Some(_)) => continue,
                Ok(None) => return Ok(false),
                Err(Fault::ResetRequired) => {
                    self.restart()?;
                    continue;
                }
                // A file that was cut short ends here.
                Err(Fault::IoError(error)) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
                    self.fault = Some("it was cut short".to_owned());
                    self.is_cut = true;
                    return Ok(false);
                }
                Err(Fault::IoError(error)) => return Err(SourceFault::io(error).of(&self.name)),
                Err(fault) => {
                    self.skip(&fault);
                    continue;
                }
            };
            let audio = match self.decoder.decode(&packet) {
                Ok(audio) => audio,
                Err(fault) => {
                    self.skip(&fault);
                    continue;
                }
            };
            let rate_hz = audio.spec().rate();
            if rate_hz != self.sample_rate_hz {
                let from_hz = self.sample_rate_hz;
                let to_hz = rate_hz;
                return Err(SourceFault::RateChange { from_hz, to_hz }.of(&self.name));
            }
            let channels = audio.spec().channels().count().max(1);
            audio.copy_to_vec_interleaved(&mut self.interleaved);
            self.skipped_in_a_row = 0;
            if self.interleaved.is_empty() {
                continue;
            }
            let lost = self.lost_before(packet.pts.get());
            block.resize(block.len() + lost, 0.0);
            self.decoded += 1;
            let share = 1.0 / channels as f32;
            let frames = self.interleaved.chunks_exact(channels);
            block.extend(frames.map(|frame| frame.iter().sum::<f32>() * share));
            self.delivered += block.len() as u64;
            return Ok(true);
        }
        Ok(false)
    }

    /// Samples missing before the packet with this time stamp.
    fn lost_before(&mut self, ticks: i64) -> usize {
        let Some(tick_s) = self.tick_s else { return 0 };
        let rate_hz = f64::from(self.sample_rate_hz);
        let now_s = ticks as f64 * tick_s;
        let origin_s = *self.origin_s.get_or_insert(now_s);
        let gap_s = now_s - origin_s - self.delivered as f64 / rate_hz;
        if !GAP_S.contains(&gap_s) {
            return 0;
        }
        if self.skipped == self.skipped_before {
            // The container itself lacks the packet.
            self.skipped += 1;
        }
        self.skipped_before = self.skipped;
        (gap_s * rate_hz).round() as usize
    }

    fn skip(&mut self, fault: &Fault) {
        self.fault = Some(fault.to_string());
        self.skipped += 1;
        self.skipped_in_a_row += 1;
    }

    /// Continues with the next part of a joined stream: a new decoder.
    fn restart(&mut self) -> Result<(), SourceError> {
        let track = audio_track(&self.name, &*self.format)?;
        self.decoder = decoder_for(&self.name, track)?;
        self.track = track.id;
        Ok(())
    }

    /// The error of a file that ended after `seconds` too short or silent.
    fn verdict(self, seconds: f64) -> SourceError {
        let fault = if self.decoded == 0 {
            SourceFault::Corrupt(self.fault.unwrap_or_else(|| "it holds no sound".to_owned()))
        } else if seconds < SHORTEST_S {
            SourceFault::TooShort(seconds)
        } else {
            SourceFault::Silent
        };
        fault.of(&self.name)
    }
}

fn audio_track<'a>(name: &str, format: &'a dyn FormatReader) -> Result<&'a Track, SourceError> {
    let track = format.default_track(TrackType::Audio);
    track.ok_or_else(|| SourceFault::NotAudio.of(name))
}

fn decoder_for(name: &str, track: &Track) -> Result<Box<dyn AudioDecoder>, SourceError> {
    let unsupported = |detail: String| SourceFault::UnsupportedCodec(detail).of(name);
    let params = track.codec_params.as_ref().and_then(|p| p.audio());
    let params = params.ok_or_else(|| unsupported("unknown codec".to_owned()))?;
    symphonia::default::get_codecs()
        .make_audio_decoder(params, &AudioDecoderOptions::default())
        .map_err(|fault| unsupported(fault.to_string()))
}

fn not_probed(name: &str, fault: Fault) -> SourceError {
    let mut magic = [0u8; 4];
    let known = File::open(name)
        .and_then(|mut file| file.read_exact(&mut magic))
        .is_ok_and(|()| MAGICS.contains(&&magic));
    let fault = match fault {
        Fault::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => {
            SourceFault::Unreadable(error)
        }
        Fault::DecodeError(detail) => SourceFault::Corrupt(detail.to_owned()),
        _ if known => SourceFault::Corrupt("no sound can be found in it".to_owned()),
        _ => SourceFault::NotAudio,
    };
    fault.of(name)
}
