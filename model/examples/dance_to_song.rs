//! A song to motion: `cargo run -p servodance-model --example dance_to_song -- [SONG.wav] [OUT.npz]`
//!
//! Without a file eight seconds of music are rendered. Prints what was danced;
//! with a second argument the motion is written as 22 joint positions a frame.

use servodance_audio::{AudioSource, MusicAnalyzer, song::SongSpec};
use servodance_model::motion::{Clip, mean_joint_speed};
use servodance_model::{Generator, GeneratorOptions};
use servodance_types::{FRAME_RATE_HZ, MusicFrame};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let music = features(args.next().as_deref())?;
    let generator = Generator::built_in()?;
    let mut dance = generator.start(GeneratorOptions { seed: 1, ..GeneratorOptions::default() })?;
    let mut poses = Vec::with_capacity(music.len());
    for frame in &music {
        poses.push(dance.step(frame)?.positions);
    }
    let clip = Clip { name: generator.default_style().to_owned(), fps: FRAME_RATE_HZ, poses };
    let tempo_bpm = music.last().map_or(0.0, |frame| frame.beat.tempo_bpm);
    println!(
        "{} frames of `{}` to {tempo_bpm:.0} beats a minute, {:.2} m/s on average",
        clip.poses.len(),
        clip.name,
        mean(&mean_joint_speed(&clip.poses, clip.fps)),
    );
    if let Some(path) = args.next() {
        clip.write_npz(&path)?;
    }
    Ok(())
}

/// The features of a recording, or of rendered music.
fn features(path: Option<&str>) -> Result<Vec<MusicFrame>, Box<dyn std::error::Error>> {
    let mut music = Vec::new();
    let Some(path) = path else {
        let song = SongSpec::random(8.0, 1)?.render()?;
        let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz)?;
        analyzer.push(&song.samples);
        music.extend(std::iter::from_fn(|| analyzer.pop()));
        return Ok(music);
    };
    let mut source = AudioSource::open(path)?;
    let mut analyzer = MusicAnalyzer::new(source.sample_rate_hz())?;
    let mut block = Vec::new();
    while source.next_block(&mut block)? {
        analyzer.push(&block);
        music.extend(std::iter::from_fn(|| analyzer.pop()));
    }
    Ok(music)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
