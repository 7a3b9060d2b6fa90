//! Figures of captured dance: stretches of 2, 4 and 8 beats between kinematic beats.

use crate::dataset::clip_entry::{ClipEntry, Split};
use crate::metrics::quality::foot_skate_ratio;
use crate::metrics::repetition::{BodyPose, body_pose};
use crate::metrics::richness::is_leg;
use crate::motion::tempo;
use servodance_model::motion::vec3::{norm, scale, sub};
use servodance_model::motion::{Clip, Pose, mean_joint_speed};
use servodance_types::{BodyJoint, FRAME_RATE_HZ};
use std::path::Path;

/// Lengths, beats.
const BEATS: [usize; 3] = [2, 4, 8];
/// Dances whose kinematic beats meet their own grid less well have no beat to cut at (F1).
const USABLE_F1: f64 = 0.5;
/// The dancer is upright: the pelvis this high, the head so far above it, metres.
const PELVIS_M: f32 = 0.5;
const HEAD_M: f32 = 0.3;
/// No joint of a sound figure is faster, m/s.
const FASTEST_M_S: f64 = 9.0;
/// Feet of a sound figure skate in at most so much of their time on the floor.
const MOST_SKATE: f64 = 0.2;
/// Seconds of velocity that a difference of poses is worth when figures are joined.
const VELOCITY_S: f64 = 0.08;
/// What a foot is worth that stands in one of two poses alone, metres a joint.
const CONTACT_M: f64 = 0.03;

/// How a body moves at one moment, without place and heading.
#[derive(Clone, Debug)]
pub struct JoinState {
    pose: BodyPose,
    velocity: BodyPose,
    feet: [bool; 2],
}

impl JoinState {
    fn of(clip: &Clip, time_s: f64) -> Self {
        let step_s = 1.0 / clip.fps;
        let [before, pose, after] =
            [time_s - step_s, time_s, time_s + step_s].map(|t| body_pose(&clip.pose_at(t)));
        let speed = 0.5 * clip.fps;
        let velocity = std::array::from_fn(|j| scale(sub(after[j], before[j]), speed));
        Self { pose, velocity, feet: super::feet::standing(clip, time_s) }
    }

    /// How badly one moment goes over into another, metres a joint.
    pub fn distance_m(&self, next: &Self) -> f64 {
        let apart = |a: &BodyPose, b: &BodyPose| {
            let sum: f64 = a.iter().zip(b).map(|(a, b)| norm(sub(*a, *b))).sum();
            sum / a.len() as f64
        };
        let feet = (0..2).filter(|foot| self.feet[*foot] != next.feet[*foot]).count();
        apart(&self.pose, &next.pose)
            + VELOCITY_S * apart(&self.velocity, &next.velocity)
            + CONTACT_M * feet as f64
    }
}

/// A figure: which beats of which dance.
#[derive(Clone, Debug)]
pub struct Figure {
    /// A dance of the library; mirrored dances are dances of their own.
    pub clip: usize,
    pub style: usize,
    /// Times of its beats in that dance, one more than it has beats, seconds.
    pub beats_s: Vec<f64>,
    /// Mean joint speed, m/s.
    pub speed_m_s: f64,
    pub entry: JoinState,
    pub exit: JoinState,
    /// The same figure in the mirror.
    pub mirrored: usize,
}

impl Figure {
    pub fn beats(&self) -> usize {
        self.beats_s.len() - 1
    }

    /// Seconds of a beat.
    pub fn period_s(&self) -> f64 {
        (self.beats_s[self.beats()] - self.beats_s[0]) / self.beats() as f64
    }
}

/// The figures of one split, and the dances that they are cut from.
#[derive(Clone, Debug, Default)]
pub struct FigureLibrary {
    pub clips: Vec<Clip>,
    pub figures: Vec<Figure>,
    styles: Vec<usize>,
}

impl FigureLibrary {
    /// Cuts the captured dances of a split. Files that cannot be read are left out (they are
    /// named where the dances themselves are collected).
    pub fn cut(folder: &Path, entries: &[ClipEntry], split: Split) -> Self {
        let mut library = Self::default();
        for entry in entries.iter().filter(|entry| entry.dance && entry.split == split) {
            let Ok(clip) = Clip::read_npz(entry.path(folder)) else { continue };
            library.add(&clip.normalised(), entry.style());
        }
        library
    }

    fn add(&mut self, clip: &Clip, style: usize) {
        let Some(tempo) = tempo::estimate(clip).filter(|tempo| tempo.f1 >= USABLE_F1) else {
            return;
        };
        let pair = [clip.clone(), clip.mirrored().normalised()];
        let first_clip = self.clips.len();
        let mut count = 0;
        for beats in BEATS {
            // A figure begins on every second beat: half a bar.
            for from in (0..tempo.beats_s.len().saturating_sub(beats)).step_by(2) {
                let beats_s = &tempo.beats_s[from..=from + beats];
                if !is_sound(clip, beats_s[0], beats_s[beats]) {
                    continue;
                }
                for (side, clip) in pair.iter().enumerate() {
                    let mirrored = self.figures.len() + 1 - 2 * side;
                    self.figures.push(Figure {
                        clip: first_clip + side,
                        style,
                        beats_s: beats_s.to_vec(),
                        speed_m_s: mean_speed(clip, beats_s[0], beats_s[beats]),
                        entry: JoinState::of(clip, beats_s[0]),
                        exit: JoinState::of(clip, beats_s[beats]),
                        mirrored,
                    });
                }
                count += 1;
            }
        }
        if count > 0 {
            self.clips.extend(pair);
            if !self.styles.contains(&style) {
                self.styles.push(style);
            }
        }
    }

    pub fn is_empty(&self) -> bool {
        self.figures.is_empty()
    }

    /// Styles that there are figures of.
    pub fn styles(&self) -> &[usize] {
        &self.styles
    }

    /// Median seconds of a beat over the figures of a style.
    pub fn usual_period_s(&self, style: usize) -> f64 {
        let of_style = self.figures.iter().filter(|figure| figure.style == style);
        let mut periods: Vec<f64> = of_style.map(Figure::period_s).collect();
        periods.sort_by(f64::total_cmp);
        periods.get(periods.len() / 2).copied().unwrap_or(0.5)
    }
}

/// Whether the dancer is on both feet, which stand still enough, and nothing jumps.
fn is_sound(clip: &Clip, from_s: f64, until_s: f64) -> bool {
    let frame = |time_s: f64| ((time_s * clip.fps) as usize).min(clip.poses.len() - 1);
    let poses = &clip.poses[frame(from_s)..=frame(until_s)];
    let upright = |pose: &Pose| {
        let [pelvis, head] = [pose[0], pose[BodyJoint::Head as usize]].map(|point| point[1]);
        pelvis > PELVIS_M && head - pelvis > HEAD_M
    };
    let slow = |pair: &[Pose]| {
        (0..pair[0].len()).all(|joint| {
            let step = [0, 1, 2].map(|k| f64::from(pair[1][joint][k] - pair[0][joint][k]));
            norm(step) * FRAME_RATE_HZ <= FASTEST_M_S
        })
    };
    let skate = || foot_skate_ratio(&Clip::of_frames(poses.to_vec())).unwrap_or(0.0);
    poses.iter().all(upright) && poses.windows(2).all(slow) && skate() <= MOST_SKATE
}

pub(super) fn is_upper(joint: BodyJoint) -> bool {
    joint != BodyJoint::Pelvis && !is_leg(joint)
}

fn mean_speed(clip: &Clip, from_s: f64, until_s: f64) -> f64 {
    let frame = |time_s: f64| ((time_s * clip.fps) as usize).min(clip.poses.len() - 1);
    let speed = mean_joint_speed(&clip.poses[frame(from_s)..=frame(until_s)], clip.fps);
    speed.iter().sum::<f64>() / speed.len().max(1) as f64
}
