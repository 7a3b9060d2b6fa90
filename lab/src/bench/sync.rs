//! How far apart the music and the robot are, by one clock: a dance in real time, its sound
//! out of a simulated loudspeaker, its servos simulated too.
//!
//! When a beat is heard is found in what came out of the loudspeaker: the stretch of the song
//! around the beat is looked for there by correlation. When the servos are at the beat is
//! found in where they truly were: the stretch of the planned motion around that moment is
//! looked for there by least squares. Steering onto the beat is off: it moves pauses on
//! purpose, and here the clocks are measured.

use anyhow::Context;
use serde::Serialize;
use servodance_audio::playback::{Heard, SimulatedDevice, Sound};
use servodance_runtime::control::motion_log::{LoggedCycle, MotionLog};
use servodance_runtime::pipeline::speaker::{SpeakerConfig, SpeakerDevice};
use servodance_runtime::session::config::DanceConfig;
use servodance_runtime::session::dance::dance;
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// The stretch of sound around a beat that is looked for, and how far around, seconds.
const SOUND_S: f64 = 0.15;
const SOUND_REACH_S: f64 = 0.25;
/// Less alike than this is not found.
const ALIKE: f64 = 0.8;
/// The same for the motion.
const MOTION_S: f64 = 0.4;
const MOTION_REACH_S: f64 = 0.25;
const STEP_S: f64 = 0.001;
/// A robot that moves less than this around a beat shows no moment, radians (root mean square
/// of all joints).
const STILL_RAD: f64 = 0.01;

/// Sound and servos of one dance.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)] // the other names say it
pub struct SyncReport {
    pub robot: String,
    pub beats: usize,
    /// Beats around which both were found.
    pub measured: usize,
    /// Servos against sound, later being positive, milliseconds.
    pub median_ms: f64,
    /// Of the distance either way.
    pub distance_ms_median: f64,
    pub distance_ms_p99: f64,
    /// Sound against the moment that the robot's clock has for it.
    pub sound_ms_median: f64,
    /// The loudspeaker: latency, and by how much its clock is fast.
    pub latency_ms: f64,
    pub drift_ppm: f64,
}

impl fmt::Display for SyncReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} of {} beats; a loudspeaker {:.0} ms late, its clock {:.0} millionths fast",
            self.robot, self.measured, self.beats, self.latency_ms, self.drift_ppm
        )?;
        writeln!(
            f,
            "servos against sound: median {:+.1} ms; distance median {:.1} ms, 99 % {:.1} ms",
            self.median_ms, self.distance_ms_median, self.distance_ms_p99
        )
    }
}

/// Dances `config` in real time and measures at `beats_s`, seconds of the song `sound`.
pub fn run(
    mut config: DanceConfig,
    sound: &Sound,
    beats_s: &[f64],
    device: SimulatedDevice,
) -> anyhow::Result<SyncReport> {
    let heard = Arc::new(Mutex::new(None));
    let log = MotionLog::default();
    let simulated = SpeakerDevice::Simulated(device, Arc::clone(&heard));
    config.speaker = Some(SpeakerConfig { device: simulated, delay_s: 0.0 });
    config.motion_log = Some(log.clone());
    config.compensation = false;
    let robot = config.robot.name.clone();
    dance(&config, &AtomicBool::new(false))?;
    let heard = heard.lock().unwrap_or_else(PoisonError::into_inner).take();
    let heard = heard.context("nothing was played")?;
    let cycles = log.take();
    let zero = cycles.first().context("no control cycle")?.at;
    let motion = MotionTrack::new(&cycles, zero);
    let rough = Rough::new(&cycles, zero);
    let mut found = Vec::new();
    for &beat_s in beats_s {
        let about_s = rough.at(beat_s);
        let sounds_s = when_heard(&heard, sound, beat_s, zero, about_s);
        if let (Some(sounds_s), Some(moves_s)) = (sounds_s, motion.when_shown(beat_s, about_s)) {
            found.push((moves_s - sounds_s, sounds_s - about_s));
        }
    }
    let ms = |values: Vec<f64>, share: f64| percentile(values, share) * 1e3;
    let apart = || found.iter().map(|(apart_s, _)| *apart_s).collect::<Vec<_>>();
    let distance = || found.iter().map(|(apart_s, _)| apart_s.abs()).collect::<Vec<_>>();
    Ok(SyncReport {
        robot,
        beats: beats_s.len(),
        measured: found.len(),
        median_ms: ms(apart(), 0.5),
        distance_ms_median: ms(distance(), 0.5),
        distance_ms_p99: ms(distance(), 0.99),
        sound_ms_median: ms(found.iter().map(|(_, off_s)| *off_s).collect(), 0.5),
        latency_ms: device.latency_s * 1e3,
        drift_ppm: device.drift * 1e6,
    })
}

/// The smallest value that so large a share is not above.
fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = (share * values.len() as f64).ceil() as usize;
    values.get(place.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

fn seconds_from(zero: Instant, moment: Instant) -> f64 {
    match moment.checked_duration_since(zero) {
        Some(after) => after.as_secs_f64(),
        None => -zero.duration_since(moment).as_secs_f64(),
    }
}

/// Where the servos should be about a moment of the motion: only to know where to look.
struct Rough(Vec<(f64, f64)>);

impl Rough {
    fn new(cycles: &[LoggedCycle], zero: Instant) -> Self {
        Self(cycles.iter().map(|c| (c.motion_s, seconds_from(zero, c.at))).collect())
    }

    fn at(&self, motion_s: f64) -> f64 {
        let after = self.0.partition_point(|(at_s, _)| *at_s <= motion_s);
        self.0.get(after.saturating_sub(1)).map_or(f64::NAN, |(_, wall_s)| *wall_s)
    }
}

/// When the beat of the song comes out of the loudspeaker, seconds after `zero`.
fn when_heard(
    heard: &Heard,
    sound: &Sound,
    beat_s: f64,
    zero: Instant,
    about_s: f64,
) -> Option<f64> {
    let rate_hz = heard.rate_hz;
    let count = (SOUND_S * rate_hz) as usize;
    let of_song = |n: usize| {
        let place = (beat_s - SOUND_S / 2.0 + n as f64 / rate_hz) * f64::from(sound.rate_hz);
        let whole = place.floor().max(0.0) as usize;
        let pair = sound.samples.get(whole..whole + 2)?;
        let between = place - whole as f64;
        Some(f64::from(pair[0]) * (1.0 - between) + f64::from(pair[1]) * between)
    };
    let wanted: Vec<f64> = (0..count).map(of_song).collect::<Option<_>>()?;
    let from_s = seconds_from(zero, heard.from);
    let middle = ((about_s - SOUND_S / 2.0 - from_s) * rate_hz) as i64;
    let reach = (SOUND_REACH_S * rate_hz) as i64;
    let mut best = (ALIKE, None);
    // Every fourth sample first; the song is below 11 kHz, and beats are far below.
    let mut look = |places: &mut dyn Iterator<Item = i64>| {
        for place in places {
            let Ok(first) = usize::try_from(place) else { continue };
            let Some(part) = heard.samples.get(first..first + count) else { continue };
            let likeness = likeness(&wanted, part);
            if likeness > best.0 {
                best = (likeness, Some(place));
            }
        }
        best.1
    };
    let near = look(&mut (middle - reach..middle + reach).step_by(4))?;
    let place = look(&mut (near - 4..near + 4))?;
    Some(from_s + place as f64 / rate_hz + SOUND_S / 2.0)
}

/// Correlation of two stretches: 1 where one is the other, louder or not.
fn likeness(wanted: &[f64], part: &[f32]) -> f64 {
    let (mut both, mut own, mut other) = (0.0, 0.0, 1e-12);
    for (a, b) in wanted.iter().zip(part) {
        let b = f64::from(*b);
        both += a * b;
        own += a * a;
        other += b * b;
    }
    both / (own * other).sqrt().max(1e-9)
}

/// Planned and true positions over time.
struct MotionTrack<'a> {
    cycles: &'a [LoggedCycle],
    /// Seconds after zero of each cycle.
    wall_s: Vec<f64>,
}

impl<'a> MotionTrack<'a> {
    fn new(cycles: &'a [LoggedCycle], zero: Instant) -> Self {
        Self { cycles, wall_s: cycles.iter().map(|c| seconds_from(zero, c.at)).collect() }
    }

    /// When the servos are where the motion is at `motion_s`, seconds after zero.
    fn when_shown(&self, motion_s: f64, about_s: f64) -> Option<f64> {
        let offsets: Vec<f64> = (-20..=20).map(|n| f64::from(n) * MOTION_S / 40.0).collect();
        let planned: Vec<Vec<f64>> =
            offsets.iter().map(|offset| self.planned(motion_s + offset)).collect::<Option<_>>()?;
        if spread(&planned) < STILL_RAD {
            return None;
        }
        let steps = (MOTION_REACH_S / STEP_S) as i32;
        let mut best: Option<(f64, f64)> = None;
        for step in -steps..=steps {
            let at_s = about_s + f64::from(step) * STEP_S;
            let apart: Option<f64> = offsets
                .iter()
                .zip(&planned)
                .map(|(offset, planned)| Some(distance(&self.truly(at_s + offset)?, planned)))
                .sum();
            let Some(apart) = apart else { continue };
            if best.is_none_or(|(least, _)| apart < least) {
                best = Some((apart, at_s));
            }
        }
        best.map(|(_, at_s)| at_s)
    }

    fn planned(&self, motion_s: f64) -> Option<Vec<f64>> {
        let after = self.cycles.partition_point(|cycle| cycle.motion_s <= motion_s);
        let [a, b] = [self.cycles.get(after.checked_sub(1)?)?, self.cycles.get(after)?];
        let share = (motion_s - a.motion_s) / (b.motion_s - a.motion_s).max(1e-9);
        Some(mixed(&a.targets_rad, &b.targets_rad, share))
    }

    fn truly(&self, at_s: f64) -> Option<Vec<f64>> {
        let after = self.wall_s.partition_point(|wall_s| *wall_s <= at_s);
        let before = after.checked_sub(1)?;
        let [a, b] = [self.cycles.get(before)?, self.cycles.get(after)?];
        let share = (at_s - self.wall_s[before]) / (self.wall_s[after] - self.wall_s[before]);
        Some(mixed(&a.positions_rad, &b.positions_rad, share))
    }
}

fn mixed(a: &[f64], b: &[f64], share: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// Root mean square of the movement around its mean, over all joints.
fn spread(poses: &[Vec<f64>]) -> f64 {
    let joints = poses.first().map_or(0, Vec::len);
    let of_joint = |joint: usize| {
        let mean = poses.iter().map(|pose| pose[joint]).sum::<f64>() / poses.len() as f64;
        poses.iter().map(|pose| (pose[joint] - mean).powi(2)).sum::<f64>() / poses.len() as f64
    };
    ((0..joints).map(of_joint).sum::<f64>() / joints.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn servos_that_are_late_and_sound_that_is_late_are_found_to_be_so() {
        let zero = Instant::now();
        let at = |seconds: f64| zero + Duration::from_secs_f64(seconds);
        let pose = |time_s: f64| vec![(7.0 * time_s).sin(), (3.0 * time_s).cos()];
        let cycle = |n: usize| {
            let time_s = n as f64 * 0.01;
            LoggedCycle {
                at: at(time_s),
                motion_s: time_s - 2.0,
                targets_rad: pose(time_s - 2.0),
                positions_rad: pose(time_s - 2.0 - 0.073),
            }
        };
        let cycles: Vec<LoggedCycle> = (0..600).map(cycle).collect();
        let motion = MotionTrack::new(&cycles, zero);
        let rough = Rough::new(&cycles, zero).at(1.5);
        assert!((rough - 3.5).abs() < 0.011);
        let shown_s = motion.when_shown(1.5, rough).unwrap();
        assert!((shown_s - 3.573).abs() < 0.003, "{shown_s}");

        // Slow enough to be alike a few samples beside, as music is.
        let noise = |n: usize| {
            let mixed = (n as u64 / 16 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let mixed = (mixed ^ (mixed >> 31)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            ((mixed ^ (mixed >> 29)) % 20_001) as i16 - 10_000
        };
        let sound = Sound { samples: (0..40_000).map(noise).collect(), rate_hz: 8000 };
        let samples = sound.samples.iter().map(|s| f32::from(*s) / 32_768.0).collect();
        let heard = Heard { from: at(2.02), rate_hz: 8000.0, samples };
        let sounds_s = when_heard(&heard, &sound, 1.5, zero, rough).unwrap();
        assert!((sounds_s - 3.52).abs() < 0.001, "{sounds_s}");
    }

    #[test]
    fn percentiles_are_values_that_there_are() {
        assert_eq!(percentile(vec![3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(percentile((1..=100).map(f64::from).collect(), 0.99), 99.0);
        assert!(percentile(Vec::new(), 0.5).is_nan());
    }
}
