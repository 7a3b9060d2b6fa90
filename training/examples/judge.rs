//! Judges weights: dances to held-out music, scored on the beat against
//! controls, then one long dance.
//!
//! `cargo run --release -p servodance-model --example judge -- WEIGHTS DATASET
//! [--temperature 0.9] [--top-p 0.95] [--guidance 1.5] [--style NAME] [--clips 16]
//! [--minutes 5] [--seed 1] [--out FOLDER]`
//!
//! `--style each` scores every style by itself on all clips.
//!
//! Controls: the same motion against the beats of another song and against
//! its own beats moved by half a beat; and the dance to silence against the
//! beats it did not hear. `DATASET` is a file with music (model/MODEL_CARD.md).

use std::collections::HashMap;
use std::error::Error;
use std::f32::consts::TAU;
use std::path::Path;
use std::time::Instant;

use safetensors::SafeTensors;
use servodance_model::motion::{Alignment, alignment, mean_joint_speed};
use servodance_model::motion::{Clip, PoseVector, decode};
use servodance_model::{Generator, GeneratorOptions};
use servodance_types::{Beat, FRAME_RATE_HZ, MUSIC_DIM, MotionFrame, MusicFrame, SPECTRAL_DIM};

type Failure = Box<dyn Error>;

/// One clip of the data set.
struct Held {
    motion: Vec<PoseVector>,
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
    let bytes = std::fs::read(data)?;
    let held = held_out(
        &SafeTensors::deserialize(&bytes)?,
        number("clips", 16.0)? as usize,
    )?;
    println!("{options:?}, {} clips", held.len());
    if options.style.as_deref() == Some("each") {
        for style in generator.styles() {
            options.style = Some(style.clone());
            println!("-- {style}");
            judge_clips(&generator, &options, &held)?;
        }
        return Ok(());
    }
    judge_clips(&generator, &options, &held)?;
    let minutes = number("minutes", 5.0)?;
    judge_length(&generator, &options, &held, minutes, named.get("out"))
}

fn judge_clips(
    generator: &Generator,
    options: &GeneratorOptions,
    held: &[Held],
) -> Result<(), Failure> {
    let mut scores: Vec<(&str, Vec<Alignment>)> = [
        "real motion",
        "generated",
        "  wrong song",
        "  half a beat late",
        "  dance to silence",
    ]
    .map(|name| (name, Vec::new()))
    .into();
    for (i, clip) in held.iter().enumerate() {
        let mut options = options.clone();
        options.seed += i as u64;
        let beats = beats_s(&clip.music);
        let wrong = beats_s(&held[(i + held.len() / 2) % held.len()].music);
        let half = beats
            .windows(2)
            .map(|b| (b[0] + b[1]) / 2.0)
            .collect::<Vec<_>>();
        let danced = dance(generator, &options, &clip.music)?;
        let silence: Vec<MusicFrame> = clip.music.iter().map(silent).collect();
        let unheard = dance(generator, &options, &silence)?;
        let speed = mean_joint_speed(&poses(&danced), FRAME_RATE_HZ);
        let real = mean_joint_speed(&decode(&clip.motion), FRAME_RATE_HZ);
        let deaf = mean_joint_speed(&poses(&unheard), FRAME_RATE_HZ);
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

/// All held-out music in a row, over and over: does the dance freeze or drift?
fn judge_length(
    generator: &Generator,
    options: &GeneratorOptions,
    held: &[Held],
    minutes: f64,
    out: Option<&String>,
) -> Result<(), Failure> {
    let count = (minutes * 60.0 * FRAME_RATE_HZ) as usize;
    let music: Vec<MusicFrame> = held
        .iter()
        .flat_map(|clip| clip.music.iter().copied())
        .collect();
    let music: Vec<MusicFrame> = music.into_iter().cycle().take(count).collect();
    let mut dance = generator.start(options.clone())?;
    let mut ms = Vec::with_capacity(count);
    let mut frames = Vec::with_capacity(count);
    for heard in &music {
        let begin = Instant::now();
        frames.push(dance.step(heard)?);
        ms.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    println!("woken {} times", dance.restarts());
    ms.sort_by(f64::total_cmp);
    let at = |share: f64| ms[((ms.len() - 1) as f64 * share) as usize];
    println!(
        "a step takes {:.2} ms (p50), {:.2} ms (p99)",
        at(0.5),
        at(0.99)
    );
    let all = poses(&frames);
    let speed = mean_joint_speed(&all, FRAME_RATE_HZ);
    let per_piece = count.div_ceil(10).max(1);
    let pieces: Vec<String> = speed
        .chunks(per_piece)
        .map(|piece| format!("{:.2}", piece.iter().sum::<f64>() / piece.len() as f64))
        .collect();
    println!("mean joint speed by tenths, m/s: {}", pieces.join(" "));
    let still = speed.iter().filter(|v| **v < 0.05).count();
    let far = all
        .iter()
        .map(|p| p[0][0].hypot(p[0][2]))
        .fold(0.0, f32::max);
    println!(
        "frames below 0.05 m/s: {:.1} %; furthest from the start {far:.2} m",
        100.0 * still as f64 / speed.len() as f64
    );
    feet(&frames);
    if let Some(folder) = out {
        std::fs::create_dir_all(folder)?;
        let clip = Clip {
            name: "long".into(),
            fps: FRAME_RATE_HZ,
            poses: all,
        };
        clip.write_npz(Path::new(folder).join("long.npz"))?;
    }
    Ok(())
}

/// How far feet slide while the model says that they stand, and jerk.
fn feet(frames: &[MotionFrame]) {
    let (mut slid, mut stood, mut lowest) = (0.0, 0, 0.0f32);
    for pair in frames.windows(2) {
        for (down, ankle, toe) in [
            (|f: &MotionFrame| f.contacts.left, 7, 10),
            (|f: &MotionFrame| f.contacts.right, 8, 11),
        ] as [(fn(&MotionFrame) -> bool, usize, usize); 2]
        {
            if down(&pair[0]) && down(&pair[1]) {
                let moved = |j: usize| {
                    let (a, b) = (pair[0].positions[j], pair[1].positions[j]);
                    (b[0] - a[0]).hypot(b[2] - a[2])
                };
                slid += moved(ankle).min(moved(toe));
                stood += 1;
            }
        }
        lowest = pair[0]
            .positions
            .iter()
            .fold(lowest, |low, p| low.min(p[1]));
    }
    println!(
        "standing feet slide {:.1} mm a frame, stand in {:.0} % of frames; lowest joint {:.3} m",
        1e3 * slid / stood.max(1) as f32,
        50.0 * stood as f64 / frames.len() as f64,
        lowest
    );
    let jerks = frames.windows(4).flat_map(|w| {
        (0..22).map(move |j| {
            let squared = (0..3).map(|k| {
                let x = |i: usize| f64::from(w[i].positions[j][k]);
                (x(3) - 3.0 * x(2) + 3.0 * x(1) - x(0)).powi(2)
            });
            squared.sum::<f64>().sqrt() * FRAME_RATE_HZ.powi(3)
        })
    });
    let (sum, n) = jerks.fold((0.0, 0u64), |(s, n), j| (s + j, n + 1));
    println!("mean jerk {:.0} m/s^3", sum / n.max(1) as f64);
}

fn dance(
    generator: &Generator,
    options: &GeneratorOptions,
    music: &[MusicFrame],
) -> Result<Vec<MotionFrame>, Failure> {
    let mut dance = generator.start(options.clone())?;
    Ok(music
        .iter()
        .map(|heard| dance.step(heard))
        .collect::<Result<_, _>>()?)
}

fn poses(frames: &[MotionFrame]) -> Vec<servodance_model::motion::Pose> {
    frames.iter().map(|frame| frame.positions).collect()
}

/// The same moment without a sound: the features of digital silence (the first
/// cepstral coefficient is the level, at its lowest).
fn silent(frame: &MusicFrame) -> MusicFrame {
    let mut spectral = [0.0; SPECTRAL_DIM];
    spectral[1] = -2.0;
    MusicFrame {
        spectral,
        beat: Beat::default(),
        presence: 0.0,
        ..*frame
    }
}

/// The moments at which the tracked phase passes zero, seconds.
fn beats_s(music: &[MusicFrame]) -> Vec<f64> {
    let sure =
        |pair: &&[MusicFrame]| pair[0].beat.confidence > 0.5 && pair[1].beat.confidence > 0.5;
    let passes = music.windows(2).filter(sure).filter_map(|pair| {
        let (a, b) = (f64::from(pair[0].beat.phase), f64::from(pair[1].beat.phase));
        (a > 0.5 && b < 0.5)
            .then(|| pair[0].time_s + (1.0 - a) / (1.0 - a + b).max(1e-6) / FRAME_RATE_HZ)
    });
    passes.collect()
}

/// Validation clips with music, spread over the file.
fn held_out(file: &SafeTensors, count: usize) -> Result<Vec<Held>, Failure> {
    let integers = |name: &str| -> Result<Vec<usize>, Failure> {
        let view = file.tensor(name)?;
        let rows = view.data().as_chunks::<8>().0.iter();
        Ok(rows.map(|b| i64::from_le_bytes(*b) as usize).collect())
    };
    let floats = |name: &str| -> Result<Vec<f32>, Failure> {
        let view = file.tensor(name)?;
        let rows = view.data().as_chunks::<4>().0.iter();
        Ok(rows.map(|b| f32::from_le_bytes(*b)).collect())
    };
    let (motion, music) = (floats("motion")?, floats("music")?);
    let (starts, lengths) = (integers("clip_start")?, integers("clip_length")?);
    let (split, has_music) = (integers("split")?, integers("has_music")?);
    let all: Vec<usize> = (0..starts.len())
        .filter(|&c| split[c] == 1 && has_music[c] == 1 && lengths[c] > 200)
        .collect();
    let step = (all.len() / count.max(1)).max(1);
    let held = all.iter().step_by(step).take(count).map(|&c| {
        let rows = starts[c]..starts[c] + lengths[c];
        Held {
            motion: rows
                .clone()
                .map(|r| std::array::from_fn(|i| motion[137 * r + i]))
                .collect(),
            music: rows
                .clone()
                .map(|r| {
                    music_frame(
                        &music[MUSIC_DIM * r..],
                        (r - rows.start) as f64 / FRAME_RATE_HZ,
                    )
                })
                .collect(),
        }
    });
    Ok(held.collect())
}

/// The inverse of [`MusicFrame::vector`].
fn music_frame(v: &[f32], time_s: f64) -> MusicFrame {
    let confidence = v[SPECTRAL_DIM + 3];
    MusicFrame {
        time_s,
        spectral: std::array::from_fn(|i| v[i]),
        beat: Beat {
            phase: (v[SPECTRAL_DIM].atan2(v[SPECTRAL_DIM + 1]) / TAU).rem_euclid(1.0),
            tempo_bpm: if confidence > 0.0 {
                120.0 * v[SPECTRAL_DIM + 2].exp2()
            } else {
                0.0
            },
            confidence,
            ..Beat::default()
        },
        ..MusicFrame::default()
    }
}
