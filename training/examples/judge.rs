//! Judges weights: dances to held-out music, scored on the beat against controls.
//!
//! `cargo run --release -p servodance-training --example judge -- WEIGHTS DATASET
//! [--temperature 0.9] [--top-p 0.95] [--guidance 1.5] [--style NAME] [--clips 16] [--seed 1]`
//!
//! `--style each` scores every style by itself on all clips. Controls: the same
//! motion against the beats of another song and against its own beats moved by
//! half a beat; and the dance to silence against the beats it did not hear.
//! `DATASET` is a training file with validation music. All other figures, and
//! long dances, are those of `servodance evaluate`.

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;

use servodance_model::motion::{Alignment, Pose, alignment, decode, mean_joint_speed};
use servodance_model::{Generator, GeneratorOptions};
use servodance_training::dataset::{Split, training_file};
use servodance_types::{Beat, FRAME_RATE_HZ, MusicFrame, SPECTRAL_DIM};

type Failure = Box<dyn Error>;

/// One clip of the data set.
struct Held {
    poses: Vec<Pose>,
    music: Vec<MusicFrame>,
}

fn main() -> Result<(), Failure> {
    let mut plain = Vec::new();
    let mut named = HashMap::new();
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.strip_prefix("--") {
            Some(name) => {
                let value = args.next().ok_or(format!("--{name} needs a value"))?;
                named.insert(name.to_owned(), value);
            }
            None => plain.push(arg),
        }
    }
    let [weights, data] = &plain[..] else {
        return Err("usage: judge WEIGHTS DATASET [--temperature 0.9] ...".into());
    };
    let number = |name: &str, default: f64| -> Result<f64, Failure> {
        Ok(named.get(name).map_or(Ok(default), |text| text.parse())?)
    };
    let mut options = GeneratorOptions {
        seed: number("seed", 1.0)? as u64,
        style: named.get("style").cloned(),
        temperature: number("temperature", 0.9)? as f32,
        top_p: number("top-p", 0.95)? as f32,
        guidance: number("guidance", 1.5)? as f32,
        ..GeneratorOptions::default()
    };
    let generator = Generator::load(Path::new(weights))?;
    let held = held_out(Path::new(data), number("clips", 16.0)? as usize)?;
    println!("{options:?}, {} clips", held.len());
    if options.style.as_deref() != Some("each") {
        return judge(&generator, &options, &held);
    }
    for style in generator.styles() {
        options.style = Some(style.clone());
        println!("-- {style}");
        judge(&generator, &options, &held)?;
    }
    Ok(())
}

fn judge(generator: &Generator, options: &GeneratorOptions, held: &[Held]) -> Result<(), Failure> {
    let mut scores: Vec<(&str, Vec<Alignment>)> =
        ["real motion", "generated", "  wrong song", "  half a beat late", "  dance to silence"]
            .map(|name| (name, Vec::new()))
            .into();
    for (i, clip) in held.iter().enumerate() {
        let mut options = options.clone();
        options.seed += i as u64;
        let beats = beats_s(&clip.music);
        let wrong = beats_s(&held[(i + held.len() / 2) % held.len()].music);
        let half: Vec<f64> = beats.windows(2).map(|b| (b[0] + b[1]) / 2.0).collect();
        let silence: Vec<MusicFrame> = clip.music.iter().map(silent).collect();
        let danced = dance(generator, &options, &clip.music)?;
        let unheard = dance(generator, &options, &silence)?;
        let [real, speed, deaf] =
            [&clip.poses, &danced, &unheard].map(|poses| mean_joint_speed(poses, FRAME_RATE_HZ));
        for (row, (speed, beats)) in scores.iter_mut().zip([
            (&real, &beats),
            (&speed, &beats),
            (&speed, &wrong),
            (&speed, &half),
            (&deaf, &beats),
        ]) {
            row.1.push(alignment(speed, FRAME_RATE_HZ, beats));
        }
    }
    for (name, all) in scores {
        let mean = |f: fn(&Alignment) -> f64| all.iter().map(f).sum::<f64>() / all.len() as f64;
        println!(
            "{name:20} fact {:.3}  bailando {:.3}  f1 {:.3}",
            mean(|a| a.fact),
            mean(|a| a.bailando),
            mean(|a| a.f1)
        );
    }
    Ok(())
}

fn dance(
    generator: &Generator,
    options: &GeneratorOptions,
    music: &[MusicFrame],
) -> Result<Vec<Pose>, Failure> {
    let mut dance = generator.start(options.clone())?;
    let poses = music.iter().map(|heard| Ok(dance.step(heard)?.positions));
    poses.collect()
}

/// The same moment without a sound: the features of digital silence (the first
/// cepstral coefficient is the level, at its lowest).
fn silent(frame: &MusicFrame) -> MusicFrame {
    let mut spectral = [0.0; SPECTRAL_DIM];
    spectral[1] = -2.0;
    MusicFrame { spectral, beat: Beat::default(), presence: 0.0, ..*frame }
}

/// The moments at which the tracked phase passes zero, seconds.
fn beats_s(music: &[MusicFrame]) -> Vec<f64> {
    let sure = |pair: &&[MusicFrame]| pair.iter().all(|heard| heard.beat.confidence > 0.5);
    let passes = music.windows(2).filter(sure).filter_map(|pair| {
        let [a, b] = [0, 1].map(|k| f64::from(pair[k].beat.phase));
        (a > 0.5 && b < 0.5)
            .then(|| pair[0].time_s + (1.0 - a) / (1.0 - a + b).max(1e-6) / FRAME_RATE_HZ)
    });
    passes.collect()
}

/// Validation clips with music, spread over the file.
fn held_out(path: &Path, count: usize) -> Result<Vec<Held>, Failure> {
    let mut clips = training_file::read(path)?;
    clips.retain(|c| c.split == Split::Validation && c.music.is_some() && c.motion.len() > 200);
    let step = (clips.len() / count.max(1)).max(1);
    let held = clips.iter().step_by(step).take(count).map(|clip| {
        let frame = |(i, v)| MusicFrame::from_vector(v, i as f64 / FRAME_RATE_HZ);
        let music = clip.music.iter().flatten();
        Held { poses: decode(&clip.motion), music: music.enumerate().map(frame).collect() }
    });
    Ok(held.collect())
}
