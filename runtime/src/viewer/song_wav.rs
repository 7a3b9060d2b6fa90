//! The music of a dance as a WAV file for the page: mono, 16 bit, at its own rate, decoded
//! as the dance hears it, so that both agree to the sample.

use crate::pipeline::audio_input::{AudioChoice, AudioInput};
use crate::process::speed::Speed;
use anyhow::{Context, bail};
use std::io::Cursor;

/// Longer music than this is not held in memory twice, seconds.
const LONGEST_S: f64 = 900.0;

/// Decodes the music. Fails where it cannot be read, or is too long.
pub fn song_wav(choice: &AudioChoice) -> anyhow::Result<Vec<u8>> {
    let mut input = AudioInput::open(choice, Speed::Max)?;
    let rate = input.sample_rate_hz();
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: rate,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec)?;
    let mut block = Vec::new();
    while input.next_block(&mut block)? {
        if f64::from(writer.duration()) > LONGEST_S * f64::from(rate) {
            bail!("the music is longer than {LONGEST_S} s");
        }
        for sample in &block {
            let level = sample.clamp(-1.0, 1.0) * f32::from(i16::MAX);
            writer.write_sample(level as i16)?;
        }
    }
    writer.finalize().context("cannot write WAV")?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_audio::song::Song;

    #[test]
    fn the_page_gets_every_sample_of_the_song() {
        let wav = song_wav(&AudioChoice::BuiltIn).unwrap();
        let mut reader = hound::WavReader::new(Cursor::new(wav)).unwrap();
        let song = Song::demo();
        assert_eq!(reader.spec().sample_rate, song.sample_rate_hz);
        let samples: Vec<i16> = reader.samples().map(Result::unwrap).collect();
        assert_eq!(samples.len(), song.samples.len());
        let worst = samples.iter().zip(&song.samples).map(|(read, sample)| {
            (f32::from(*read) / f32::from(i16::MAX) - sample.clamp(-1.0, 1.0)).abs()
        });
        assert!(worst.fold(0.0, f32::max) < 1e-4);
    }
}
