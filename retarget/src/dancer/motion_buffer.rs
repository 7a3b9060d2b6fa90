//! Human frames at 20 Hz in, body points at any time out.
//!
//! Frames lie on a 20 Hz grid. Between them a cubic quasi-interpolating
//! B-spline (de Boor and Fix 1973: coefficients are the samples minus a sixth
//! of their second difference) is continuous up to acceleration, follows cubic
//! motion exactly, and damps what one frame cannot know; it needs three frames
//! after the asked time. Positions are metres in robot axes: x where the
//! dancer faces at the start, y to the left, z up.

use std::collections::VecDeque;

use k::nalgebra::Vector3;
use servodance_types::{FRAME_RATE_HZ, JOINT_COUNT, MotionFrame};

use crate::retargeter::counts::RetargetCounts;

pub(crate) const LOOKAHEAD_FRAMES: usize = 3;
const KEPT: usize = 256;
/// The longest hole that is bridged, frames; frames farther off start anew.
const LONGEST_HOLE: i64 = 20;
/// A point that moves faster against the pelvis than any dancer, m/s.
const TELEPORT_M_S: f64 = 15.0;
/// Coordinates beyond this are not a dancer, metres.
const FARTHEST_M: f32 = 1e5;
/// Times beyond this are none of a dance, seconds.
const LATEST_S: f64 = 1e9;

/// The body's points in robot axes, metres, indexed by `BodyJoint`.
pub type BodyPoints = [Vector3<f64>; JOINT_COUNT];

/// The points of a frame; `None` where no dancer can have them.
pub(crate) fn usable_points(frame: &MotionFrame) -> Option<BodyPoints> {
    let tame = |v: &f32| v.abs() <= FARTHEST_M;
    let is_usable = frame.is_finite()
        && frame.time_s.abs() <= LATEST_S
        && frame.positions.iter().flatten().all(tame);
    is_usable.then(|| robot_axes(frame))
}

pub(crate) struct MotionBuffer {
    frames: VecDeque<BodyPoints>,
    /// Grid index of `frames[0]`.
    first: i64,
    /// The last frame, if its time was far from all others.
    stray: Option<(i64, BodyPoints)>,
}

impl MotionBuffer {
    pub fn new() -> Self {
        Self { frames: VecDeque::with_capacity(KEPT + 1), first: 0, stray: None }
    }

    pub fn push(&mut self, frame: &MotionFrame, counts: &mut RetargetCounts) {
        let Some(points) = usable_points(frame) else {
            counts.unusable_frames += 1;
            return;
        };
        let index = (frame.time_s * FRAME_RATE_HZ).round() as i64;
        let (Some(last), next) =
            (self.frames.back().copied(), self.first + self.frames.len() as i64)
        else {
            self.first = index;
            self.frames.push_back(points);
            return;
        };
        let hole = index - next;
        if hole.abs() > LONGEST_HOLE {
            self.consider_restart(index, points, counts);
            return;
        }
        self.stray = None;
        if hole < 0 {
            counts.late_frames += 1;
            return;
        }
        if is_teleport(&last, &points, (hole + 1) as f64) {
            counts.teleports += 1;
        }
        counts.bridged_frames += hole as u64;
        for step in 1..=hole {
            let share = step as f64 / (hole + 1) as f64;
            let between = std::array::from_fn(|j| last[j].lerp(&points[j], share));
            self.store(between);
        }
        self.store(points);
    }

    /// A frame of a far time starts the stream anew, but only when the next
    /// one confirms it: one wrong time stamp shall not silence the rest.
    fn consider_restart(&mut self, index: i64, points: BodyPoints, counts: &mut RetargetCounts) {
        match self.stray.replace((index, points)) {
            Some((before, first)) if index == before + 1 => {
                counts.restarts += 1;
                self.stray = None;
                self.frames.clear();
                self.first = before;
                self.store(first);
                self.store(points);
            }
            _ => counts.late_frames += 1,
        }
    }

    fn store(&mut self, points: BodyPoints) {
        if self.frames.len() == KEPT {
            self.frames.pop_front();
            self.first += 1;
        }
        self.frames.push_back(points);
    }

    /// Whether `time_s` is after the newest frame.
    pub fn is_over(&self, time_s: f64) -> bool {
        let newest = self.first + self.frames.len() as i64 - 1;
        !self.frames.is_empty() && time_s * FRAME_RATE_HZ > newest as f64 + 1e-6
    }

    /// The body at `time_s`, or `None` before the first frame. After the last
    /// one that is held.
    pub fn at(&self, time_s: f64) -> Option<BodyPoints> {
        if self.frames.is_empty() || !time_s.is_finite() {
            return None;
        }
        let place = time_s * FRAME_RATE_HZ - self.first as f64;
        if place < 0.0 {
            return None;
        }
        let newest = (self.frames.len() - 1) as f64;
        let place = place.min(newest);
        let base = place.floor();
        let weights = spline_weights(place - base);
        let mut points = [Vector3::zeros(); JOINT_COUNT];
        for (offset, weight) in weights.into_iter().enumerate() {
            // Beyond both ends the nearest frame is held.
            let index = (base + offset as f64 - 2.0).clamp(0.0, newest) as usize;
            for (point, sample) in points.iter_mut().zip(&self.frames[index]) {
                *point += sample * weight;
            }
        }
        Some(points)
    }
}

/// Weights of the frames `-2..=3` around a place `share` after frame 0.
fn spline_weights(share: f64) -> [f64; 6] {
    let (t, rest) = (share, 1.0 - share);
    let basis = [
        rest * rest * rest / 6.0,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
        (3.0 * rest * rest * rest - 6.0 * rest * rest + 4.0) / 6.0,
        t * t * t / 6.0,
    ];
    let mut weights = [0.0; 6];
    for (index, b) in basis.into_iter().enumerate() {
        weights[index] -= b / 6.0;
        weights[index + 1] += b * 4.0 / 3.0;
        weights[index + 2] -= b / 6.0;
    }
    weights
}

/// Human axes (x left, y up, z forward) to robot axes (x forward, y left, z up).
pub(crate) fn robot_axes(frame: &MotionFrame) -> BodyPoints {
    frame.positions.map(|[x, y, z]| Vector3::new(z.into(), x.into(), y.into()))
}

fn is_teleport(before: &BodyPoints, after: &BodyPoints, frames: f64) -> bool {
    let reach = TELEPORT_M_S * frames / FRAME_RATE_HZ;
    before.iter().zip(after).any(|(a, b)| ((b - after[0]) - (a - before[0])).norm() > reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(index: i64, value: f32) -> MotionFrame {
        MotionFrame {
            time_s: index as f64 / FRAME_RATE_HZ,
            positions: [[value, 0.0, 0.0]; JOINT_COUNT],
            contacts: Default::default(),
        }
    }

    #[test]
    fn cubic_motion_is_followed_exactly() {
        let cubic = |t: f64| 0.3 * t * t * t - t * t + 0.5 * t + 1.0;
        let (mut stream, mut counts) = (MotionBuffer::new(), RetargetCounts::default());
        for index in 0..20 {
            stream.push(&frame(index, cubic(index as f64 / 20.0) as f32), &mut counts);
        }
        for step in 0..50 {
            let t = 0.15 + step as f64 * 0.01;
            let got = stream.at(t).unwrap()[3].y;
            assert!((got - cubic(t)).abs() < 1e-6, "{t}: {got} {}", cubic(t));
        }
        assert_eq!(counts, RetargetCounts::default());
    }

    #[test]
    fn unusable_frames_are_counted_and_bridged() {
        let (mut stream, mut counts) = (MotionBuffer::new(), RetargetCounts::default());
        stream.push(&frame(0, 0.0), &mut counts);
        stream.push(&frame(1, f32::NAN), &mut counts);
        stream.push(&frame(2, 1e30), &mut counts);
        stream.push(&frame(3, 0.3), &mut counts);
        stream.push(&frame(3, 9.0), &mut counts);
        assert_eq!(counts.unusable_frames, 2);
        assert_eq!(counts.bridged_frames, 2);
        assert_eq!(counts.late_frames, 1);
        assert_eq!(stream.frames.len(), 4);
        assert!((stream.frames[1][0].y - 0.1).abs() < 1e-6);
    }

    #[test]
    fn one_wrong_time_is_left_out_two_start_anew() {
        let (mut stream, mut counts) = (MotionBuffer::new(), RetargetCounts::default());
        for index in [0, 1, 5000, 2, 3, 7000, 7001, 7002] {
            stream.push(&frame(index, 0.0), &mut counts);
        }
        // The first of the two counted as wrong until it was confirmed.
        assert_eq!((counts.late_frames, counts.restarts), (2, 1));
        assert_eq!((stream.first, stream.frames.len()), (7000, 3));
    }

    #[test]
    fn a_jump_is_called_a_teleport() {
        let (mut stream, mut counts) = (MotionBuffer::new(), RetargetCounts::default());
        stream.push(&frame(0, 0.0), &mut counts);
        let mut far = frame(1, 0.0);
        far.positions[20] = [2.0, 0.0, 0.0];
        stream.push(&far, &mut counts);
        assert_eq!(counts.teleports, 1);
    }
}
