//! A whole song in memory, decoded as the dance hears it, so that both agree to the sample.

use super::audio_input::{AudioChoice, AudioInput};
use crate::process::speed::Speed;
use anyhow::bail;
use servodance_audio::playback::Sound;

/// Longer music than this is not held in memory, seconds.
const LONGEST_S: f64 = 900.0;

/// Decodes the song. Fails where it cannot be read, or is too long.
pub fn song_sound(song: &AudioChoice) -> anyhow::Result<Sound> {
    let mut input = AudioInput::open(song, Speed::Max)?;
    let rate_hz = input.sample_rate_hz();
    let (mut samples, mut block) = (Vec::new(), Vec::new());
    while input.next_block(&mut block)? {
        if samples.len() as f64 > LONGEST_S * f64::from(rate_hz) {
            bail!("the music is longer than {LONGEST_S} s");
        }
        samples.extend(block.iter().copied().map(Sound::level));
    }
    Ok(Sound { samples: samples.into(), rate_hz })
}
