//! Figures one after the other become one motion on the beats of a song.

use super::feet;
use super::figure::{Figure, FigureLibrary, is_upper};
use super::phrase::Step;
use super::song_form::SongForm;
use crate::dataset::captured::EMPHASIS;
use crate::motion::tempo::eased;
use servodance_model::motion::representation::heading_rad;
use servodance_model::motion::vec3::{Vec3, add, lerp, narrow, scale, sub, turn, wide};
use servodance_model::motion::{Clip, Pose, skeleton};
use servodance_types::{BodyJoint, FRAME_RATE_HZ};

/// How long what differs where two figures meet takes to fade, seconds.
const BLEND_S: f64 = 0.4;

pub(super) struct JoinedMotion {
    poses: Vec<Pose>,
    standing: Vec<[bool; 2]>,
}

impl JoinedMotion {
    /// `frames` poses at 20 a second from the song's beginning.
    pub fn of(library: &FigureLibrary, steps: &[Step], form: &SongForm, frames: usize) -> Self {
        let mut motion = Self { poses: Vec::new(), standing: Vec::new() };
        let beats_s = &form.song.beats_s;
        for (at, step) in steps.iter().enumerate() {
            // The first figure is stood in until it begins, the last one until the end.
            let end_s = match steps.get(at + 1) {
                Some(next) => beats_s[next.beat],
                None => frames as f64 / FRAME_RATE_HZ + 1.0,
            };
            let end = ((end_s * FRAME_RATE_HZ).ceil() as usize).min(frames);
            match step.figure {
                Some(figure) => motion.dance(library, step, figure, beats_s, end),
                None => motion.hold(end),
            }
        }
        motion.hold(frames);
        feet::keep(&mut motion.poses, &motion.standing);
        motion
    }

    pub fn poses(self) -> Vec<Pose> {
        self.poses
    }

    fn hold(&mut self, end: usize) {
        if let Some(&last) = self.poses.last() {
            self.poses.resize(end.max(self.poses.len()), last);
            self.standing.resize(self.poses.len(), [true; 2]);
        }
    }

    fn dance(
        &mut self,
        library: &FigureLibrary,
        step: &Step,
        figure: usize,
        beats_s: &[f64],
        end: usize,
    ) {
        let figure = &library.figures[figure];
        let clip = &library.clips[figure.clip];
        let upper = step.upper.map_or(figure, |upper| &library.figures[upper]);
        let mean = mean_upper(clip, figure);
        let mut place: Option<Placed> = None;
        for frame in self.poses.len()..end {
            let time_s = frame as f64 / FRAME_RATE_HZ;
            let place_in_beats = beats_into(beats_s, step, time_s);
            let source_s = source_time_s(&figure.beats_s, place_in_beats, EMPHASIS);
            let upper_s = source_time_s(&upper.beats_s, place_in_beats, EMPHASIS);
            let [legs, arms] = [clip.pose_at(source_s), library.clips[upper.clip].pose_at(upper_s)];
            let mut pose = with_upper_body(&legs, &arms);
            pose = resized(&pose, &mean, step.size);
            let here = *place.get_or_insert_with(|| Placed::after(self.last_two(), &pose));
            let placed = here.place(&pose, time_s - beats_s[step.beat]);
            self.standing.push(feet::standing(clip, source_s));
            self.poses.push(skeleton::fit(&placed, 1.0));
        }
    }

    /// The last pose, and the one before it.
    fn last_two(&self) -> Option<[Pose; 2]> {
        let last = *self.poses.last()?;
        let before = self.poses[self.poses.len().saturating_sub(2)];
        Some([last, before])
    }
}

/// Where a time is in a step, beats from its first.
fn beats_into(beats_s: &[f64], step: &Step, time_s: f64) -> f64 {
    let from = step.beat;
    let within =
        |beat: usize| from + beat + 1 < beats_s.len() && time_s >= beats_s[from + beat + 1];
    let beat = (0..step.beats.saturating_sub(1)).take_while(|beat| within(*beat)).count();
    let [a, b] = [from + beat, from + beat + 1].map(|i| beats_s[i.min(beats_s.len() - 1)]);
    let share = if b > a { (time_s - a) / (b - a) } else { 0.0 };
    (beat as f64 + share).clamp(0.0, step.beats as f64)
}

/// The time of a place in beats, of a figure with beats at these times ([`eased`]).
fn source_time_s(beats_s: &[f64], beats: f64, emphasis: f64) -> f64 {
    let beat = (beats.floor() as usize).min(beats_s.len() - 2);
    let [a, b] = [beats_s[beat], beats_s[beat + 1]];
    a + (b - a) * eased((beats - beat as f64).clamp(0.0, 1.0), emphasis)
}

/// How a figure is moved to where the last one ended, and what is left of that one.
#[derive(Clone, Copy)]
struct Placed {
    origin: Vec3,
    turn_rad: f64,
    to: Vec3,
    left_over: [Vec3; 22],
}

impl Placed {
    /// A figure that begins with a pose, behind the last two poses danced.
    fn after(last: Option<[Pose; 2]>, pose: &Pose) -> Self {
        let root = wide(pose[0]);
        let still = Self { origin: root, turn_rad: 0.0, to: [0.0; 3], left_over: [[0.0; 3]; 22] };
        let Some([last, before]) = last else { return still };
        // Where the last figure would have been.
        let expected = std::array::from_fn::<Vec3, 22, _>(|joint| {
            let [now, past] = [wide(last[joint]), wide(before[joint])];
            add(now, scale(sub(now, past), 0.5))
        });
        let turn_rad = heading_rad(&last) - heading_rad(pose);
        let mut placed = Self { turn_rad, to: expected[0], ..still };
        let first = placed.moved(pose);
        placed.left_over = std::array::from_fn(|joint| sub(expected[joint], first[joint]));
        placed
    }

    /// Heights stay what they are.
    fn moved(&self, pose: &Pose) -> [Vec3; 22] {
        pose.map(|point| {
            let [x, y, z] = wide(point);
            let local = [x - self.origin[0], y, z - self.origin[2]];
            add(turn(local, self.turn_rad), [self.to[0], 0.0, self.to[2]])
        })
    }

    fn place(&self, pose: &Pose, since_s: f64) -> Pose {
        let t = (since_s / BLEND_S).clamp(0.0, 1.0);
        let left = 1.0 - t * t * (3.0 - 2.0 * t);
        let moved = self.moved(pose);
        std::array::from_fn(|joint| narrow(add(moved[joint], scale(self.left_over[joint], left))))
    }
}

/// A pose with the upper body of another one, in the heading of its own pelvis.
fn with_upper_body(pose: &Pose, other: &Pose) -> Pose {
    let turn_rad = heading_rad(pose) - heading_rad(other);
    BodyJoint::ALL.map(|joint| match is_upper(joint) {
        true => {
            let local = sub(wide(other[joint as usize]), wide(other[0]));
            narrow(add(wide(pose[0]), turn(local, turn_rad)))
        }
        false => pose[joint as usize],
    })
}

/// Where the upper body is on average in a figure, from the pelvis, without heading.
fn mean_upper(clip: &Clip, figure: &Figure) -> [Vec3; 22] {
    const SAMPLES: usize = 12;
    let mut mean = [[0.0; 3]; 22];
    for sample in 0..SAMPLES {
        let beats = figure.beats() as f64 * sample as f64 / SAMPLES as f64;
        let pose = clip.pose_at(source_time_s(&figure.beats_s, beats, 0.0));
        for (mean, point) in mean.iter_mut().zip(from_pelvis(&pose)) {
            *mean = add(*mean, scale(point, 1.0 / SAMPLES as f64));
        }
    }
    mean
}

fn from_pelvis(pose: &Pose) -> [Vec3; 22] {
    let heading = heading_rad(pose);
    pose.map(|point| turn(sub(wide(point), wide(pose[0])), -heading))
}

/// The upper body moves more or less around its mean.
fn resized(pose: &Pose, mean: &[Vec3; 22], size: f64) -> Pose {
    let (heading, local) = (heading_rad(pose), from_pelvis(pose));
    BodyJoint::ALL.map(|joint| {
        let at = joint as usize;
        match is_upper(joint) {
            true => {
                let resized = lerp(mean[at], local[at], size);
                narrow(add(wide(pose[0]), turn(resized, heading)))
            }
            false => pose[at],
        }
    })
}
