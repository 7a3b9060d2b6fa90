//! One long dance: does it die down, drift or begin to jitter?

use super::figures::mean;
use super::reference::HeldOut;
use super::report::LongDance;
use crate::metrics::quality::{foot_skate_ratio, jerk};
use servodance_model::motion::mean_joint_speed;
use servodance_model::motion::{Clip, Pose};
use servodance_model::{Generator, GeneratorOptions};
use servodance_types::FRAME_RATE_HZ;

/// Frames of a minute.
const MINUTE: usize = (60.0 * FRAME_RATE_HZ) as usize;

/// Dances so many minutes to all held-out music in a row, over and over, with
/// one past: nothing is begun anew where a song ends.
pub fn long_dance(
    generator: &Generator,
    options: GeneratorOptions,
    held: &[HeldOut],
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
    let first = clip(&poses[..MINUTE]);
    let last = clip(&poses[poses.len() - MINUTE..]);
    let height = |clip: &Clip| {
        let heights = clip.poses.iter().map(|pose| f64::from(pose[0][1]));
        mean(&heights.collect::<Vec<_>>())
    };
    let whole = clip(&poses);
    Ok(LongDance {
        minutes,
        speed_kept: by_minute[minutes - 1] / by_minute[0],
        slowest_minute: by_minute.iter().copied().fold(f64::INFINITY, f64::min) / mean(&by_minute),
        height_drift_m: height(&last) - height(&first),
        jerk: jerk(&whole).mean_m_s3,
        jerk_kept: jerk(&last).mean_m_s3 / jerk(&first).mean_m_s3,
        foot_skate: foot_skate_ratio(&whole).unwrap_or(0.0),
        furthest_m: poses
            .iter()
            .map(|pose| f64::from(pose[0][0].hypot(pose[0][2])))
            .fold(0.0, f64::max),
        awakenings: dance.restarts(),
    })
}

fn clip(poses: &[Pose]) -> Clip {
    Clip {
        name: String::new(),
        fps: FRAME_RATE_HZ,
        poses: poses.to_vec(),
    }
}
