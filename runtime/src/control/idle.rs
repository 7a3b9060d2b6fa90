//! What the robot does while there is no music, or none whose beat it is sure of: it
//! breathes and sways a little.
//!
//! ```text
//!            music and its beat
//!   Idle ------------------------> Dance
//!    ^                               |
//!    +- no music, sound or beat -----+      each way over FADE_S
//! ```
//!
//! Idle is motion of the same 22 human joints, so that every robot can. Dance
//! and idle are blended bone by bone: directions are mixed, so that limbs keep
//! their lengths; what a robot makes of it stays inside its limits as always.
//! Robot axes: x forward, y left, z up; metres, radians, seconds.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use servodance_model::motion::skeleton::BONE_LENGTH_M;
use servodance_retarget::BodyPoints;
use servodance_retarget::nalgebra::{Rotation3, Vector3};
use servodance_types::BodyJoint::{self, *};
use servodance_types::{BeatLock, MusicFrame};
use std::f64::consts::TAU;

/// Presence of music above which the robot dances, and below which it idles.
const MUSIC: f32 = 0.45;
const NO_MUSIC: f32 = 0.3;
/// The beat may be lost for so long before the robot idles, seconds.
const LOST_S: f64 = 1.0;
/// From dance to idle and back, seconds.
const FADE_S: f64 = 1.0;
/// Nothing heard for so long is no music, seconds.
const DEAF_S: f64 = 0.7;
/// Mean level of silence, in units of 20 dB with 0 at 40 dB below the loudest
/// of late (`audio::spectral`), and how long it must last. Said sooner than by
/// the presence of music, which is steady over seconds.
const SILENT_LEVEL: f32 = -1.5;
const SILENT_S: f64 = 0.6;
/// Where the level stands in the music features.
const LEVEL: usize = 1;
/// Hips over the floor, knees a little bent, metres.
const HIPS_M: f64 = 0.80;
/// Breaths, sways and looks a second; they never meet.
const BREATH_HZ: f64 = 0.25;
const SWAY_HZ: f64 = 0.11;
const LOOK_HZ: f64 = 0.07;

/// What to do while there is no music.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum IdleStyle {
    /// Stand, breathe, sway a little and look around.
    #[default]
    Sway,
    /// Hold the pose in which the music ended.
    Hold,
    /// Stand still, arms down.
    Rest,
}

/// Where a body stands and which way it faces.
#[derive(Clone, Copy, Debug, Default)]
struct GroundPose {
    yaw: f64,
    x: f64,
    y: f64,
}

impl GroundPose {
    fn of(points: &BodyPoints) -> Self {
        let left = points[LeftHip as usize] - points[RightHip as usize];
        let pelvis = points[Pelvis as usize];
        Self { yaw: (-left.x).atan2(left.y), x: pelvis.x, y: pelvis.y }
    }

    /// From a body at the origin that faces x to this pose.
    fn apply(&self, points: &mut BodyPoints) {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.yaw);
        let shift = Vector3::new(self.x, self.y, 0.0);
        points.iter_mut().for_each(|p| *p = turn * *p + shift);
    }

    fn remove(&self, points: &mut BodyPoints) {
        let back = Rotation3::from_axis_angle(&Vector3::z_axis(), -self.yaw);
        let shift = Vector3::new(self.x, self.y, 0.0);
        points.iter_mut().for_each(|p| *p = back * (*p - shift));
    }
}

/// Fades between the dance and idle.
#[derive(Clone, Debug)]
pub struct Idle {
    style: IdleStyle,
    period_s: f64,
    music: bool,
    /// Time and presence of music of the newest frame.
    heard: Option<(f64, f32)>,
    loud_s: f64,
    /// When the beat was last known.
    beat_s: f64,
    /// 0 dance, 1 idle; before easing.
    faded: f64,
    time_s: f64,
    idled_cycles: u64,
    place: GroundPose,
    /// The idle body while the style is to hold, at the origin.
    held: Option<BodyPoints>,
    /// The idle body of a style that was changed, at the origin, and how much of
    /// it is left, 1 to 0.
    leaving: Option<(BodyPoints, f64)>,
    /// Brings the dancer, who may have moved while hidden, to where the robot is.
    from: GroundPose,
    to: GroundPose,
}

impl Idle {
    /// Idle until music is heard; one call of [`step`](Self::step) each `period_s`.
    pub fn new(style: IdleStyle, period_s: f64) -> Self {
        Self {
            style,
            period_s,
            music: false,
            heard: None,
            loud_s: f64::NEG_INFINITY,
            beat_s: f64::NEG_INFINITY,
            faded: 1.0,
            time_s: 0.0,
            idled_cycles: 0,
            place: GroundPose::default(),
            held: None,
            leaving: None,
            from: GroundPose::default(),
            to: GroundPose::default(),
        }
    }

    /// Takes in level and presence of music, and whether its beat is known.
    pub fn hear(&mut self, music: &MusicFrame) {
        self.heard = Some((music.time_s, music.presence));
        if music.spectral[LEVEL] > SILENT_LEVEL {
            self.loud_s = music.time_s;
        }
        if music.beat.lock != BeatLock::Lost {
            self.beat_s = music.time_s;
        }
    }

    /// Another style from now on, faded in as slowly as from a dance.
    pub fn set_style(&mut self, style: IdleStyle) {
        if style == self.style {
            return;
        }
        let present = self.body();
        self.leaving = (self.faded > 0.0).then_some((present, 1.0));
        self.held = (self.style != IdleStyle::Hold && style == IdleStyle::Hold).then_some(present);
        self.style = style;
    }

    /// Share of idle in what is seen, 0 to 1.
    pub fn share(&self) -> f64 {
        eased(self.faded)
    }

    /// Seconds of idle so far.
    pub fn idled_s(&self) -> f64 {
        self.idled_cycles as f64 * self.period_s
    }

    /// One cycle at music time `now_s`: `dance` is the dancer's pose, if there is
    /// one; what comes back is the pose to show.
    pub fn step(&mut self, now_s: f64, dance: Option<BodyPoints>) -> Option<BodyPoints> {
        let before = self.music;
        self.music = self.is_music(now_s);
        self.time_s += self.period_s;
        self.idled_cycles += u64::from(self.faded > 0.5 && now_s >= 0.0);
        let mut dance = dance?;
        if before != self.music && self.faded >= 1.0 {
            // The dancer is hidden: the dance may begin where the robot is.
            self.from = GroundPose::of(&dance);
            self.to = self.place;
        }
        self.from.remove(&mut dance);
        self.to.apply(&mut dance);
        if before != self.music && self.faded <= 0.0 {
            self.place = GroundPose::of(&dance);
            self.leaving = None;
            self.held = (self.style == IdleStyle::Hold).then(|| {
                let mut held = dance;
                self.place.remove(&mut held);
                held
            });
        }
        let step = self.period_s / FADE_S;
        self.faded = (self.faded + if self.music { -step } else { step }).clamp(0.0, 1.0);
        if self.faded <= 0.0 {
            return Some(dance);
        }
        if let Some((_, left)) = &mut self.leaving {
            *left -= step;
        }
        self.leaving = self.leaving.filter(|(_, left)| *left > 0.0);
        let mut idle = self.body();
        self.place.apply(&mut idle);
        Some(blend(&dance, &idle, self.share()))
    }

    /// The idle body of this cycle at the origin.
    fn body(&self) -> BodyPoints {
        let body = match (&self.held, self.style) {
            (Some(held), _) => *held,
            (None, IdleStyle::Sway) => pose(self.time_s, 1.0),
            (None, _) => pose(self.time_s, 0.0),
        };
        match &self.leaving {
            Some((before, left)) => blend(&body, before, eased(*left)),
            None => body,
        }
    }

    fn is_music(&self, now_s: f64) -> bool {
        match self.heard {
            Some((time_s, _)) if now_s - time_s > DEAF_S => false,
            Some((time_s, _)) if time_s - self.loud_s > SILENT_S => false,
            Some((time_s, _)) if time_s - self.beat_s > LOST_S => false,
            Some((_, presence)) => presence > if self.music { NO_MUSIC } else { MUSIC },
            None => false,
        }
    }
}

/// A share of the way, slow at both ends (quintic).
fn eased(share: f64) -> f64 {
    share * share * share * (10.0 + share * (-15.0 + share * 6.0))
}

/// `share` of `b` in `a`: bone directions are mixed, lengths kept.
fn blend(a: &BodyPoints, b: &BodyPoints, share: f64) -> BodyPoints {
    let mut out = *a;
    out[0] = a[0].lerp(&b[0], share);
    for joint in BodyJoint::ALL {
        let Some(parent) = joint.parent() else {
            continue;
        };
        let (joint, parent) = (joint as usize, parent as usize);
        let (from, to) = (a[joint] - a[parent], b[joint] - b[parent]);
        let length = from.norm() + share * (to.norm() - from.norm());
        let mixed = from.lerp(&to, share);
        let bone = mixed.try_normalize(1e-6).map_or(mixed, |direction| direction * length);
        out[joint] = out[parent] + bone;
    }
    out
}

/// The idle body standing still with its arms raised to the sides and its head
/// bent by a share: the gesture of the click test.
pub fn greeting(raised: f64) -> BodyPoints {
    let still = pose(0.0, 0.0);
    let mut up = still;
    for (joint, parent) in [
        (LeftElbow, LeftShoulder),
        (LeftWrist, LeftElbow),
        (RightElbow, RightShoulder),
        (RightWrist, RightElbow),
    ] {
        let out = Vector3::new(0.3, side_of(joint), -0.3).normalize();
        let length = BONE_LENGTH_M[joint as usize];
        up[joint as usize] = up[parent as usize] + out * length;
    }
    let bent = Vector3::new(0.5, 0.0, 1.0).normalize();
    up[Head as usize] = up[Neck as usize] + bent * BONE_LENGTH_M[Head as usize];
    blend(&still, &up, raised)
}

/// The idle body at the origin, facing x; `lively` scales its movement.
fn pose(time_s: f64, lively: f64) -> BodyPoints {
    let wave = |hz: f64, amplitude: f64| lively * amplitude * (TAU * hz * time_s).sin();
    let breath = lively * 0.5 * (1.0 - (TAU * BREATH_HZ * time_s).cos());
    let sway = wave(SWAY_HZ, 1.0);
    let mut points = [Vector3::zeros(); 22];
    points[Pelvis as usize] = Vector3::new(0.0, 0.045 * sway, HIPS_M + 0.08 + 0.012 * breath);
    let lean = Vector3::new(0.03 - 0.05 * breath, 0.04 * sway, 1.0);
    let look = wave(LOOK_HZ, 0.4);
    for joint in BodyJoint::ALL {
        let Some(parent) = joint.parent() else {
            continue;
        };
        let side = side_of(joint);
        let direction = match joint {
            LeftHip | RightHip => Vector3::new(0.0, side * 0.6, -0.8),
            LeftCollar | RightCollar => Vector3::new(0.0, side * 0.7, 0.6 + 0.1 * breath),
            LeftShoulder | RightShoulder => Vector3::new(0.0, side, -0.15 + 0.1 * breath),
            LeftElbow | RightElbow => {
                Vector3::new(-0.05 - 0.05 * sway * side, side * (0.22 + 0.22 * breath), -1.0)
            }
            LeftWrist | RightWrist => {
                Vector3::new(0.25 + 0.25 * breath + 0.05 * sway * side, side * 0.08, -1.0)
            }
            LeftKnee | RightKnee | LeftAnkle | RightAnkle => {
                leg(&points[Pelvis as usize], joint, side)
            }
            LeftFoot | RightFoot => Vector3::new(1.0, side * 0.2, -0.3),
            Head => Vector3::new(0.15 + 0.06 * breath, look, 1.0),
            _ => lean,
        };
        let length = match joint {
            LeftKnee | RightKnee | LeftAnkle | RightAnkle => direction.norm(),
            _ => BONE_LENGTH_M[joint as usize],
        };
        points[joint as usize] = points[parent as usize] + direction.normalize() * length;
    }
    points
}

/// Thigh or shank of a leg whose foot stays where it is.
fn leg(pelvis: &Vector3<f64>, joint: BodyJoint, side: f64) -> Vector3<f64> {
    let hip = pelvis + Vector3::new(0.0, side * 0.6, -0.8) * BONE_LENGTH_M[LeftHip as usize];
    let ankle = Vector3::new(0.0, side * 0.09, 0.07);
    let knee = (hip + ankle) * 0.5 + Vector3::new(0.06, 0.0, 0.0);
    match joint {
        LeftKnee | RightKnee => knee - hip,
        _ => ankle - knee,
    }
}

/// 1 left, -1 right.
fn side_of(joint: BodyJoint) -> f64 {
    match joint.name().as_bytes().first() {
        Some(b'l') => 1.0,
        Some(b'r') => -1.0,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::Beat;

    const CYCLE_S: f64 = 0.01;

    fn heard(time_s: f64, presence: f32) -> MusicFrame {
        let beat = Beat { lock: BeatLock::Locked, ..Beat::default() };
        MusicFrame { time_s, presence, beat, ..MusicFrame::default() }
    }

    /// A dancer who is elsewhere and turns all the time.
    fn dancer(time_s: f64) -> BodyPoints {
        let mut points = pose(8.0 * time_s, 1.0);
        let place = GroundPose { yaw: time_s, x: 1.0 + 0.2 * time_s, y: -0.5 };
        place.apply(&mut points);
        points
    }

    fn fastest_m_s(a: &BodyPoints, b: &BodyPoints) -> f64 {
        let steps = a.iter().zip(b).map(|(a, b)| (b - a).norm() / CYCLE_S);
        steps.fold(0.0, f64::max)
    }

    #[test]
    fn a_break_is_idled_through_without_a_jump_and_the_dance_comes_back() {
        let mut idle = Idle::new(IdleStyle::Sway, CYCLE_S);
        let (mut last, mut shares) = (None, Vec::new());
        for cycle in 0..3000 {
            let now_s = f64::from(cycle) * CYCLE_S;
            let presence = if (10.0..20.0).contains(&now_s) { 0.0 } else { 0.9 };
            idle.hear(&heard(now_s, presence));
            let shown = idle.step(now_s, Some(dancer(now_s))).unwrap();
            if let Some(last) = &last {
                let speed = fastest_m_s(last, &shown);
                assert!(speed < 4.0, "{speed} m/s at {now_s}");
                assert!(speed > 1e-3, "stands still at {now_s}");
            }
            last = Some(shown);
            shares.push(idle.share());
        }
        for (at_s, share) in [(5.0, 0.0), (11.5, 1.0), (19.9, 1.0), (21.5, 0.0)] {
            assert_eq!(shares[(at_s / CYCLE_S) as usize], share, "at {at_s} s");
        }
    }

    #[test]
    fn another_style_is_taken_up_without_a_jump() {
        let mut idle = Idle::new(IdleStyle::Sway, CYCLE_S);
        let mut last: Option<BodyPoints> = None;
        let styles = [IdleStyle::Rest, IdleStyle::Sway, IdleStyle::Hold];
        for cycle in 0..900 {
            if cycle % 70 == 0 {
                idle.set_style(styles[cycle / 70 % 3]);
            }
            let shown = idle.step(0.0, Some(pose(0.0, 0.0))).unwrap();
            let speed = last.map_or(0.0, |last| fastest_m_s(&last, &shown));
            assert!(speed < 0.5, "{speed} m/s in cycle {cycle}");
            last = Some(shown);
        }
    }

    #[test]
    fn bones_keep_their_lengths_in_every_mixture() {
        let (a, b) = (dancer(3.0), pose(0.0, 1.0));
        for share in [0.0, 0.3, 0.7, 1.0] {
            let mixed = blend(&a, &b, share);
            let arm = (mixed[LeftWrist as usize] - mixed[LeftElbow as usize]).norm();
            let length = BONE_LENGTH_M[LeftWrist as usize];
            assert!((arm - length).abs() < 1e-9, "{arm} at {share}");
        }
    }

    #[test]
    fn music_without_a_beat_is_not_danced_to() {
        let mut idle = Idle::new(IdleStyle::Sway, CYCLE_S);
        let mut shares = Vec::new();
        for cycle in 0..1500 {
            let now_s = f64::from(cycle) * CYCLE_S;
            let mut music = heard(now_s, 0.9);
            if !(3.0..8.0).contains(&now_s) {
                music.beat.lock = BeatLock::Lost;
            }
            idle.hear(&music);
            idle.step(now_s, Some(dancer(now_s)));
            shares.push(idle.share());
        }
        for (at_s, share) in [(2.9, 1.0), (4.5, 0.0), (8.9, 0.0), (10.5, 1.0)] {
            assert_eq!(shares[(at_s / CYCLE_S) as usize], share, "at {at_s} s");
        }
    }

    #[test]
    fn silence_of_the_source_counts_as_no_music() {
        let mut idle = Idle::new(IdleStyle::Hold, CYCLE_S);
        for cycle in 0..500 {
            let now_s = f64::from(cycle) * CYCLE_S;
            if now_s < 2.0 {
                idle.hear(&heard(now_s, 1.0));
            }
            idle.step(now_s, Some(dancer(1.0)));
        }
        assert_eq!(idle.share(), 1.0);
        let (a, b) = (idle.step(5.0, Some(dancer(9.0))), idle.step(5.01, Some(dancer(9.5))));
        assert_eq!(a, b, "the pose is held");
    }
}
