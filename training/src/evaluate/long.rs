//! One long dance: does it die down, drift or begin to jitter?

use super::figures::mean;
use super::reference::HeldOutClip;
use super::report::LongDance;
use crate::metrics::quality::{foot_skate_ratio, mean_jerk_m_s3};
use servodance_model::motion::{Clip, Pose, mean_joint_speed};
use servodance_model::{Generator, GeneratorOptions};
use servodance_types::FRAME_RATE_HZ;

const MINUTE: usize = (60.0 * FRAME_RATE_HZ) as usize;

/// All held-out music in a row, over and over, with one past: nothing restarts with a song.
pub fn long_dance(
    generator: &Generator,
    options: GeneratorOptions,
    held: &[HeldOutClip],
    minutes: usize,
) -> anyhow::Result<LongDance> {
    let music = held.iter().flat_map(|clip| &clip.music).cycle();
    let mut dance = generator.start(options)?;
    let mut poses: Vec<Pose> = Vec::with_capacity(minutes * MINUTE);
    for (frame, heard) in music.take(minutes * MINUTE).enumerate() {
        let mut heard = *heard;
        heard.frame.time_s = frame as f64 / FRAME_RATE_HZ;
        poses.push(dance.step_heard(&heard)?.positions);
    }
    let speed = mean_joint_speed(&poses, FRAME_RATE_HZ);
    let by_minute: Vec<f64> = speed.chunks(MINUTE).map(mean).collect();
    let first = Clip::of_frames(poses[..MINUTE].to_vec());
    let last = Clip::of_frames(poses[poses.len() - MINUTE..].to_vec());
    let height = |clip: &Clip| {
        let heights = clip.poses.iter().map(|pose| f64::from(pose[0][1]));
        mean(&heights.collect::<Vec<_>>())
    };
    let whole = Clip::of_frames(poses.clone());
    Ok(LongDance {
        minutes,
        speed_kept: by_minute[minutes - 1] / by_minute[0],
        slowest_minute: by_minute.iter().copied().fold(f64::INFINITY, f64::min) / mean(&by_minute),
        height_drift_m: height(&last) - height(&first),
        jerk: mean_jerk_m_s3(&whole),
        jerk_kept: mean_jerk_m_s3(&last) / mean_jerk_m_s3(&first),
        foot_skate: foot_skate_ratio(&whole).unwrap_or(0.0),
        furthest_m: poses
            .iter()
            .map(|pose| f64::from(pose[0][0].hypot(pose[0][2])))
            .fold(0.0, f64::max),
        awakenings: dance.restarts(),
    })
}
