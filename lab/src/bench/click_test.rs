//! A click in, the motion onset out: the delay of the whole way, measured.
//!
//! ```text
//! paced sound -> MusicAnalyzer -> (the model, for its time) -> reflex -> queue
//!   -> Retargeter -> SafeBus -> servos -> reported positions
//! ```
//!
//! All runs in real time, on simulated servos and on real ones alike. Only the
//! dancer is replaced: whoever hears a click raises the arms and nods, so that
//! an onset of motion belongs to each click. The model still computes, for its
//! share of the time. Moments are seconds since the sound began.

use anyhow::{Context, bail};
use servodance_audio::MusicAnalyzer;
use servodance_drivers::EStop;
use servodance_model::{Dance, GeneratorOptions};
use servodance_runtime::control::bus_choice::BusChoice;
use servodance_runtime::control::delays::Delays;
use servodance_runtime::control::emergency_stop::EmergencyStopWatch;
use servodance_runtime::control::idle;
use servodance_runtime::control::robot_buses::RobotBuses;
use servodance_runtime::pipeline::model_args::EngineArgs;
use servodance_runtime::process::interrupted::Interrupted;
use servodance_runtime::process::speed::Speed;
use servodance_runtime::robot::Robot;
use servodance_runtime::session::dance::open_generator;
use servodance_types::{Contacts, FRAME_RATE_HZ, MotionFrame};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const RATE_HZ: u32 = 48_000;
/// The servos move to rest, then stand; the analyzer learns what silence is, seconds.
const REST_S: f64 = 3.0;
const QUIET_S: f64 = 5.0;
/// From click to click, seconds.
const EVERY_S: f64 = 1.63;
/// Raising takes so many frames, lowering starts after twice as many.
const RAISING: i32 = 4;
/// How far: half way to the side, so that servos are slow enough for it.
const HEIGHT: f64 = 0.5;
/// A click is a rise of the onset feature above this; its own scale.
const HEARD: f32 = 0.3;

/// What one click took, seconds.
#[derive(Clone, Copy, Debug)]
pub struct ClickDelay {
    /// From the click to its music frame.
    pub heard_s: f64,
    /// From there to the motion frame in the control loop.
    pub made_s: f64,
    /// From there to the target.
    pub planned_s: f64,
    /// From there to the position that the servo reported.
    pub moved_s: f64,
}

impl ClickDelay {
    /// The whole delay from air to servo, seconds.
    pub fn total_s(&self) -> f64 {
        self.heard_s + self.made_s + self.planned_s + self.moved_s
    }
}

/// The delay of every click, and of the servos by themselves.
#[derive(Clone, Debug)]
pub struct ClickTestReport {
    /// One entry for each click that was answered.
    pub passages: Vec<ClickDelay>,
    /// The lag of positions behind commands at which both agree best, seconds.
    pub servo_lag_s: f64,
    /// What the model of the delays says.
    pub delays: Delays,
}

struct Reflex {
    frame: MotionFrame,
    /// When the frame was heard, if it is the one of a click.
    click_heard_s: Option<f64>,
}

/// Sends `clicks` clicks through the robot. Torque is off afterwards.
pub fn measure(
    robot: &Robot,
    buses: &[BusChoice],
    clicks: u32,
    stop: &AtomicBool,
) -> anyhow::Result<ClickTestReport> {
    let mut retargeter = robot.retargeter()?;
    let delays = Delays::new(robot, &retargeter);
    let model = open_generator(None, EngineArgs::default())?.start(GeneratorOptions::default())?;
    let estop = EStop::default();
    let _watch = EmergencyStopWatch::start(&estop, None, true)?;
    let mut rig = RobotBuses::open(robot, buses, Speed::Realtime, &estop)?;
    rig.arm()?;
    let present: Vec<f64> = rig.states().iter().map(|s| s.position_rad).collect();
    retargeter.seed(&present)?;
    let started = Instant::now();
    let end_s = QUIET_S + f64::from(clicks) * EVERY_S;
    let reflexes = listen(started, end_s, model)?;
    let mut track = Track::default();
    let mut targets = present;
    let mut cycle = 0_u32;
    while !stop.load(Ordering::Relaxed) {
        let now_s = f64::from(cycle) * robot.period_s();
        if now_s > end_s {
            break;
        }
        wait_until(started, now_s);
        for reflex in reflexes.try_iter() {
            let reflex: Reflex = reflex?;
            if reflex.frame.time_s > REST_S {
                retargeter.push(&reflex.frame);
            }
            if let Some(heard_s) = reflex.click_heard_s {
                let made_s = started.elapsed().as_secs_f64();
                track.clicks.push((heard_s, made_s, reflex.frame.time_s));
            }
        }
        let live_s = delays.capture_s + delays.live_s() + retargeter.lookahead_s();
        retargeter.next(now_s - live_s, &mut targets)?;
        rig.cycle(now_s, &targets)?;
        track.push(now_s, rig.safety().sent_rad(), rig.states().iter().map(|s| s.position_rad));
        cycle += 1;
    }
    rig.disarm("the clicks are over")?;
    if stop.load(Ordering::Relaxed) {
        return Err(Interrupted.into());
    }
    let passages = track.passages();
    if passages.is_empty() {
        bail!("no click moved a servo: nothing to measure");
    }
    Ok(ClickTestReport { passages, servo_lag_s: track.servo_lag_s(robot.period_s()), delays })
}

fn wait_until(started: Instant, moment_s: f64) {
    let rest_s = moment_s - started.elapsed().as_secs_f64();
    std::thread::sleep(Duration::from_secs_f64(rest_s.max(0.0)));
}

/// Plays and hears the clicks on a thread of its own.
fn listen(
    started: Instant,
    end_s: f64,
    mut model: Dance,
) -> anyhow::Result<Receiver<anyhow::Result<Reflex>>> {
    let (sender, receiver) = channel();
    let mut analyzer = MusicAnalyzer::new(RATE_HZ)?;
    let block = (f64::from(RATE_HZ) * 0.01) as u64;
    std::thread::Builder::new().name("clicks".into()).spawn(move || {
        let mut raising = Raising::default();
        let mut samples = 0;
        while samples as f64 / f64::from(RATE_HZ) < end_s {
            let sound: Vec<f32> = (samples..samples + block).map(sample).collect();
            samples += block;
            wait_until(started, samples as f64 / f64::from(RATE_HZ));
            analyzer.push(&sound);
            while let Some(music) = analyzer.pop() {
                let heard_s = started.elapsed().as_secs_f64();
                let made = model.step(&music).context("the generator failed");
                let is_click = raising.hear(music.spectral[0]);
                let reflex = made.map(|_| Reflex {
                    frame: raising.frame(music.time_s),
                    click_heard_s: is_click.then_some(heard_s),
                });
                if sender.send(reflex).is_err() {
                    return;
                }
            }
        }
    })?;
    Ok(receiver)
}

/// Faint noise with a click of 5 ms every [`EVERY_S`].
fn sample(index: u64) -> f32 {
    let time_s = index as f64 / f64::from(RATE_HZ);
    // SplitMix64 of the index.
    let mut hash = index.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    hash = (hash ^ (hash >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    hash = (hash ^ (hash >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    let noise = (hash >> 40) as f32 / 8_388_608.0 - 1.0;
    let since_s = (time_s - QUIET_S).rem_euclid(EVERY_S);
    let loud = time_s >= QUIET_S && since_s < 0.005;
    noise * if loud { 0.8 } else { 1e-3 }
}

fn click_before_s(time_s: f64) -> f64 {
    QUIET_S + ((time_s - QUIET_S) / EVERY_S).floor() * EVERY_S
}

/// Raises the arms at a click and lowers them again.
#[derive(Default)]
struct Raising {
    since: Option<i32>,
}

impl Raising {
    /// Whether a new click is heard in a frame of this onset strength.
    fn hear(&mut self, onset: f32) -> bool {
        self.since = self.since.map(|frames| frames + 1).filter(|f| *f < 4 * RAISING);
        let new = self.since.is_none() && onset > HEARD;
        if new {
            self.since = Some(0);
        }
        new
    }

    fn frame(&self, time_s: f64) -> MotionFrame {
        let frames = self.since.map_or(0, |f| (f + 1).min(3 * RAISING - f).max(0));
        let raised = HEIGHT * f64::from(frames.min(RAISING)) / f64::from(RAISING);
        let points = idle::greeting(raised);
        MotionFrame {
            time_s,
            positions: points.map(|p| [p.y as f32, p.z as f32, p.x as f32]),
            contacts: Contacts::default(),
        }
    }
}

#[derive(Default)]
struct Track {
    /// Heard, made, and time of the motion frame.
    clicks: Vec<(f64, f64, f64)>,
    times_s: Vec<f64>,
    sent: Vec<Vec<f64>>,
    reported: Vec<Vec<f64>>,
}

impl Track {
    fn push(&mut self, now_s: f64, sent: &[f64], reported: impl Iterator<Item = f64>) {
        self.times_s.push(now_s);
        self.sent.push(sent.to_vec());
        self.reported.push(reported.collect());
    }

    fn passages(&self) -> Vec<ClickDelay> {
        // Half way up is where limits and thresholds blur the least; the way
        // up begins half a frame before the frame that first shows it.
        let half_s = (f64::from(RAISING) / 2.0 - 0.5 - 0.5) / FRAME_RATE_HZ;
        let passage = |(heard_s, made_s, frame_s): &(f64, f64, f64)| {
            let until_s = made_s + EVERY_S * 0.55;
            let planned_s = self.half_way_s(&self.sent, *made_s, until_s)? - half_s;
            let moved_s = self.half_way_s(&self.reported, *made_s, until_s)? - half_s;
            Some(ClickDelay {
                heard_s: heard_s - click_before_s(*frame_s),
                made_s: made_s - heard_s,
                planned_s: planned_s - made_s,
                moved_s: moved_s - planned_s,
            })
        };
        self.clicks.iter().filter_map(passage).collect()
    }

    /// When the joints were half way between two moments, the middle of where
    /// they were at the first and where they were farthest from there.
    fn half_way_s(&self, track: &[Vec<f64>], from_s: f64, to_s: f64) -> Option<f64> {
        let first = self.times_s.partition_point(|t| *t < from_s);
        let last = self.times_s.partition_point(|t| *t < to_s);
        let start = track.get(first)?;
        let away = |positions: &Vec<f64>| -> f64 {
            let pairs = positions.iter().zip(start);
            pairs.map(|(a, b)| (a - b).abs()).sum()
        };
        let way: Vec<f64> = track[first..last].iter().map(away).collect();
        let farthest = way.iter().copied().fold(0.0, f64::max);
        if farthest < 0.02 {
            return None;
        }
        let half = 0.5 * farthest;
        let after = way.iter().position(|w| *w >= half)?.max(1);
        let share = (half - way[after - 1]) / (way[after] - way[after - 1]);
        let (a, b) = (self.times_s[first + after - 1], self.times_s[first + after]);
        Some(a + share * (b - a))
    }

    /// The lag at which positions are nearest to commands, to a tenth of a cycle.
    fn servo_lag_s(&self, period_s: f64) -> f64 {
        let miss = |tenths: usize| -> f64 {
            let (whole, share) = (tenths / 10, (tenths % 10) as f64 / 10.0);
            let errors = (whole + 1..self.sent.len()).flat_map(|now| {
                let (newer, older) = (&self.sent[now - whole], &self.sent[now - whole - 1]);
                let sent = newer.iter().zip(older).map(move |(n, o)| n + share * (o - n));
                sent.zip(&self.reported[now]).map(|(s, r)| (s - r).powi(2))
            });
            errors.sum()
        };
        let best = (0..400).min_by(|a, b| miss(*a).total_cmp(&miss(*b)));
        best.unwrap_or_default() as f64 / 10.0 * period_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lag_of_a_delayed_copy_is_found() {
        let mut track = Track::default();
        let at = |t: f64| (3.0 * t).sin() + 0.3 * (7.0 * t).cos();
        for cycle in 0..500 {
            let now_s = f64::from(cycle) * 0.01;
            track.push(now_s, &[at(now_s)], [at(now_s - 0.043)].into_iter());
        }
        let lag_s = track.servo_lag_s(0.01);
        assert!((lag_s - 0.043).abs() < 1.1e-3, "{lag_s}");
    }

    #[test]
    fn half_way_up_is_found_between_two_cycles() {
        let mut track = Track::default();
        for cycle in 0..100 {
            let now_s = f64::from(cycle) * 0.01;
            let ramp = ((now_s - 0.303) / 0.2).clamp(0.0, 1.0);
            track.push(now_s, &[ramp], [0.0].into_iter());
        }
        let half_s = track.half_way_s(&track.sent, 0.1, 0.9).unwrap();
        assert!((half_s - 0.403).abs() < 1e-6, "{half_s}");
        assert_eq!(track.half_way_s(&track.reported, 0.1, 0.9), None);
    }
}
