//! Captured motion turned over: bodies that lean, lie, roll and stand on their heads.
//!
//! For the codes alone (stage 1). Little captured motion leaves the upright, and codes that
//! never saw a body upside down miss a breakdancer by a decimetre. Nobody dances like this: the
//! clips are no dance and have no music.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use nalgebra::{Rotation3, Vector3};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_model::motion::{Clip, Pose, encode};
use servodance_types::FRAME_RATE_HZ;

use super::clip_entry::{ClipEntry, Split};
use super::error::DatasetError;
use super::index;
use super::options::DatasetOptions;
use super::training_file::TrainingClip;

/// What the seed of these clips differs by from those of others.
const SEED: u64 = 0x7117;
/// Longest piece of a clip that is turned over once.
const PIECE_S: f64 = 20.0;
/// Shorter clips are left out.
const LEAST_FRAMES: usize = 40;
/// From a lean to upside down.
const TILT_RAD: std::ops::Range<f64> = 25.0 * PI / 180.0..PI;
/// How fast half of them turn about the vertical at most.
const SPIN_RAD_S: f64 = 2.5;
/// The lowest joint touches the floor, seen over so many frames to both sides.
const FLOOR_FRAMES: usize = 15;

/// Adds `options.tilted` minutes, of clips that are learned from; none where there are no
/// such clips. Files that cannot be read are named with the captured motion.
pub(super) fn collect(
    folder: &Path,
    options: &DatasetOptions,
    clips: &mut Vec<TrainingClip>,
) -> Result<(), DatasetError> {
    if options.tilted <= 0.0 {
        return Ok(());
    }
    let learned = learned_from(folder)?;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ SEED);
    let mut minutes = 0.0;
    while minutes < options.tilted {
        // Dance twice as often.
        let weight =
            |(entry, _): &(ClipEntry, Clip)| entry.minutes * (1.0 + f64::from(entry.dance));
        let Ok((entry, clip)) = learned.choose_weighted(&mut rng, weight) else { break };
        let poses = if rng.random() { clip.mirrored().poses } else { clip.poses.clone() };
        let length = poses.len().min((PIECE_S * FRAME_RATE_HZ) as usize);
        let start = rng.random_range(0..=poses.len() - length);
        let turned = turned_over(&poses[start..start + length], &mut rng);
        minutes += length as f64 / FRAME_RATE_HZ / 60.0;
        clips.push(TrainingClip {
            name: format!("tilted/{} {}", entry.name, clips.len()),
            motion: encode(&Clip::of_frames(turned).normalised().poses),
            music: None,
            latents: None,
            style: entry.style(),
            split: Split::Train,
            dance: false,
            synthetic: false,
            variant: 1,
        });
    }
    Ok(())
}

/// The captured clips of the split that is learned from, long enough to be turned over.
fn learned_from(folder: &Path) -> Result<Vec<(ClipEntry, Clip)>, DatasetError> {
    let learned = index::read(folder)?.into_iter().filter(|entry| entry.split == Split::Train);
    let read = |entry: ClipEntry| {
        let clip = Clip::read_npz(entry.path(folder)).ok()?.normalised();
        (clip.poses.len() >= LEAST_FRAMES).then_some((entry, clip))
    };
    Ok(learned.filter_map(read).collect())
}

/// The body turned about a level axis through the pelvis, its lowest joint on the floor.
fn turned_over(poses: &[Pose], rng: &mut ChaCha8Rng) -> Vec<Pose> {
    let angles_rad = tilt(poses.len(), rng);
    let towards = rng.random_range(0.0..TAU);
    let axis = Vector3::new(towards.cos(), 0.0, towards.sin());
    let spins = rng.random::<bool>();
    let spin_rad_s = if spins { rng.random_range(-SPIN_RAD_S..SPIN_RAD_S) } else { 0.0 };
    let turned: Vec<Vec<Vector3<f64>>> = poses
        .iter()
        .zip(&angles_rad)
        .enumerate()
        .map(|(frame, (pose, angle_rad))| {
            let spin_rad = spin_rad_s * frame as f64 / FRAME_RATE_HZ;
            let turn = Rotation3::new(Vector3::y() * spin_rad) * Rotation3::new(axis * *angle_rad);
            let root = vector(pose[0]);
            pose.iter().map(|joint| turn * (vector(*joint) - root)).collect()
        })
        .collect();
    let below = turned.iter().map(|pose| pose.iter().map(|joint| -joint.y).fold(0.0, f64::max));
    let heights = over_floor(&below.collect::<Vec<f64>>());
    let placed = turned.iter().zip(poses).zip(heights);
    let place = |((turned, pose), height): ((&Vec<Vector3<f64>>, &Pose), f64)| {
        let root = Vector3::new(f64::from(pose[0][0]), height, f64::from(pose[0][2]));
        std::array::from_fn(|joint| (turned[joint] + root).data.0[0].map(|v| v as f32))
    };
    placed.map(place).collect()
}

/// How far over at each frame: always, to and fro, or wandering.
fn tilt(frames: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let most_rad = rng.random_range(TILT_RAD);
    let (rate_hz, phase) = (rng.random_range(0.05..0.3), rng.random_range(0.0..TAU));
    match rng.random_range(0..3) {
        0 => vec![most_rad; frames],
        1 => {
            let swing = |frame: usize| (TAU * rate_hz * frame as f64 / FRAME_RATE_HZ + phase).sin();
            (0..frames).map(|frame| 0.5 * most_rad * (1.0 + swing(frame))).collect()
        }
        _ => {
            let (mut angle_rad, mut rate) = (most_rad, 0.0);
            let mut wander = || {
                rate = 0.95 * rate + rng.random_range(-0.01..0.01);
                angle_rad += rate;
                angle_rad
            };
            (0..frames).map(|_| wander()).collect()
        }
    }
}

/// Height of the pelvis over the floor from how far the body reaches below it: the most of the
/// frames around, evened out.
fn over_floor(below: &[f64]) -> Vec<f64> {
    let around = |frame: usize| {
        frame.saturating_sub(FLOOR_FRAMES)..(frame + FLOOR_FRAMES + 1).min(below.len())
    };
    let frames = 0..below.len();
    let most: Vec<f64> =
        frames.clone().map(|f| below[around(f)].iter().copied().fold(0.0, f64::max)).collect();
    let mean = |f| most[around(f)].iter().sum::<f64>() / around(f).len() as f64;
    frames.map(mean).collect()
}

fn vector(point: [f32; 3]) -> Vector3<f64> {
    Vector3::from(point.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body that stands, 2 s long.
    fn standing() -> Vec<Pose> {
        let pose = std::array::from_fn(|j| [0.1 * (j % 3) as f32, 0.08 * j as f32, 0.0]);
        vec![pose; 40]
    }

    #[test]
    fn a_body_turned_over_keeps_its_shape_and_stays_above_the_floor() {
        let poses = standing();
        let (mut lowest, mut upside_down) = (f32::MAX, 0);
        for seed in 0..20 {
            let turned = turned_over(&poses, &mut ChaCha8Rng::seed_from_u64(seed));
            for (turned, pose) in turned.iter().zip(&poses) {
                let apart = |p: &Pose| (vector(p[21]) - vector(p[0])).norm();
                assert!((apart(turned) - apart(pose)).abs() < 1e-5);
                lowest = turned.iter().fold(lowest, |low, joint| low.min(joint[1]));
                upside_down += usize::from(turned[21][1] < turned[0][1]);
            }
        }
        assert!((-1e-5..0.01).contains(&lowest), "{lowest}");
        assert!(upside_down > 200, "{upside_down} of 800 frames");
    }
}
