//! Choreography on rendered songs: every style, 70 to 180 BPM, silences, breaks.

use crate::choreography::{DanceBeat, DanceStyle, choreograph};
use crate::dataset::clip_entry::Split;
use crate::dataset::styles::style_number;
use crate::dataset::training_file::TrainingClip;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_audio::song::{Grid, Song, SongSpec, TempoStep};
use servodance_model::conditioning::Encodec;
use servodance_model::motion::encode;
use servodance_types::FRAME_RATE_HZ;

use super::error::DatasetError;
use super::music;
use super::options::DatasetOptions;

/// Length of one choreography, seconds.
const CLIP_S: f64 = 60.0;

pub(super) fn collect(
    options: &DatasetOptions,
    encodec: Option<&Encodec>,
    clips: &mut Vec<TrainingClip>,
    on_progress: &dyn Fn(f64),
) -> Result<(), DatasetError> {
    let count = (options.choreography * 60.0 / CLIP_S).ceil() as usize;
    for number in 0..count {
        on_progress(number as f64 / count as f64);
        let seed = options.seed.wrapping_mul(1000).wrapping_add(number as u64);
        clips.push(choreographed_clip(number, seed, encodec)?);
    }
    Ok(())
}

fn choreographed_clip(
    number: usize,
    seed: u64,
    encodec: Option<&Encodec>,
) -> Result<TrainingClip, DatasetError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let style = DanceStyle::ALL[number % DanceStyle::ALL.len()];
    let name = format!("choreography/{} {number}", style.name());
    let frames = (CLIP_S * FRAME_RATE_HZ) as usize;
    let (mut beats, mut heard) = (Vec::new(), Vec::new());
    let mut sounding = None;
    for _ in 0..music::ATTEMPTS {
        let song = sounding.insert(random_song(&name, &mut rng)?);
        let silences = random_silences(&mut rng);
        fade_out(song, &silences, &mut rng);
        beats = audible_beats(song, &silences);
        heard = music::hear(&name, &song.samples, song.sample_rate_hz, 0, frames)?;
        let times: Vec<f64> = beats.iter().map(|beat| beat.time_s).collect();
        if music::followed(&heard, &times) > music::FOLLOWED {
            break;
        }
    }
    let latents = match &sounding {
        Some(song) => music::latents(&name, song, 0, frames, encodec)?,
        None => None,
    };
    let motion = encode(&choreograph(&beats, CLIP_S, style, rng.random()).poses);
    Ok(TrainingClip {
        name,
        motion,
        music: Some(heard),
        latents,
        style: style_number(style.name()).unwrap_or(0),
        // Every twelfth of each style is held out, in turn.
        split: match (number / DanceStyle::ALL.len()) % 12 {
            5 => Split::Validation,
            11 => Split::Test,
            _ => Split::Train,
        },
        dance: true,
        synthetic: true,
        variant: 0,
    })
}

/// A song at a tempo of its style or of the whole range, one in five with a change of tempo.
fn random_song(name: &str, rng: &mut ChaCha8Rng) -> Result<Song, DatasetError> {
    let error = |error| music::music_error(name, &error);
    let mut spec = SongSpec::random(CLIP_S + 0.2, rng.random()).map_err(error)?;
    let wide = rng.random_bool(0.5);
    if wide {
        spec.grid = Grid::Tempo(vec![steady_tempo(rng, CLIP_S)]);
    }
    if rng.random_bool(0.2) {
        let first = steady_tempo(rng, rng.clone().random_range(20.0..40.0));
        let change = rng.random_range(0.75..1.33);
        let bpm = (first.bpm * change).clamp(70.0, 180.0);
        let second = TempoStep { beats: (CLIP_S * bpm / 60.0).ceil() as usize + 1, bpm };
        spec.grid = Grid::Tempo(vec![first, second]);
    }
    spec.render().map_err(error)
}

fn steady_tempo(rng: &mut ChaCha8Rng, seconds: f64) -> TempoStep {
    // Mostly 95 to 140, as music is; sometimes anything from 70 to 180.
    let bpm = if rng.random_bool(0.6) {
        rng.random_range(95.0..140.0)
    } else {
        70.0 * f64::powf(180.0 / 70.0, rng.random_range(0.0..1.0))
    };
    TempoStep { beats: (seconds * bpm / 60.0).ceil() as usize + 1, bpm }
}

/// Half of the songs begin late, a third breaks off in the middle, a third ends early.
fn random_silences(rng: &mut ChaCha8Rng) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    if rng.random_bool(0.5) {
        out.push((0.0, rng.random_range(0.5..6.0)));
    }
    if rng.random_bool(0.33) {
        let start = rng.random_range(20.0..40.0);
        out.push((start, start + rng.random_range(3.0..8.0)));
    }
    if rng.random_bool(0.33) {
        out.push((CLIP_S - rng.random_range(3.0..8.0), CLIP_S + 1.0));
    }
    out
}

/// Fades the song out of the silences; a quiet room is left.
fn fade_out(song: &mut Song, silences: &[(f64, f64)], rng: &mut ChaCha8Rng) {
    const FADE_S: f64 = 0.08;
    let rate = f64::from(song.sample_rate_hz);
    let room = 10f32.powf(rng.random_range(-5.0..-2.5));
    for (i, sample) in song.samples.iter_mut().enumerate() {
        let t = i as f64 / rate;
        let gain = silences.iter().fold(1.0f64, |gain, (from, until)| {
            let outside = (from - t).max(t - until);
            gain.min((outside / FADE_S).clamp(0.0, 1.0))
        });
        *sample = *sample * gain as f32 + room * rng.random_range(-1.0..1.0);
    }
}

fn audible_beats(song: &Song, silences: &[(f64, f64)]) -> Vec<DanceBeat> {
    let quiet = |t: f64| silences.iter().any(|(from, until)| (*from..*until).contains(&t));
    song.beats_s
        .iter()
        .enumerate()
        .map(|(i, time_s)| DanceBeat { time_s: *time_s, downbeat: song.downbeats.contains(&i) })
        .filter(|beat| !quiet(beat.time_s))
        .collect()
}
