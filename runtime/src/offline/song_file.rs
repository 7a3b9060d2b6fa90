//! Songs that this program renders, as WAV files.

use crate::telemetry::pending_file::PendingFile;
use anyhow::Context;
use servodance_audio::song::Song;
use std::path::Path;

/// Writes the built-in song as a 16-bit mono WAV file, whole or not at all.
pub fn write_demo(path: &Path) -> anyhow::Result<()> {
    write_demo_for(path, 0.0)
}

/// Writes the song repeated until it lasts `seconds`; once at least.
pub fn write_demo_for(path: &Path, seconds: f64) -> anyhow::Result<()> {
    write_song(path, &Song::demo(), seconds)
}

/// The same for any song.
pub fn write_song(path: &Path, song: &Song, seconds: f64) -> anyhow::Result<()> {
    let times = (seconds / song.duration_s()).ceil().max(1.0) as usize;
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
        for _ in 0..times {
            for sample in &song.samples {
                writer.write_sample((sample * f32::from(i16::MAX)) as i16)?;
            }
        }
        writer.finalize()
    };
    write().with_context(|| format!("cannot write {}", path.display()))?;
    pending.finish()
}
