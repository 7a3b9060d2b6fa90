//! Captured motion and its mirrored copies, with their own music, or with music
//! rendered on the beats of the motion.

use std::path::Path;

use crate::dataset::clip_entry::{ClipEntry, Split};
use crate::dataset::index;
use crate::dataset::training_file::TrainingClip;
use crate::motion::tempo::{self, KinematicTempo};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_model::conditioning::{Encodec, Latent};
use servodance_model::motion::{Clip, encode};
use servodance_types::FRAME_RATE_HZ;

use super::error::DatasetError;
use super::music;
use super::options::{DatasetOptions, DatasetSummary};
use super::sources::terms;

/// Music is rendered where the beats meet the motion this well (F1).
const USABLE_F1: f64 = 0.6;
/// The listener has found the beat by then, as a dancer who joins in has.
const PRE_ROLL_FRAMES: usize = 160;
/// How much dancers linger on the beat in what is learned from ([`tempo::eased`]): captured
/// people meet their beats with an F1 of about 0.6, and a model learns that as well as the
/// rest. Captured dance that judges is left as it is.
pub(super) const EMPHASIS: f64 = 0.4;

pub(super) fn collect(
    folder: &Path,
    options: &DatasetOptions,
    encodec: Option<&Encodec>,
    clips: &mut Vec<TrainingClip>,
    summary: &mut DatasetSummary,
    on_progress: &dyn Fn(f64),
) -> Result<(), DatasetError> {
    let entries = index::read(folder)?;
    let count = entries.len() as f64;
    for (number, entry) in entries.into_iter().enumerate() {
        on_progress(number as f64 / count);
        let own = match entry.music {
            true => Clip::read_music(&entry.path(folder))?,
            false => None,
        };
        let own_latents = match own.is_some() && encodec.is_some() {
            true => Some(own_latents(&entry, folder)?),
            false => None,
        };
        let original = match Clip::read_npz(entry.path(folder)) {
            Ok(clip) => clip,
            Err(error) => {
                summary.left_out.push(error.to_string());
                continue;
            }
        };
        let normal = original.normalised();
        let tempo = (entry.dance && own.is_none())
            .then(|| tempo::estimate(&normal))
            .flatten()
            .filter(|tempo| tempo.f1 >= USABLE_F1);
        if entry.dance {
            summary.captured_dance_minutes += entry.minutes;
        }
        if tempo.is_some() {
            summary.captured_dance_with_beat_minutes += entry.minutes;
        }
        summary.terms.insert(entry.source.clone(), terms(&entry.source, &entry.licence).to_owned());
        let copies = [(original.clone(), false), (original.mirrored(), true)];
        for (clip, mirrored) in copies {
            let mut plain = without_music(&entry, &clip, mirrored);
            if let Some(music) = &own {
                plain.motion.truncate(music.len());
                plain.music = Some(music[..plain.motion.len()].to_vec());
                let rows = own_latents.as_ref();
                plain.latents =
                    rows.map(|rows| rows[..plain.motion.len().min(rows.len())].to_vec());
            }
            clips.push(plain);
            if let Some(tempo) = &tempo {
                with_music(&entry, &clip, mirrored, tempo, options, encodec, clips)?;
            }
        }
    }
    Ok(())
}

fn own_latents(entry: &ClipEntry, folder: &Path) -> Result<Vec<Latent>, DatasetError> {
    Clip::read_latents(&entry.path(folder))?.ok_or_else(|| {
        let reason = "its file has music without `encodec`; import it again with --music-features encodec128";
        music::music_error(&entry.name, &reason)
    })
}

fn without_music(entry: &ClipEntry, clip: &Clip, mirrored: bool) -> TrainingClip {
    let suffix = if mirrored { "#mirrored" } else { "" };
    TrainingClip {
        name: format!("{}{suffix}", entry.name),
        motion: encode(&clip.normalised().poses),
        music: None,
        latents: None,
        style: entry.style(),
        split: entry.split,
        dance: entry.dance,
        synthetic: false,
        variant: mirrored.into(),
    }
}

/// The clip, its beats on a steady grid, with several songs on that grid. The
/// first song has the clip's own tempo, the others up to 15 % more or less.
fn with_music(
    entry: &ClipEntry,
    clip: &Clip,
    mirrored: bool,
    tempo: &KinematicTempo,
    options: &DatasetOptions,
    encodec: Option<&Encodec>,
    clips: &mut Vec<TrainingClip>,
) -> Result<(), DatasetError> {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ name_seed(&entry.name));
    let smooth = Clip { fps: FRAME_RATE_HZ, ..clip.normalised() };
    let is_learned = entry.split == Split::Train;
    let emphasis = if is_learned { EMPHASIS } else { 0.0 };
    for song in 0..options.songs {
        let stretch = if song == 0 { 1.0 } else { rng.random_range(0.87..1.15) };
        let (warped, grid) = tempo::onto_grid(&smooth, tempo, tempo.period_s * stretch, emphasis);
        let warped = warped.normalised();
        let motion = encode(&warped.poses);
        let pre_roll_s = PRE_ROLL_FRAMES as f64 / FRAME_RATE_HZ;
        let beats: Vec<f64> = grid.iter().map(|beat| beat + pre_roll_s).collect();
        let suffix = if mirrored { "mirrored, " } else { "" };
        let name = format!("{}#{suffix}song {song}", entry.name);
        let duration_s = (PRE_ROLL_FRAMES + motion.len() + 4) as f64 / FRAME_RATE_HZ;
        let (mut heard, mut last) = (Vec::new(), None);
        for _ in 0..music::ATTEMPTS {
            let mut sounding = music::on_beats(&name, &beats, duration_s, rng.random())?;
            if is_learned {
                music::add_dynamics(&mut sounding, &warped, pre_roll_s, &mut rng);
            }
            let sounding = last.insert(sounding);
            let (samples, rate) = (&sounding.samples, sounding.sample_rate_hz);
            heard = music::hear(&name, samples, rate, PRE_ROLL_FRAMES, motion.len())?;
            if music::followed(&heard, &grid) > music::FOLLOWED {
                break;
            }
        }
        let latents = match &last {
            Some(song) => music::latents(&name, song, PRE_ROLL_FRAMES, motion.len(), encodec)?,
            None => None,
        };
        clips.push(TrainingClip {
            name,
            motion,
            music: Some(heard),
            latents,
            style: entry.style(),
            split: entry.split,
            dance: true,
            synthetic: false,
            variant: (mirrored || song > 0).into(),
        });
    }
    Ok(())
}

/// A number that depends on a name alone (FNV-1a).
fn name_seed(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    })
}
