//! The music of a dance as a WAV file for the page: mono, 16 bit, at its own rate, decoded
//! as the dance hears it, so that both agree to the sample.

use crate::pipeline::audio_input::AudioChoice;
use crate::pipeline::song_sound::song_sound;
use anyhow::Context;
use std::io::Cursor;

/// Decodes the music. Fails where it cannot be read, or is too long.
pub fn song_wav(choice: &AudioChoice) -> anyhow::Result<Vec<u8>> {
    let sound = song_sound(choice)?;
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: sound.rate_hz,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec)?;
    for sample in sound.samples.iter() {
        writer.write_sample(*sample)?;
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
