//! Beat alignment of the motion, the joint targets and the servos.
//!
//! All three are scored alike: mean joint speed of positions sampled about
//! twenty times a second (metres of the 22 joints, radians of the robot's),
//! its local minima being the kinematic beats, against the beats of the music.

use crate::control::trace::JointTrace;
use crate::telemetry::report::AlignmentScores;
use servodance_model::motion::{alignment, kinematic_beats_s, mean_joint_speed};
use servodance_types::{FRAME_RATE_HZ, MotionFrame};

/// Mean joint speed over time; its local minima are the kinematic beats.
pub struct JointSpeed {
    values: Vec<f64>,
    rate_hz: f64,
    /// Time of the first value, seconds of music.
    first_s: f64,
}

impl JointSpeed {
    /// Of the 22 human joints.
    pub fn of_dancer(motion: &[MotionFrame]) -> Self {
        let poses: Vec<_> = motion.iter().map(|frame| frame.positions).collect();
        Self {
            values: mean_joint_speed(&poses, FRAME_RATE_HZ),
            rate_hz: FRAME_RATE_HZ,
            first_s: motion.first().map_or(0.0, |frame| frame.time_s),
        }
    }

    pub fn of_joints(trace: &JointTrace, trace_hz: f64) -> Self {
        Self {
            values: trace.mean_speed(trace_hz),
            rate_hz: trace_hz,
            first_s: trace.times_s().first().copied().unwrap_or(0.0),
        }
    }

    /// Times of its pauses, seconds of music.
    pub fn beats_s(&self) -> Vec<f64> {
        let mut beats_s = kinematic_beats_s(&self.values, self.rate_hz);
        beats_s.iter_mut().for_each(|beat| *beat += self.first_s);
        beats_s
    }

    /// How well its pauses meet the beats of the music.
    pub fn scores(&self, music_s: &[f64]) -> AlignmentScores {
        if music_s.is_empty() || self.values.len() < 2 {
            return AlignmentScores::default();
        }
        let shifted: Vec<f64> = music_s.iter().map(|beat| beat - self.first_s).collect();
        let found = alignment(&self.values, self.rate_hz, &shifted);
        let mut late_ms = lateness_ms(&self.beats_s(), music_s);
        let bias_ms = median(&mut late_ms);
        let mut error_ms: Vec<f64> = late_ms.iter().map(|late| late.abs()).collect();
        AlignmentScores {
            fact: Some(found.fact),
            bailando: Some(found.bailando),
            f1: Some(found.f1),
            error_ms: median(&mut error_ms),
            bias_ms,
        }
    }
}

/// By how much each kinematic beat is later than the music beat nearest to it.
fn lateness_ms(kinematic_s: &[f64], music_s: &[f64]) -> Vec<f64> {
    let late = |beat: &f64| {
        let late_s = music_s.iter().map(|music| beat - music);
        late_s.min_by(|a, b| a.abs().total_cmp(&b.abs()))
    };
    kinematic_s.iter().filter_map(late).map(|s| s * 1e3).collect()
}

/// The middle value, or the mean of the middle two; sorts.
fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(f64::midpoint(values[last / 2], values[last.div_ceil(2)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lateness_is_against_the_nearest_beat() {
        let mut late = lateness_ms(&[0.04, 0.53, 0.98], &[0.0, 0.5, 1.0]);
        assert_eq!(median(&mut late).map(f64::round), Some(30.0));
        assert_eq!(late.iter().map(|l| l.round()).collect::<Vec<_>>(), [-20.0, 30.0, 40.0]);
        assert_eq!(median(&mut []), None);
    }
}
