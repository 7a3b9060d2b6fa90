//! Sources are tried on files written here: wav by hound, flac by hand.

use std::f32::consts::TAU;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::*;

fn tone(rate_hz: u32, seconds: f64) -> Vec<f32> {
    let count = (seconds * f64::from(rate_hz)) as usize;
    (0..count).map(|i| 0.5 * (TAU * 440.0 * i as f32 / rate_hz as f32).sin()).collect()
}

fn wav(folder: &TempDir, name: &str, rate_hz: u32, channels: u16, samples: &[f32]) -> PathBuf {
    let path = folder.path().join(name);
    let spec = hound::WavSpec {
        channels,
        sample_rate: rate_hz,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(&path, spec).unwrap();
    for sample in samples {
        for channel in 0..channels {
            // The first channel carries everything, the others nothing.
            let value = if channel == 0 { *sample } else { 0.0 };
            writer.write_sample((value * 32_767.0) as i16).unwrap();
        }
    }
    writer.finalize().unwrap();
    path
}

fn read_all(source: &mut AudioSource) -> Result<Vec<f32>, SourceError> {
    let (mut all, mut block) = (Vec::new(), Vec::new());
    while source.next_block(&mut block)? {
        assert!(!block.is_empty() && block.len() < 100_000);
        all.extend_from_slice(&block);
    }
    Ok(all)
}

fn refusal(path: &Path) -> String {
    let message = AudioSource::open(path).err().map(|e| e.to_string());
    let message = message.expect("must be refused");
    assert!(message.contains(&path.display().to_string()) && !message.contains('\n'));
    message.replace(&path.display().to_string(), "FILE")
}

#[test]
fn wav_of_any_rate_and_channel_count_becomes_mono() {
    let folder = TempDir::new().unwrap();
    for (rate_hz, channels) in [(8_000, 1), (22_050, 2), (44_100, 1), (48_000, 6)] {
        let samples = tone(rate_hz, 0.7);
        let path = wav(&folder, "tone.wav", rate_hz, channels, &samples);
        let mut source = AudioSource::open(&path).unwrap();
        assert_eq!(source.sample_rate_hz(), rate_hz);
        assert!((source.duration_s().unwrap() - 0.7).abs() < 1e-3);
        let heard = read_all(&mut source).unwrap();
        assert_eq!(heard.len(), samples.len());
        let share = 1.0 / f32::from(channels);
        for (h, s) in heard.iter().zip(&samples) {
            assert!((h - s * share).abs() < 1e-3);
        }
        assert!((source.position_s() - 0.7).abs() < 1e-3);
    }
}

#[test]
fn name_does_not_matter_but_content_does() {
    let folder = TempDir::new().unwrap();
    let path = wav(&folder, "really_a_wav.mp3", 16_000, 1, &tone(16_000, 1.0));
    assert!(AudioSource::open(&path).is_ok());
    let text = folder.path().join("text.mp3");
    fs::write(&text, "This is a letter, not a song.\n".repeat(500)).unwrap();
    assert_eq!(
        refusal(&text),
        "FILE: is not an audio file (wav, flac, mp3 and ogg/vorbis can be read)"
    );
}

#[test]
fn each_fault_has_its_own_line() {
    let folder = TempDir::new().unwrap();
    let missing = folder.path().join("missing.ogg");
    assert_eq!(refusal(&missing), "FILE: no such file");
    let empty = folder.path().join("empty.wav");
    fs::write(&empty, b"").unwrap();
    assert_eq!(refusal(&empty), "FILE: is empty");
    assert!(refusal(folder.path()).starts_with("FILE: cannot be read: "));
    let short = wav(&folder, "short.wav", 16_000, 1, &tone(16_000, 0.1));
    assert_eq!(refusal(&short), "FILE: lasts 0.10 s; at least 0.5 s are needed");
    let silent = wav(&folder, "silent.wav", 16_000, 1, &[0.0; 32_000]);
    assert_eq!(refusal(&silent), "FILE: is silent from beginning to end");
    let header_only = wav(&folder, "header.wav", 16_000, 1, &[]);
    assert_eq!(refusal(&header_only), "FILE: is corrupt: it holds no sound");
}

#[test]
fn a_recording_that_is_cut_short_is_told() {
    let folder = TempDir::new().unwrap();
    let whole = wav(&folder, "whole.wav", 16_000, 1, &tone(16_000, 4.0));
    let mut source = AudioSource::open(&whole).unwrap();
    read_all(&mut source).unwrap();
    assert_eq!(source.damage(), None);
    let mut bytes = fs::read(&whole).unwrap();
    bytes.truncate(bytes.len() / 2);
    fs::write(&whole, &bytes).unwrap();
    let mut source = AudioSource::open(&whole).unwrap();
    read_all(&mut source).unwrap();
    let told = source.damage().unwrap();
    assert!(told.contains("whole.wav: cut short: 2.0 of 4.0 s"), "{told}");
    // A program that writes as it goes does not know the length.
    let at = bytes.windows(4).position(|four| four == b"data").unwrap() + 4;
    bytes[at..at + 4].fill(0xff);
    bytes[4..8].fill(0xff);
    fs::write(&whole, &bytes).unwrap();
    let mut source = AudioSource::open(&whole).unwrap();
    read_all(&mut source).unwrap();
    assert_eq!(source.damage(), None);
}

#[test]
fn broken_flac_packet_is_skipped_and_counted() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("song.flac");
    let samples = tone(16_000, 2.0);
    let (mut bytes, frames) = flac::encode(16_000, &samples);
    fs::write(&path, &bytes).unwrap();
    let mut source = AudioSource::open(&path).unwrap();
    let heard = read_all(&mut source).unwrap();
    assert_eq!((heard.len(), source.skipped_packets()), (32_000, 0));

    // Break the code of a subframe: the packet cannot be decoded.
    bytes[frames[4] + 6] ^= 0x7e;
    fs::write(&path, &bytes).unwrap();
    let mut source = AudioSource::open(&path).unwrap();
    let heard = read_all(&mut source).unwrap();
    assert_eq!((heard.len(), source.skipped_packets()), (32_000, 1));
    let told = source.damage().unwrap();
    assert!(told.ends_with("song.flac: 1 broken packets left out"), "{told}");
    // What was lost is silent, and what follows is in time.
    assert_eq!(heard[4 * flac::BLOCK + 10], 0.0);
    let late = &heard[6 * flac::BLOCK..];
    assert!(late.iter().zip(&samples[6 * flac::BLOCK..]).all(|(h, s)| (h - s).abs() < 1e-3));
}

#[test]
fn file_with_nothing_decodable_is_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("noise.flac");
    let (mut bytes, frames) = flac::encode(16_000, &tone(16_000, 1.0));
    for byte in &mut bytes[frames[0]..] {
        *byte = 0x55;
    }
    fs::write(&path, &bytes).unwrap();
    let message = refusal(&path);
    assert!(message.starts_with("FILE: is corrupt: "), "{message}");
}

#[test]
fn cut_file_plays_to_the_cut() {
    let folder = TempDir::new().unwrap();
    let path = wav(&folder, "cut.wav", 16_000, 1, &tone(16_000, 2.0));
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let heard = read_all(&mut AudioSource::open(&path).unwrap()).unwrap();
    assert!((15_000..17_000).contains(&heard.len()), "{}", heard.len());
}

#[test]
fn raw_samples_of_all_encodings_are_read() {
    let value = 0.5f32;
    let cases: [(PcmEncoding, Vec<u8>); 5] = [
        (PcmEncoding::U8, vec![192]),
        (PcmEncoding::S16Le, 16_384i16.to_le_bytes().to_vec()),
        (PcmEncoding::S24Le, vec![0, 0, 0x40]),
        (PcmEncoding::S32Le, (1i32 << 30).to_le_bytes().to_vec()),
        (PcmEncoding::F32Le, value.to_le_bytes().to_vec()),
    ];
    for (encoding, bytes) in cases {
        assert_eq!(encoding.to_string().parse(), Ok(encoding));
        let format = PcmFormat { encoding, sample_rate_hz: 8_000, channels: 2 };
        let frames = bytes.repeat(2 * 5_000);
        let mut source = AudioSource::from_reader("input", Cursor::new(frames), format).unwrap();
        assert_eq!(read_all(&mut source).unwrap(), vec![value; 5_000]);
    }
    assert_eq!(
        "s17".parse::<PcmEncoding>().unwrap_err().to_string(),
        "unknown sample format \"s17\"; known are u8, s16le, s24le, s32le, f32le"
    );
}

#[test]
fn raw_input_may_come_in_odd_pieces() {
    struct OneByte(Cursor<Vec<u8>>);
    impl Read for OneByte {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            self.0.read(&mut out[..1])
        }
    }
    let bytes: Vec<u8> = (0..8_000i16).flat_map(i16::to_le_bytes).collect();
    let format = PcmFormat { encoding: PcmEncoding::S16Le, sample_rate_hz: 16_000, channels: 1 };
    let reader = OneByte(Cursor::new(bytes));
    let mut source = AudioSource::from_reader("input", reader, format).unwrap();
    let heard = read_all(&mut source).unwrap();
    assert_eq!(heard.len(), 8_000);
    assert_eq!(heard[4_096], 4_096.0 / 32_768.0);
}

#[test]
fn raw_input_that_is_no_music_is_refused() {
    let format = |channels, sample_rate_hz| PcmFormat {
        encoding: PcmEncoding::S16Le,
        sample_rate_hz,
        channels,
    };
    let open =
        |bytes: Vec<u8>, f| AudioSource::from_reader("standard input", Cursor::new(bytes), f);
    let message = |r: Result<_, SourceError>| r.err().map(|e| e.to_string()).unwrap_or_default();
    let empty = open(vec![], format(1, 16_000)).and_then(|mut s| read_all(&mut s));
    assert_eq!(message(empty), "standard input: is empty");
    let short = open(vec![1; 3_200], format(1, 16_000)).and_then(|mut s| read_all(&mut s));
    assert_eq!(message(short), "standard input: lasts 0.10 s; at least 0.5 s are needed");
    let odd = open(vec![], format(0, 16_000)).map(|_| Vec::<f32>::new());
    assert!(message(odd).contains("not 0 at 16000 Hz"));
}

#[test]
fn live_sound_that_has_not_begun_holds_nobody_up() {
    let (pipe, _writer) = std::io::pipe().unwrap();
    let format = PcmFormat { encoding: PcmEncoding::S16Le, sample_rate_hz: 16_000, channels: 1 };
    let mut source = AudioSource::live_reader("input", pipe, format).unwrap();
    let mut block = vec![1.0];
    assert!(source.next_block(&mut block).unwrap(), "it is not over");
    assert_eq!(block, []);
}

/// The least of FLAC: mono, 16 bits, verbatim subframes (RFC 9639).
mod flac {
    pub(super) const BLOCK: usize = 1024;

    /// The file, and where each frame begins in it.
    pub(super) fn encode(rate_hz: u32, samples: &[f32]) -> (Vec<u8>, Vec<usize>) {
        let mut out = b"fLaC".to_vec();
        out.extend([0x80, 0, 0, 34]); // STREAMINFO, the last metadata block
        out.extend((BLOCK as u16).to_be_bytes());
        out.extend((BLOCK as u16).to_be_bytes());
        out.extend([0; 6]); // frame sizes unknown
        let info = (u64::from(rate_hz) << 44) | (15 << 36) | samples.len() as u64;
        out.extend(info.to_be_bytes());
        out.extend([0; 16]); // no checksum of the samples
        let mut starts = Vec::new();
        for (number, block) in samples.chunks(BLOCK).enumerate() {
            starts.push(out.len());
            let frame = frame(number as u8, block);
            out.extend(frame);
        }
        (out, starts)
    }

    fn frame(number: u8, block: &[f32]) -> Vec<u8> {
        assert!(number < 128);
        // Fixed block size; 16-bit block size at the end; mono of 16 bits.
        let mut out = vec![0xff, 0xf8, 0x70, 0x08, number];
        out.extend((block.len() as u16 - 1).to_be_bytes());
        out.push(crc(&out, 0x07, 8) as u8);
        out.push(0x02); // verbatim subframe
        for sample in block {
            out.extend(((sample * 32_767.0) as i16).to_be_bytes());
        }
        let sum = crc(&out, 0x8005, 16) as u16;
        out.extend(sum.to_be_bytes());
        out
    }

    fn crc(bytes: &[u8], polynomial: u32, bits: u32) -> u32 {
        let top = 1 << (bits - 1);
        let mask = (1u32 << bits) - 1;
        let mut register = 0u32;
        for &byte in bytes {
            register ^= u32::from(byte) << (bits - 8);
            for _ in 0..8 {
                let carry = register & top != 0;
                register = (register << 1) & mask;
                if carry {
                    register ^= polynomial;
                }
            }
        }
        register
    }
}
