//! What is usual for a dancer whose whole motion is known.
//!
//! The mean over the moments around each frame, later ones too, so that it does not depend on
//! where in a longer motion the first frame was cut. For motion that still comes use
//! [`PostureReader`](crate::PostureReader).

use std::ops::Range;

use k::nalgebra::Vector3;
use servodance_types::BodyJoint::{LeftFoot, RightFoot};
use servodance_types::{FRAME_RATE_HZ, JOINT_COUNT, MotionFrame, Posture};

use crate::dancer::baseline_posture::{POSTURE, facing};
use crate::dancer::{BaselinePosture, BodyPoints, PostureSample, usable_points, wrap};

/// Seconds before and after a frame over which its heading is the mean. Mostly after: a mean
/// around the frame itself would take slow turns away with it, and half of them would be shown.
const HEADING_S: [f64; 2] = [0.2, 1.0];
/// The same for nod, sway and feet, and for the lowest place of the feet, which is the floor.
const USUAL_S: [f64; 2] = [0.2, 1.3];

/// The usual posture at every one of `frames`, which are 1/20 s apart.
pub fn surrounding_postures(frames: &[MotionFrame]) -> Vec<Posture> {
    let mut samples = Vec::with_capacity(frames.len());
    let mut last: BodyPoints = [Vector3::zeros(); JOINT_COUNT];
    let (mut counted, mut before) = (0.0, BaselinePosture::default().flat());
    for frame in frames {
        last = usable_points(frame).unwrap_or(last);
        counted += wrap(facing(&last) - counted);
        before = seen(&last, counted, before);
        let lowest = last[LeftFoot as usize].z.min(last[RightFoot as usize].z);
        samples.push(Sample { heading: [counted], posture: before, lowest });
    }
    let around = |at: usize, [before_s, after_s]: [f64; 2]| -> Range<usize> {
        let count = |seconds: f64| (seconds * FRAME_RATE_HZ).round() as usize;
        at.saturating_sub(count(before_s))..(at + count(after_s) + 1).min(samples.len())
    };
    let usual = |at: usize| {
        let posture = &samples[around(at, USUAL_S)];
        let [heading] = mean(&samples[around(at, HEADING_S)], |sample| sample.heading);
        let mut usual = BaselinePosture { heading, ..BaselinePosture::default() };
        usual.set(mean(posture, |sample| sample.posture));
        usual.floor_z = posture.iter().map(|sample| sample.lowest).fold(f64::INFINITY, f64::min);
        Posture::from(&usual)
    };
    (0..frames.len()).map(usual).collect()
}

struct Sample {
    heading: [f64; 1],
    posture: [f64; POSTURE],
    lowest: f64,
}

/// Nod, sway and feet, seen from where the body faces; without legs those stay as before.
fn seen(points: &BodyPoints, facing: f64, before: [f64; POSTURE]) -> [f64; POSTURE] {
    let seen = PostureSample::of(points, facing);
    let mut flat = before;
    flat[..2].copy_from_slice(&seen.nod);
    if let Some((sway, [left, right])) = seen.legs {
        flat[2..].copy_from_slice(&[sway.x, sway.y, left.x, left.y, right.x, right.y]);
    }
    flat
}

fn mean<const N: usize>(samples: &[Sample], of: impl Fn(&Sample) -> [f64; N]) -> [f64; N] {
    let share = 1.0 / samples.len() as f64;
    samples
        .iter()
        .map(of)
        .fold([0.0; N], |sum, value| std::array::from_fn(|at| sum[at] + share * value[at]))
}
