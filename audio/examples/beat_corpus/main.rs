//! Writes what the beat network is trained on: rendered music, other sounds
//! and their mixtures as the network hears them, with beats and bars.
//! `cargo run --release -p servodance-audio --example beat_corpus -- FOLDER COUNT [FIRST_SEED [TALKERS]]`.
//! `TALKERS` is a folder of wav files of speech, of a speech synthesiser say.
//!
//! `FOLDER/inputs.f32` holds all steps of all pieces one after the other, 80 a
//! second; `FOLDER/pieces.jsonl` one line a piece: its number of steps, beat
//! times, which of them open a bar, and the spans of music, in seconds.

#[allow(clippy::needless_range_loop)] // the steps of a bar are counted
mod grooves;

use std::error::Error;
use std::io::Write;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_audio::beats::inputs_of;
use servodance_audio::song::noise;
use servodance_audio::song::{SongSpec, Style};

const RATE_HZ: u32 = 22_050;
const PIECE_S: f64 = 40.0;

/// A piece of sound and its truth.
#[derive(Default)]
struct Piece {
    samples: Vec<f32>,
    beats_s: Vec<f64>,
    downbeats_s: Vec<f64>,
    music_s: Vec<(f64, f64)>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, count, rest @ ..] = arguments.as_slice() else {
        return Err("usage: beat_corpus FOLDER COUNT [FIRST_SEED [TALKERS]]".into());
    };
    let talkers = rest.get(1).map_or(Ok(Vec::new()), |folder| read_all(folder))?;
    let first: u64 = rest.first().map_or(Ok(0), |s| s.parse())?;
    let count: u64 = count.parse()?;
    std::fs::create_dir_all(folder)?;
    let file =
        |name: &str| std::fs::File::create(format!("{folder}/{name}")).map(std::io::BufWriter::new);
    let (mut inputs, mut pieces) = (file("inputs.f32")?, file("pieces.jsonl")?);
    for seed in first..first + count {
        let piece = compose(&talkers, &mut ChaCha8Rng::seed_from_u64(seed))?;
        let steps = inputs_of(&piece.samples, RATE_HZ);
        for value in steps.iter().flatten() {
            inputs.write_all(&value.to_le_bytes())?;
        }
        let spans: Vec<[f64; 2]> = piece.music_s.iter().map(|s| [s.0, s.1]).collect();
        writeln!(
            pieces,
            r#"{{"steps":{},"beats_s":{:?},"downbeats_s":{:?},"music_s":{:?}}}"#,
            steps.len(),
            piece.beats_s,
            piece.downbeats_s,
            spans
        )?;
        if seed % 50 == 0 {
            eprintln!("{seed}");
        }
    }
    Ok(())
}

/// Stretches of music and of other things, one after the other, then what
/// disturbs all of them, then the level.
fn compose(talkers: &[Vec<f32>], rng: &mut ChaCha8Rng) -> Result<Piece, Box<dyn Error>> {
    let mut piece = Piece::default();
    while length_s(&piece) < PIECE_S {
        let left = PIECE_S - length_s(&piece);
        let duration_s = rng.random_range(8.0f64..45.0).min(left).max(1.0);
        match rng.random_range(0..100) {
            0..78 => add_music(&mut piece, duration_s, rng)?,
            78..82 => {
                piece.samples.extend(vec![0.0; (0.4 * duration_s * f64::from(RATE_HZ)) as usize])
            }
            _ => {
                let level = 10f32.powf(rng.random_range(-40.0..-8.0) / 20.0);
                let sound = disturbance(talkers, 0.6 * duration_s, &[], rng);
                piece.samples.extend(sound.iter().map(|s| level * s));
            }
        }
    }
    if rng.random_bool(0.35) {
        let sound = disturbance(talkers, length_s(&piece) + 1.0, &piece.beats_s, rng);
        let snr_db = rng.random_range(-2.0..22.0);
        piece.samples = noise::mix(&piece.samples, &sound, snr_db);
    }
    let level = 10f32.powf(rng.random_range(-40.0..0.0) / 20.0);
    piece.samples.iter_mut().for_each(|s| *s *= level);
    Ok(piece)
}

fn length_s(piece: &Piece) -> f64 {
    piece.samples.len() as f64 / f64::from(RATE_HZ)
}

/// Something that is not music; motors move to the beats if there are any.
fn disturbance(
    talkers: &[Vec<f32>],
    duration_s: f64,
    beats_s: &[f64],
    rng: &mut ChaCha8Rng,
) -> Vec<f32> {
    let seed = rng.random();
    match rng.random_range(0..10) {
        0..3 if !talkers.is_empty() && rng.random_bool(0.75) => excerpt(talkers, duration_s, rng),
        0..3 => noise::speech(duration_s, RATE_HZ, seed),
        3..5 => noise::crowd(duration_s, RATE_HZ, seed),
        5 => noise::hiss(duration_s, RATE_HZ, rng.random_range(0.0..1.0), seed),
        6 => noise::knocks(duration_s, RATE_HZ, rng.random_range(1.0..9.0), seed),
        _ => noise::motors(&turns(duration_s, beats_s, rng), duration_s, RATE_HZ, seed),
    }
}

/// Some of what one of the talkers says, again from the start if need be.
fn excerpt(talkers: &[Vec<f32>], duration_s: f64, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let talker = &talkers[rng.random_range(0..talkers.len())];
    let start = rng.random_range(0..talker.len());
    let count = (duration_s * f64::from(RATE_HZ)).round() as usize;
    let said: Vec<f32> = talker.iter().cycle().skip(start).take(count).copied().collect();
    let gain = 1.0 / noise::rms(&said).max(1e-6);
    said.iter().map(|s| gain * s).collect()
}

/// The wav files of a folder.
fn read_all(folder: &str) -> Result<Vec<Vec<f32>>, Box<dyn Error>> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let mut wav = hound::WavReader::open(entry?.path())?;
        let samples: Result<Vec<i16>, _> = wav.samples::<i16>().collect();
        all.push(samples?.iter().map(|&s| f32::from(s) / 32_768.0).collect());
    }
    Ok(all)
}

/// When a robot turns round: late after the beats, or at its own whim.
fn turns(duration_s: f64, beats_s: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    if beats_s.len() > 4 && rng.random_bool(0.7) {
        let late_s = rng.random_range(-0.1..0.4);
        return beats_s.iter().map(|b| b + late_s).collect();
    }
    let mut now_s = 0.0;
    let (usual_s, spread) = (rng.random_range(0.25..1.2), rng.random_range(0.1..0.8));
    let mut turns = Vec::new();
    while now_s < duration_s {
        turns.push(now_s);
        now_s += usual_s * (1.0 + spread * rng.random_range(-1.0f64..1.0));
    }
    turns
}

fn add_music(
    piece: &mut Piece,
    duration_s: f64,
    rng: &mut ChaCha8Rng,
) -> Result<(), Box<dyn Error>> {
    let style = Style::ALL[rng.random_range(0..Style::ALL.len())];
    let (low, high) = style.tempo_range_bpm();
    let bpm = if rng.random_bool(0.4) {
        rng.random_range(low..high)
    } else {
        // Evenly over the octaves of tempi that are danced.
        64.0 * (185.0f64 / 64.0).powf(rng.random_range(0.0..1.0))
    };
    let beats_s = beat_times(bpm, duration_s, rng);
    let first_downbeat = rng.random_range(0..4);
    let mut sound = vec![0.0f32; (duration_s * f64::from(RATE_HZ)).round() as usize];
    let songs = [0, 1, 1, 1, 2][rng.random_range(0..5)];
    for _ in 0..songs {
        let mut spec = SongSpec::on_beats(&beats_s, duration_s, rng.random())?;
        if rng.random_bool(0.7) {
            spec.style = style;
        }
        spec.first_downbeat = first_downbeat;
        add(&mut sound, &spec.render()?.samples, rng.random_range(0.3..1.0));
    }
    if songs == 0 || rng.random_bool(0.45) {
        let groove = grooves::play(&beats_s, first_downbeat, duration_s, RATE_HZ, rng);
        add(&mut sound, &groove, rng.random_range(0.3..1.0));
    }
    if rng.random_bool(0.3) {
        let drive = rng.random_range(1.0..12.0);
        sound.iter_mut().for_each(|s| *s = (drive * *s).tanh());
    }
    let start_s = length_s(piece);
    for (i, beat_s) in beats_s.iter().enumerate().filter(|b| (0.0..duration_s).contains(b.1)) {
        piece.beats_s.push(start_s + beat_s);
        if (i + 4 - first_downbeat) % 4 == 0 {
            piece.downbeats_s.push(start_s + beat_s);
        }
    }
    piece.music_s.push((start_s, start_s + duration_s));
    let level =
        10f32.powf(rng.random_range(-14.0..0.0) / 20.0) / noise::rms(&sound).max(1e-3) * 0.2;
    piece.samples.extend(sound.iter().map(|s| level * s));
    Ok(())
}

fn add(out: &mut [f32], sound: &[f32], gain: f32) {
    let gain = 0.2 * gain / noise::rms(sound).max(1e-3);
    out.iter_mut().zip(sound).for_each(|(o, s)| *o += gain * s);
}

/// Beats that are steady, drift or breathe like a human player's.
fn beat_times(bpm: f64, duration_s: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let drift_per_s = if rng.random_bool(0.3) { rng.random_range(-0.004..0.004) } else { 0.0 };
    let loose = if rng.random_bool(0.3) { rng.random_range(0.0..0.015) } else { 0.0 };
    let mut now_s = -rng.random_range(0.0..60.0 / bpm);
    let mut beats = Vec::new();
    while now_s < duration_s + 1.0 {
        beats.push(now_s);
        let period_s = 60.0 / bpm * (1.0 - drift_per_s * now_s);
        now_s += (period_s * (1.0 + loose * rng.random_range(-1.0..1.0))).clamp(0.21, 1.9);
    }
    beats
}
