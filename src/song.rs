//! The built-in song as a file, for people who want to listen to it.

use crate::output::PendingFile;
use anyhow::Context;
use servodance_audio::song::Song;
use std::path::Path;

/// Writes the built-in song as a 16-bit mono WAV file, whole or not at all.
pub fn write_demo(path: &Path) -> anyhow::Result<()> {
    let song = Song::demo();
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: song.sample_rate_hz,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let pending = PendingFile::create(path)?;
    let file = pending.writer()?;
    let write = || -> Result<(), hound::Error> {
        let mut writer = hound::WavWriter::new(file, spec)?;
        for sample in &song.samples {
            writer.write_sample((sample * f32::from(i16::MAX)) as i16)?;
        }
        writer.finalize()
    };
    write().with_context(|| format!("cannot write {}", path.display()))?;
    pending.finish()
}
