//! Beat alignment along the way: the dancer, the joint targets, the servos.
//!
//! All three are scored alike: mean joint speed of positions sampled about
//! twenty times a second (metres of the 22 joints, radians of the robot's),
//! its local minima being the kinematic beats, against the beats of the music.

use super::trace::Trace;
use crate::report::{AlignmentReport, AlignmentScores};
use servodance_model::metrics::{alignment, mean_joint_speed};
use servodance_types::FRAME_RATE_HZ;

/// Scores of a run.
pub fn alignment_report(trace: &Trace, trace_hz: f64, beats_s: &[f64]) -> AlignmentReport {
    let poses: Vec<_> = trace.motion.iter().map(|frame| frame.positions).collect();
    let dancer_speed = mean_joint_speed(&poses, FRAME_RATE_HZ);
    AlignmentReport {
        generator: scores(&dancer_speed, FRAME_RATE_HZ, beats_s),
        targets: scores(&trace.targets.mean_speed(trace_hz), trace_hz, beats_s),
        servos: scores(&trace.servos.mean_speed(trace_hz), trace_hz, beats_s),
    }
}

fn scores(speed: &[f64], rate_hz: f64, beats_s: &[f64]) -> AlignmentScores {
    if beats_s.is_empty() || speed.len() < 2 {
        return AlignmentScores::default();
    }
    let found = alignment(speed, rate_hz, beats_s);
    AlignmentScores {
        fact: Some(found.fact),
        bailando: Some(found.bailando),
        f1: Some(found.f1),
    }
}
