//! A choreographer: dance on given beats, from a grammar of figures.
//!
//! Input: beat times in seconds, with downbeats. Output: 22 joints at 20 FPS
//! on the common skeleton. Step, torso and arm figures are combined into
//! phrases of eight counts, repeated, mirrored and varied; every movement is
//! minimum-jerk and arrives on its count. Planted toes do not slide. Before
//! the first beat, after the last and in breaks the dancer stands and breathes.
//!
//! Same beats, style and seed: the same dance. It supplements captured motion
//! for training; it is no motion capture and does not pretend to be.

mod arms;
mod body;
mod legs;
mod style;
mod torso;
mod track;

pub use style::DanceStyle;

use std::f64::consts::TAU;

use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_types::FRAME_RATE_HZ;

use self::arms::{ArmDirections, Arms};
use self::body::{BodyControls, Torso};
use self::legs::{StepStance, Steps};
use self::style::StyleParameters;
use self::torso::Trunk;
use self::track::{KeyTrack, bump, minimum_jerk, mix};
use servodance_model::motion::Clip;

/// One beat of the music to dance to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DanceBeat {
    /// When it sounds, seconds.
    pub time_s: f64,
    /// Whether a bar begins here.
    pub downbeat: bool,
}

/// Faster beats than this are danced in half time, seconds.
const HALF_TIME_BELOW_S: f64 = 0.40;
/// Slower beats than this may carry double-time arms, seconds.
const DOUBLE_TIME_ABOVE_S: f64 = 0.74;
const TORSO_SIZE: f64 = 1.15;
/// A pause of this many beats is a break: the dancer waits.
const BREAK_BEATS: f64 = 2.6;
/// So long a dancer listens and finds the groove, seconds (at least 4 beats).
const LISTENING_S: f64 = 2.5;

/// Twenty seconds of disco at 120 beats a minute, to try a new robot with.
pub fn trial_dance() -> Clip {
    let beats: Vec<DanceBeat> = (0..40)
        .map(|beat| DanceBeat { time_s: f64::from(beat) * 0.5, downbeat: beat % 4 == 0 })
        .collect();
    choreograph(&beats, 20.0, DanceStyle::Disco, 1)
}

/// Dances for `duration_s` seconds on `beats` (sorted by time).
pub fn choreograph(beats: &[DanceBeat], duration_s: f64, style: DanceStyle, seed: u64) -> Clip {
    let mut dancer = Choreographer::new(style, seed);
    for stretch in stretches(beats) {
        dancer.idle_until(stretch[0].time_s);
        dancer.dance(stretch);
    }
    dancer.idle_until(duration_s);
    let frames = (duration_s * FRAME_RATE_HZ).floor() as usize + 1;
    let times = (0..frames).map(|i| i as f64 / FRAME_RATE_HZ);
    Clip {
        name: format!("choreography {} {seed}", style.name()),
        fps: FRAME_RATE_HZ,
        poses: times.map(|t| body::pose(&dancer.controls(t, beats))).collect(),
    }
}

/// The beats between breaks, each at least four beats long.
fn stretches(beats: &[DanceBeat]) -> Vec<&[DanceBeat]> {
    let usual_s = usual_interval_s(beats);
    beats
        .chunk_by(|a, b| b.time_s - a.time_s < BREAK_BEATS * usual_s)
        .filter(|stretch| stretch.len() >= 4)
        .collect()
}

/// The median interval of `beats`; half a second where there is none.
fn usual_interval_s(beats: &[DanceBeat]) -> f64 {
    let mut gaps: Vec<f64> = beats.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied().unwrap_or(0.5)
}

#[derive(Clone, Copy, Debug)]
struct Phrase {
    steps: Steps,
    arms: Arms,
    trunk: Trunk,
    mirrored: bool,
    size: f64,
    /// The second half uses these arms.
    other_arms: Arms,
}

/// What is this dancer's own: nobody dances a figure like another.
#[derive(Clone, Copy, Debug)]
struct DancerTraits {
    size: f64,
    arm_size: f64,
    posture: f64,
    lean: f64,
    bounce: f64,
    arm_habit: [[[f64; 3]; 2]; 2],
    phases: [f64; 8],
}

struct Choreographer {
    rng: ChaCha8Rng,
    style: DanceStyle,
    parameters: StyleParameters,
    traits: DancerTraits,
    place: [f64; 2],
    facing: f64,
    feet: KeyTrack<StepStance>,
    torso: KeyTrack<[f64; 13]>,
    arms: KeyTrack<[ArmDirections; 2]>,
    /// How much bounce and nod: 0 idle, 1 dancing.
    energy: KeyTrack<f64>,
}

impl Choreographer {
    fn new(style: DanceStyle, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let traits = DancerTraits {
            size: rng.random_range(0.9..1.25),
            arm_size: rng.random_range(0.85..1.15),
            posture: rng.random_range(-0.03..0.09),
            lean: rng.random_range(-0.03..0.03),
            bounce: rng.random_range(0.6..1.4),
            arm_habit: std::array::from_fn(|_| {
                std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-0.10..0.10)))
            }),
            phases: std::array::from_fn(|_| rng.random_range(0.0..TAU)),
        };
        Self {
            style,
            parameters: style.parameters(),
            traits,
            place: [0.0; 2],
            facing: 0.0,
            feet: KeyTrack::starting_with(StepStance::home()),
            torso: KeyTrack::starting_with(Torso::default().to_array()),
            arms: KeyTrack::starting_with(arms::resting(0.0)),
            energy: KeyTrack::starting_with(0.0),
            rng,
        }
    }

    /// Stands until `end_s`: weight from foot to foot, a look around.
    fn idle_until(&mut self, end_s: f64) {
        let start_s = self.feet.last_time_s();
        if end_s - start_s < 1.2 {
            return;
        }
        let calm_s = (start_s + 0.7).min(end_s);
        let home = StepStance::home().placed(self.place, self.facing);
        let home = home.following(self.feet.last());
        self.feet.push(calm_s, home);
        self.torso.push(calm_s, [0.0; 13]);
        self.arms.push(calm_s, arms::resting(0.0));
        if start_s > 0.0 {
            self.energy.push(start_s, 1.0);
        }
        self.energy.push(calm_s, 0.0);
        let mut t = calm_s;
        loop {
            t += self.rng.random_range(1.4..3.2);
            if t > end_s - 0.8 {
                break;
            }
            let weight = self.rng.random_range(0.25..0.75);
            let mut stance = home;
            stance.weight = weight;
            stance.drop = self.rng.random_range(0.005..0.03);
            self.feet.push(t, stance);
            let torso = Torso {
                spine: [
                    self.rng.random_range(0.0..0.06),
                    self.rng.random_range(-0.05..0.05),
                    self.rng.random_range(-0.12..0.12),
                ],
                pelvis: [0.0, 0.10 * (weight - 0.5), 0.0],
                head: [self.rng.random_range(-0.08..0.15), 0.0, self.rng.random_range(-0.45..0.45)],
                ..Torso::default()
            };
            self.torso.push(t, torso.to_array());
            let sway = self.rng.random_range(-1.0..1.0);
            self.arms.push(t, arms::resting(sway));
        }
        // What comes next starts from here, not from a slow drift.
        let ready_s = (end_s - 0.45).max(self.feet.last_time_s());
        let (stance, torso, arms) = (*self.feet.last(), *self.torso.last(), *self.arms.last());
        self.feet.push(ready_s, stance);
        self.torso.push(ready_s, torso);
        self.arms.push(ready_s, arms);
        self.energy.push(ready_s, 0.0);
    }

    /// Dances one stretch of beats: finds the groove, then phrase by phrase.
    fn dance(&mut self, beats: &[DanceBeat]) {
        let interval_s = usual_interval_s(beats);
        let half_time = interval_s < HALF_TIME_BELOW_S && self.rng.random_bool(0.75);
        let per_count = if half_time { 2 } else { 1 };
        let count_s = interval_s * per_count as f64;
        let double_arms = count_s > DOUBLE_TIME_ABOVE_S;
        // Far movements need time: keep hands and feet below sprinting speed.
        let pace = (count_s / 0.5).clamp(0.72, 1.25);

        let listening = ((LISTENING_S / interval_s).ceil() as usize).max(4);
        let first = listening.min(beats.len());
        let start =
            beats[first..].iter().position(|beat| beat.downbeat).map_or(first, |at| first + at);
        self.find_the_groove(&beats[..start]);
        let counts: Vec<f64> =
            beats[start..].iter().step_by(per_count).map(|beat| beat.time_s).collect();
        let mut theme = self.phrase(pace, None);
        for (number, phrase_counts) in counts.chunks(8).enumerate() {
            // A A' B A'' and then a new theme.
            let phrase = match number % 4 {
                0 => {
                    theme = self.phrase(pace, Some(theme.steps));
                    theme
                }
                1 => Phrase { mirrored: !theme.mirrored, ..theme },
                2 => self.phrase(pace, Some(theme.steps)),
                _ => Phrase { arms: theme.other_arms, size: (theme.size * 1.1).min(1.3), ..theme },
            };
            self.dance_phrase(&phrase, phrase_counts, double_arms);
        }
    }

    fn find_the_groove(&mut self, beats: &[DanceBeat]) {
        for (count, beat) in beats.iter().enumerate() {
            let growth = 0.35 + 0.5 * count as f64 / beats.len() as f64;
            let stance = Steps::Bounce.stance(count, growth);
            self.step_to(beat.time_s, stance);
            let torso = Trunk::Groove.torso(count, growth);
            self.torso.push(beat.time_s, torso.to_array());
            let arms = Arms::Swing.arms(count);
            let rest = arms::resting(0.0);
            let arms = [0, 1].map(|side| arms::blend(rest[side], arms[side], 0.6 * growth));
            self.arms.push(beat.time_s, arms);
            self.energy.push(beat.time_s, growth);
        }
    }

    fn phrase(&mut self, pace: f64, after: Option<Steps>) -> Phrase {
        let rng = &mut self.rng;
        let mut pick = || -> Steps { *self.style.steps().choose(rng).unwrap_or(&Steps::Bounce) };
        let mut steps = pick();
        if Some(steps) == after {
            steps = pick();
        }
        let rng = &mut self.rng;
        let arms = *self.style.arms().choose(rng).unwrap_or(&Arms::Swing);
        let other_arms = *self.style.arms().choose(rng).unwrap_or(&Arms::Swing);
        Phrase {
            steps,
            arms,
            other_arms,
            trunk: *self.style.trunks().choose(rng).unwrap_or(&Trunk::Groove),
            mirrored: rng.random_bool(0.5),
            size: (self.traits.size * pace * rng.random_range(0.9..1.15)).clamp(0.7, 1.3),
        }
    }

    fn dance_phrase(&mut self, phrase: &Phrase, counts: &[f64], double_arms: bool) {
        // Face roughly ahead, and come back when the place has wandered.
        let settle = (self.facing / TAU).round() * TAU;
        self.facing = settle + self.rng.random_range(-0.45..0.45);
        self.place = self.place.map(|p| 0.5 * p + self.rng.random_range(-0.06..0.06));
        let switch_arms = self.rng.random_bool(0.4);
        for (count, time_s) in counts.iter().copied().enumerate() {
            let mut stance = phrase.steps.stance(count, phrase.size);
            let mut torso = phrase.trunk.torso(count, TORSO_SIZE * phrase.size);
            let figure = if switch_arms && count >= 4 { phrase.other_arms } else { phrase.arms };
            if phrase.mirrored {
                stance = stance.mirrored();
                torso = torso::mirrored(torso);
            }
            self.step_to(time_s, stance);
            self.push_torso(time_s, torso);
            if double_arms && count > 0 {
                let before_s = counts[count - 1];
                self.push_arms((before_s + time_s) / 2.0, figure, 2 * count, phrase.mirrored);
                self.push_arms(time_s, figure, 2 * count + 1, phrase.mirrored);
            } else {
                self.push_arms(time_s, figure, count, phrase.mirrored);
            }
            self.energy.push(time_s, 1.0);
        }
        if counts.len() == 8 {
            let turn = phrase.steps.turns_rad();
            self.facing += if phrase.mirrored { -turn } else { turn };
        }
    }

    fn step_to(&mut self, time_s: f64, stance: StepStance) {
        let stance = stance.placed(self.place, self.facing);
        let stance = stance.following(self.feet.last());
        self.feet.push(time_s, stance);
    }

    fn push_torso(&mut self, time_s: f64, torso: Torso) {
        let mut angles = torso.to_array();
        for angle in &mut angles {
            *angle *= self.rng.random_range(0.85..1.15);
        }
        self.torso.push(time_s, angles);
    }

    fn push_arms(&mut self, time_s: f64, figure: Arms, count: usize, mirrored: bool) {
        let mut arms = figure.arms(count);
        if mirrored {
            arms.swap(0, 1);
        }
        for (arm, habit) in arms.iter_mut().zip(self.traits.arm_habit) {
            *arm = arms::sized(*arm, self.traits.arm_size);
            for (direction, habit) in arm.iter_mut().zip(habit) {
                for (value, habit) in direction.iter_mut().zip(habit) {
                    *value += habit + self.rng.random_range(-0.05..0.05);
                }
            }
        }
        self.arms.push(time_s, arms);
    }

    /// Everything at one moment: keys, bounce and nod, breath and life.
    fn controls(&self, time_s: f64, beats: &[DanceBeat]) -> BodyControls {
        let snap = self.parameters.snap;
        let (from, to, u) = self.feet.around(time_s);
        let (feet, pelvis, mut drop, yaw) = from.towards(to, u, snap);
        let (from, to, u) = self.torso.around(time_s);
        let mut torso = Torso::from_array(&mix(from, to, minimum_jerk(u, snap)));
        let (from, to, u) = self.arms.around(time_s);
        let t = minimum_jerk(u, snap);
        let mut arms = [0, 1].map(|side| arms::blend(from[side], to[side], t));
        let (from, to, u) = self.energy.around(time_s);
        let energy = from + (to - from) * minimum_jerk(u, 1.0);

        // Down on the beat, up between; quicker up than down.
        let phase = beat_phase(beats, time_s);
        let rise = bump(phase.powf(0.8));
        drop += energy * self.traits.bounce * self.parameters.bounce_m * (0.5 - rise);
        torso.head[0] += energy * self.parameters.nod_rad * (0.5 - rise);

        let wave =
            |k: usize, period_s: f64| (TAU * time_s / period_s + self.traits.phases[k]).sin();
        let breath = wave(0, 3.7 - 1.2 * energy);
        torso.spine[0] += self.traits.posture + 0.012 * breath;
        torso.spine[1] += self.traits.lean + 0.02 * wave(1, 5.3);
        torso.spine[2] += 0.025 * wave(2, 7.1);
        torso.head[1] += 0.03 * wave(3, 4.1);
        torso.head[2] += 0.05 * wave(4, 6.1);
        torso.shrug = torso.shrug.map(|s| s + 0.02 * breath);
        torso.hips[0] += 0.006 * wave(5, 4.7);
        torso.hips[1] += 0.006 * wave(6, 5.9);
        for arm in &mut arms {
            arm[1][1] += 0.03 * wave(7, 3.1);
        }
        BodyControls { feet, pelvis, drop, yaw, torso, arms }
    }
}

/// Where `time_s` is between its two beats, 0 to 1; 0 outside of them.
fn beat_phase(beats: &[DanceBeat], time_s: f64) -> f64 {
    let after = beats.partition_point(|beat| beat.time_s <= time_s);
    match (after.checked_sub(1).map(|i| beats[i]), beats.get(after)) {
        (Some(a), Some(b)) => (time_s - a.time_s) / (b.time_s - a.time_s),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use servodance_types::BodyJoint;

    use super::*;
    use servodance_model::motion::alignment::{alignment, mean_joint_speed};
    use servodance_model::motion::skeleton::{BONE_LENGTH_M, bone_length_m};

    fn beats(from_s: f64, interval_s: f64, until_s: f64) -> Vec<DanceBeat> {
        (0..)
            .map(|i| DanceBeat { time_s: from_s + f64::from(i) * interval_s, downbeat: i % 4 == 0 })
            .take_while(|beat| beat.time_s < until_s)
            .collect()
    }

    fn speed_between(clip: &Clip, from_s: f64, until_s: f64) -> f64 {
        let speed = mean_joint_speed(&clip.poses, clip.fps);
        let part = &speed[(from_s * 20.0) as usize..(until_s * 20.0) as usize];
        part.iter().sum::<f64>() / part.len() as f64
    }

    #[test]
    fn every_style_dances_on_the_beat() {
        for style in DanceStyle::ALL {
            for seed in 0..3 {
                let beats = beats(1.0, 0.5, 30.0);
                let times: Vec<f64> = beats.iter().map(|beat| beat.time_s).collect();
                let clip = choreograph(&beats, 30.0, style, seed);
                let speed = mean_joint_speed(&clip.poses, clip.fps);
                let on_beat = alignment(&speed, clip.fps, &times);
                let late: Vec<f64> = times.iter().map(|t| t + 0.25).collect();
                let off_beat = alignment(&speed, clip.fps, &late);
                assert!(on_beat.f1 > 0.9, "{style:?} {seed}: {on_beat:?}");
                assert!(off_beat.f1 < 0.3, "{style:?} {seed}: {off_beat:?}");
            }
        }
    }

    #[test]
    fn bones_are_constant_and_toes_stay_on_the_floor_and_in_place() {
        for style in DanceStyle::ALL {
            let clip = choreograph(&beats(1.0, 0.45, 40.0), 40.0, style, 5);
            let (mut planted, mut sliding) = (0, 0);
            for pair in clip.poses.windows(2) {
                for joint in BodyJoint::ALL {
                    let error = bone_length_m(&pair[0], joint) - BONE_LENGTH_M[joint as usize];
                    assert!(error.abs() < 1e-4, "{style:?} {}", joint.name());
                }
                for toe in [BodyJoint::LeftFoot, BodyJoint::RightFoot] {
                    let [a, b] = [0, 1].map(|k| pair[k][toe as usize]);
                    assert!(a[1] > 0.0, "{style:?}: toe below the floor");
                    if a[1] < 0.03 && b[1] < 0.03 {
                        planted += 1;
                        sliding += u32::from((a[0] - b[0]).hypot(a[2] - b[2]) > 0.015);
                    }
                }
            }
            assert!(planted > 400, "{style:?}: {planted} planted toes");
            assert!(sliding * 50 < planted, "{style:?}: {sliding} of {planted} slide");
        }
    }

    #[test]
    fn without_music_the_dancer_stands_and_breathes() {
        let mut broken = beats(4.0, 0.5, 14.0);
        broken.extend(beats(20.0, 0.5, 30.0));
        let clip = choreograph(&broken, 36.0, DanceStyle::Hype, 2);
        let dancing = speed_between(&clip, 8.0, 13.0);
        for (from_s, until_s) in [(0.5, 3.0), (15.5, 19.0), (31.5, 35.0)] {
            let idle = speed_between(&clip, from_s, until_s);
            assert!(idle > 0.002, "frozen at {from_s} s");
            assert!(idle < 0.3 * dancing, "{idle} m/s at {from_s} s, dancing {dancing}");
        }
    }

    #[test]
    fn a_seed_is_a_dance() {
        let beats = beats(0.5, 0.5, 20.0);
        let dance = |seed| choreograph(&beats, 20.0, DanceStyle::Groove, seed).poses;
        assert_eq!(dance(1), dance(1));
        assert_ne!(dance(1), dance(2));
    }

    #[test]
    fn no_beats_no_dance_and_no_panic() {
        let clip = choreograph(&[], 3.0, DanceStyle::Disco, 1);
        assert_eq!(clip.poses.len(), 61);
        assert!(speed_between(&clip, 0.0, 3.0) < 0.1);
    }
}
