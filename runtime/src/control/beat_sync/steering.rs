//! Steers the time of the motion so that the robot's kinematic beats fall on
//! the music's beats at the servo horn.
//!
//! ```text
//! motion frames --> trajectory preview --> kinematic beats, ahead --+
//!                                                                   +--> pace --> motion time
//! music frames ---> beat clock ----------> beats, predicted --------+
//! ```
//!
//! What is decided now is seen later: the retargeter plans `preview_s` ahead
//! and the motors lag. So each control cycle asks: the next kinematic beat of
//! the motion, when would it be seen, and when is the music beat that it was
//! made for? The pace of the motion goes so that both meet. It stays between
//! [`SLOWEST`] and [`FASTEST`], changes gently, and never goes back.
//!
//! On top of that the motion lingers on the music's beats, as dancers do, and makes up
//! for it between them ([`EMPHASIS`]): limbs that have no pause of their own on a beat, or
//! that cannot follow the dancer exactly, still show the beat.
//!
//! Live motion is made from music that is past. It is shown whole beats late,
//! as few as give the time to know a kinematic beat before it is due; a change
//! of tempo changes that delay at the same bounded pace. Seconds; motion time
//! and music time are one clock.

use super::beat_clock::BeatClock;
use super::trajectory_preview::TrajectoryPreview;
use servodance_types::{MotionFrame, MusicFrame};
use std::f64::consts::TAU;

/// Bounds of the pace of the motion.
const SLOWEST: f64 = 0.8;
const FASTEST: f64 = 1.25;
/// Fastest change of the pace, 1/s.
const PACE_CHANGE_PER_S: f64 = 6.0;
/// A kinematic beat this near to a music beat was made for it, beats.
const MEANT_BEATS: f64 = 0.28;
/// By how much the motion is slower on the music's beats than on the mean of a beat, and
/// faster halfway between them; a share of its pace.
const EMPHASIS: f64 = 0.8;
/// Fastest change of that, 1/s: what 240 beats a minute need; a beat that is lost or found
/// fades.
const EMPHASIS_CHANGE_PER_S: f64 = 20.0;
/// A music beat nearer than this is as good as gone, seconds.
const GONE_S: f64 = 0.06;
/// How far ahead of being decided on a kinematic beat shall be known, seconds.
const FORESIGHT_S: f64 = 0.35;
/// Without a beat to meet: share of the way home in a second.
const HOMING_PER_S: f64 = 0.5;
/// Farther from home than this, motion that is not seen jumps there, seconds.
const FAR_S: f64 = 0.5;
/// One whole beat more or less of delay is worth it beyond this, seconds.
const DELAY_SLACK_S: f64 = 0.15;
/// Delay of live motion while no tempo is known: in beats of this length.
const DEFAULT_PERIOD_S: f64 = 0.5;

/// Delays between a decision and its being seen.
#[derive(Clone, Copy, Debug)]
pub struct Horizon {
    /// From input to output of the retargeter, seconds.
    pub preview_s: f64,
    /// From output to the servo horn, seconds.
    pub servo_lag_s: f64,
    /// From a moment of live music to its motion frame, seconds; `None` where
    /// music is known ahead.
    pub live_s: Option<f64>,
}

/// The time of the motion, cycle by cycle.
pub struct BeatSteering {
    clock: BeatClock,
    preview: TrajectoryPreview,
    horizon: Horizon,
    period_s: f64,
    /// Motion time of the present cycle; `None` before the first.
    motion_s: Option<f64>,
    pace: f64,
    paces: [f64; 2],
    /// What the beat makes of the pace, about 1.
    emphasis: f64,
    beats_late: u32,
}

impl BeatSteering {
    /// `preview` has a copy of the robot's retargeter; one decision each `period_s`.
    pub fn new(preview: TrajectoryPreview, horizon: Horizon, period_s: f64) -> Self {
        let mut steering = Self {
            clock: BeatClock::default(),
            preview,
            horizon,
            period_s,
            motion_s: None,
            pace: 1.0,
            paces: [1.0; 2],
            emphasis: 1.0,
            beats_late: 0,
        };
        steering.beats_late = steering.fewest_beats_late(DEFAULT_PERIOD_S);
        steering
    }

    /// Seconds of motion that must be known beyond the motion time for
    /// kinematic beats to be seen in time.
    pub fn foresight_s(&self) -> f64 {
        self.horizon.preview_s + self.preview.delay_s() + FORESIGHT_S
    }

    pub fn push(&mut self, music: &MusicFrame, motion: &MotionFrame) {
        self.clock.push(music);
        self.preview.push(motion);
    }

    /// The motion time for the cycle at music time `now_s`. Live motion can be
    /// shown up to `shown_until_s`, beyond which it is waited for. While the
    /// motion is `hidden` its time may jump.
    pub fn next(&mut self, now_s: f64, shown_until_s: f64, hidden: bool) -> anyhow::Result<f64> {
        self.preview.advance()?;
        self.choose_delay();
        let home_s = now_s + self.lead_s();
        let far = |last_s: f64| hidden && (home_s - last_s).abs() > FAR_S;
        let last_s = match self.motion_s {
            Some(last_s) if !far(last_s) => last_s,
            _ => {
                self.motion_s = Some(home_s);
                self.pace = 1.0;
                return Ok(home_s);
            }
        };
        let seen_s = now_s + self.horizon.preview_s + self.horizon.servo_lag_s;
        let wanted = self
            .pace_to_next_beat(last_s + self.horizon.preview_s, seen_s)
            .unwrap_or(1.0 + HOMING_PER_S * (home_s - last_s))
            .clamp(SLOWEST, FASTEST);
        let most = PACE_CHANGE_PER_S * self.period_s;
        self.pace += (wanted - self.pace).clamp(-most, most);
        self.paces = [self.paces[0].min(self.pace), self.paces[1].max(self.pace)];
        self.emphasise(seen_s);
        let mut motion_s = last_s + self.pace * self.emphasis * self.period_s;
        if self.horizon.live_s.is_some() {
            motion_s = motion_s.min(shown_until_s.max(last_s));
        }
        self.motion_s = Some(motion_s);
        Ok(motion_s)
    }

    /// Slower on a beat, faster between: as it is when this cycle is seen.
    fn emphasise(&mut self, seen_s: f64) {
        let wanted = match self.clock.count_at(seen_s) {
            Some(count) => 1.0 - EMPHASIS * (TAU * count).cos(),
            None => 1.0,
        };
        let most = EMPHASIS_CHANGE_PER_S * self.period_s;
        self.emphasis += (wanted - self.emphasis).clamp(-most, most);
    }

    /// How much farther the emphasis brings the motion from `seen_s` to a beat than an even
    /// pace does, seconds: its integral.
    fn emphasis_ahead_s(&self, seen_s: f64) -> f64 {
        let so_far = self.clock.count_at(seen_s).map_or(0.0, |count| (TAU * count).sin());
        EMPHASIS / TAU * so_far * self.clock.period_s().unwrap_or(DEFAULT_PERIOD_S)
    }

    /// The slowest and the fastest pace so far, without the emphasis of beats.
    pub fn paces(&self) -> [f64; 2] {
        self.paces
    }

    /// By how much motion is ahead of the music where nothing is to be met;
    /// below zero when live.
    pub fn lead_s(&self) -> f64 {
        let period_s = self.clock.period_s().unwrap_or(DEFAULT_PERIOD_S);
        self.horizon.servo_lag_s - f64::from(self.beats_late) * period_s
    }

    /// The pace at which the next kinematic beat after `motion_s` meets its
    /// music beat, `motion_s` being seen at `seen_s`.
    fn pace_to_next_beat(&self, motion_s: f64, seen_s: f64) -> Option<f64> {
        self.preview.beats_after(motion_s).find_map(|kinematic_s| {
            let count = self.clock.count_at(kinematic_s)?;
            let meant = count.round();
            if (count - meant).abs() > MEANT_BEATS {
                return None;
            }
            let due_s = self.clock.time_of(meant + f64::from(self.beats_late))?;
            let left_s = due_s - seen_s + self.emphasis_ahead_s(seen_s);
            (due_s - seen_s > GONE_S).then(|| (kinematic_s - motion_s) / left_s)
        })
    }

    /// Keeps the delay of live motion as few whole beats as will do.
    fn choose_delay(&mut self) {
        let Some(period_s) = self.clock.period_s() else {
            return;
        };
        let fewest = self.fewest_beats_late(period_s);
        let least_s = self.least_delay_s();
        let delay_s = f64::from(self.beats_late) * period_s;
        let spare_s = f64::from(fewest) * period_s - least_s;
        let too_late = fewest < self.beats_late && spare_s > DELAY_SLACK_S;
        if delay_s < least_s - DELAY_SLACK_S || too_late {
            self.beats_late = fewest;
        }
    }

    fn fewest_beats_late(&self, period_s: f64) -> u32 {
        (self.least_delay_s() / period_s - 1e-6).ceil().max(0.0) as u32
    }

    /// From a moment of music to its motion at the servo, at least; nothing
    /// where music is known ahead.
    fn least_delay_s(&self) -> f64 {
        self.horizon
            .live_s
            .map_or(0.0, |live_s| live_s + self.foresight_s() + self.horizon.servo_lag_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Robot;
    use servodance_types::{Beat, BeatLock, BodyJoint};
    use std::collections::VecDeque;

    const CYCLE_S: f64 = 0.01;
    /// A pace is told from the difference of two times.
    const ROUNDING: f64 = 1e-9;

    fn music(time_s: f64, bpm: f64) -> MusicFrame {
        MusicFrame {
            time_s,
            beat: Beat {
                phase: (time_s * bpm / 60.0).rem_euclid(1.0) as f32,
                tempo_bpm: bpm as f32,
                confidence: 1.0,
                lock: BeatLock::Locked,
                ..Beat::default()
            },
            ..MusicFrame::default()
        }
    }

    /// Arms that swing and pause `late_s` after each beat.
    fn swing(time_s: f64, bpm: f64, late_s: f64) -> MotionFrame {
        let turn = (time_s - late_s) * bpm / 60.0 * std::f64::consts::PI;
        let raised = 0.8 + 0.5 * turn.cos();
        let mut positions = [[0.0_f32; 3]; 22];
        for joint in BodyJoint::ALL {
            let side = match joint.name().split_once('_') {
                Some(("left", _)) => 1.0,
                Some(("right", _)) => -1.0,
                _ => 0.0,
            };
            let parent = joint.parent().map_or([0.0, 1.0, 0.0], |p| positions[p as usize]);
            let bone = match joint.name() {
                name if name.contains("elbow") || name.contains("wrist") => {
                    [side * raised.sin(), -raised.cos(), 0.0].map(|v| v * 0.26)
                }
                name if name.contains("knee") || name.contains("ankle") => [0.0, -0.4, 0.0],
                name if name.contains("foot") => [0.0, 0.0, 0.12],
                name if name.contains("hip") => [side * 0.1, 0.0, 0.0],
                name if name.contains("collar") || name.contains("shoulder") => {
                    [side * 0.1, 0.05, 0.0]
                }
                "pelvis" => [0.0; 3],
                _ => [0.0, 0.12, 0.0],
            };
            positions[joint as usize] =
                std::array::from_fn(|axis| parent[axis] + bone[axis] as f32);
        }
        MotionFrame { time_s, positions, contacts: Default::default() }
    }

    /// How far the motion is from a pause of the human, on each beat after 10 s of 20, as
    /// the servos show it: what was decided a preview before. The robot, which is steered by
    /// its own pauses, may pause a little earlier or later than the human.
    fn errors_s(live_s: Option<f64>, bpm: f64, late_s: f64) -> Vec<f64> {
        let robot = Robot::load("op3").unwrap();
        let retargeter = robot.retargeter().unwrap();
        let horizon = Horizon { preview_s: retargeter.preview_s(), servo_lag_s: 0.05, live_s };
        let mut steering =
            BeatSteering::new(TrajectoryPreview::new(retargeter, CYCLE_S), horizon, CYCLE_S);
        let (mut frame, mut last) = (0, None);
        let preview_s = horizon.preview_s;
        let mut decided = VecDeque::from(vec![0.0; (preview_s / CYCLE_S).round() as usize]);
        let mut errors = Vec::new();
        for cycle in 0..2000 {
            let now_s = f64::from(cycle) * CYCLE_S;
            let known_s = match live_s {
                Some(live_s) => now_s - live_s,
                None => now_s + steering.foresight_s() + 0.5,
            };
            while f64::from(frame) / 20.0 <= known_s {
                let time_s = f64::from(frame) / 20.0;
                steering.push(&music(time_s, bpm), &swing(time_s, bpm, late_s));
                frame += 1;
            }
            let motion_s = steering.next(now_s, f64::from(frame - 1) / 20.0 - 0.44, false).unwrap();
            decided.push_back(motion_s + preview_s);
            let shown_s = decided.pop_front().unwrap();
            if let Some(last_s) = last {
                let pace = (motion_s - last_s) / CYCLE_S;
                let [slowest, fastest] = [SLOWEST * (1.0 - EMPHASIS), FASTEST * (1.0 + EMPHASIS)];
                let bounds = slowest - ROUNDING..=fastest + ROUNDING;
                assert!(bounds.contains(&pace), "{pace} at {now_s}");
                let beats = |now_s: f64| ((now_s + 0.05) * bpm / 60.0).floor();
                if beats(now_s) > beats(now_s - CYCLE_S) && now_s > 10.0 {
                    let pauses = (shown_s - late_s) * bpm / 60.0;
                    errors.push((pauses - pauses.round()) * 60.0 / bpm);
                }
            }
            last = Some(motion_s);
        }
        errors
    }

    #[test]
    fn late_pauses_are_brought_onto_the_beat_inside_the_pace() {
        for (live_s, bpm, late_s) in [
            (None, 120.0, 0.12),
            (None, 95.0, -0.15),
            (Some(0.1), 120.0, 0.0),
            (Some(0.1), 97.0, 0.1),
            (Some(0.1), 168.0, -0.05),
        ] {
            let errors = errors_s(live_s, bpm, late_s);
            let worst = errors.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
            assert!(errors.len() > 12 && worst < 0.05, "{live_s:?} {bpm} {late_s}: {errors:?}");
        }
    }
}
