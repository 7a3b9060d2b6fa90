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

use super::{AUDIBLE, SHORTEST_S, SourceError};

/// How the known kinds of file begin.
const MAGICS: [&[u8; 4]; 3] = [b"RIFF", b"fLaC", b"OggS"];

/// After so many broken packets in a row the rest is given up.
const PATIENCE: u64 = 1000;

/// Time missing between two packets: shorter is rounding, longer is a new
/// beginning rather than a loss.
const GAP_S: std::ops::Range<f64> = 0.005..30.0;

/// Decodes one track of a file. What was lost is replaced by silence, so that
/// everything after it stays in time.
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
    /// Samples delivered, replaced ones included.
    delivered: u64,
    decoded: u64,
    skipped: u64,
    /// What `skipped` was at the last gap.
    skipped_before: u64,
    skipped_in_a_row: u64,
    fault: Option<String>,
}

/// Reads a file until it has proved long enough and audible.
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
            false => return Err(reader.verdict(seconds, audible)),
        }
    }
}

impl FileReader {
    pub(super) fn open(path: &Path) -> Result<Self, SourceError> {
        let name = path.display().to_string();
        let unreadable = |error| SourceError::io(&name, error);
        let file = File::open(path).map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        if metadata.is_dir() {
            let error = std::io::Error::other("it is a folder");
            return Err(SourceError::Unreadable { name, error });
        }
        if metadata.is_file() && metadata.len() == 0 {
            return Err(SourceError::Empty { name });
        }
        let stream = MediaSourceStream::new(Box::new(file), MediaSourceStreamOptions::default());
        let format = symphonia::default::get_probe()
            .probe(
                &Hint::new(),
                stream,
                FormatOptions::default(),
                MetadataOptions::default(),
            )
            .map_err(|fault| not_probed(&name, fault))?;
        Self::on_format(name, format)
    }

    fn on_format(name: String, format: Box<dyn FormatReader>) -> Result<Self, SourceError> {
        let corrupt = |detail: &str| SourceError::Corrupt {
            name: name.clone(),
            detail: detail.to_owned(),
        };
        let track = format
            .default_track(TrackType::Audio)
            .ok_or_else(|| SourceError::NotAudio { name: name.clone() })?;
        let decoder = decoder_for(&name, track)?;
        let sample_rate_hz = decoder
            .codec_params()
            .sample_rate
            .filter(|rate| *rate > 0)
            .ok_or_else(|| corrupt("it does not say its sample rate"))?;
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

    /// Appends the next packet that can be decoded; `false` at the end.
    pub(super) fn next_block(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        while self.skipped_in_a_row < PATIENCE {
            let packet = match self.format.next_packet() {
                Ok(Some(packet)) if packet.track_id == self.track => packet,
                Ok(Some(_)) => continue,
                Ok(None) => return Ok(false),
                Err(Fault::ResetRequired) => {
                    self.next_chapter()?;
                    continue;
                }
                // A file that was cut short ends here.
                Err(Fault::IoError(error)) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
                    self.fault = Some("it was cut short".to_owned());
                    return Ok(false);
                }
                Err(Fault::IoError(error)) => return Err(SourceError::io(&self.name, error)),
                Err(fault) => {
                    self.fault = Some(fault.to_string());
                    self.skip();
                    continue;
                }
            };
            let audio = match self.decoder.decode(&packet) {
                Ok(audio) => audio,
                Err(fault) => {
                    self.fault = Some(fault.to_string());
                    self.skip();
                    continue;
                }
            };
            let rate_hz = audio.spec().rate();
            if rate_hz != self.sample_rate_hz {
                return Err(SourceError::RateChange {
                    name: self.name.clone(),
                    from_hz: self.sample_rate_hz,
                    to_hz: rate_hz,
                });
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

    /// How many samples are missing before the packet with this time stamp.
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
            // The container left it out itself.
            self.skipped += 1;
        }
        self.skipped_before = self.skipped;
        (gap_s * rate_hz).round() as usize
    }

    fn skip(&mut self) {
        self.skipped += 1;
        self.skipped_in_a_row += 1;
    }

    /// A joined stream begins anew: a new decoder for its track.
    fn next_chapter(&mut self) -> Result<(), SourceError> {
        let track = self.format.default_track(TrackType::Audio);
        let track = track.ok_or_else(|| SourceError::NotAudio {
            name: self.name.clone(),
        })?;
        self.decoder = decoder_for(&self.name, track)?;
        self.track = track.id;
        Ok(())
    }

    /// What is wrong with a file that ended after `seconds`, if anything.
    fn verdict(self, seconds: f64, audible: bool) -> SourceError {
        let name = self.name;
        if self.decoded == 0 {
            let detail = self.fault.unwrap_or_else(|| "it holds no sound".to_owned());
            SourceError::Corrupt { name, detail }
        } else if seconds < SHORTEST_S {
            SourceError::TooShort { name, seconds }
        } else {
            debug_assert!(!audible);
            SourceError::Silent { name }
        }
    }
}

fn decoder_for(name: &str, track: &Track) -> Result<Box<dyn AudioDecoder>, SourceError> {
    let unsupported = |detail: String| SourceError::UnsupportedCodec {
        name: name.to_owned(),
        detail,
    };
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
    let name = name.to_owned();
    match fault {
        Fault::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => {
            SourceError::Unreadable { name, error }
        }
        Fault::DecodeError(detail) => SourceError::Corrupt {
            name,
            detail: detail.to_owned(),
        },
        _ if known => SourceError::Corrupt {
            name,
            detail: "no sound can be found in it".to_owned(),
        },
        _ => SourceError::NotAudio { name },
    }
}
