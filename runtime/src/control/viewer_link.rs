//! The control loop's side of a show: requests in, snapshots out.
//!
//! One of each a cycle at most, nothing that waits, nothing that allocates
//! while nothing happens. Amplitude and mirror change gently: the movement
//! shrinks or grows [`AMPLITUDE_PER_S`]; before it is mirrored it shrinks to
//! nothing.

use crate::control::robot_buses::Rig;
use crate::pipeline::load_shedding::{LeftOut, Sparing};
use crate::viewer::snapshot::{Activity, BANDS, MusicStatus, RobotStatus, ViewerEvent, state_name};
use crate::viewer::{RobotEnd, ViewerSettings, pose_array};
use servodance_retarget::{BodyPoints, Retargeter};
use servodance_types::MusicFrame;
use std::collections::VecDeque;
use std::time::Instant;

/// Snapshots a second.
const SNAPSHOTS_HZ: f64 = 30.0;
/// One of so many is left while viewers are left out.
const FEW: u64 = 15;
/// Fastest change of the amplitude, 1/s.
const AMPLITUDE_PER_S: f64 = 1.5;
/// Below this the movement may be mirrored unseen.
const STILL: f64 = 0.01;
/// Music frames that are remembered: a recording is heard ahead.
const HEARD: usize = 128;
/// The lateness shown is the worst of this long, seconds.
const LATE_S: f64 = 1.0;

/// What the control loop keeps for its viewers.
pub struct Showing<'a> {
    /// The line to them.
    pub end: &'a mut RobotEnd,
    /// What the machine is too slow for.
    pub sparing: Sparing,
    period_s: f64,
    every: u64,
    cycles: u64,
    /// Human poses that are taken in ahead of the robot, oldest first.
    poses: VecDeque<Option<BodyPoints>>,
    /// What was heard, by its time.
    heard: VecDeque<(f64, MusicStatus)>,
    positions_rad: Vec<f64>,
    events_told: usize,
    amplitude: f64,
    mirror: bool,
    /// Whether somebody asked to hold.
    pub hold: bool,
    counted: (Instant, u64),
    rate_hz: f64,
    late_ms: f64,
    late_of_late_ms: f64,
}

/// What only the control loop knows of a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Cycle {
    /// What is being done.
    pub activity: Activity,
    /// Seconds of music.
    pub music_s: f64,
    /// Share of idle.
    pub idle_share: f64,
    /// Cycles without the motion that they needed.
    pub late_frames: u64,
}

impl<'a> Showing<'a> {
    /// Shows a robot whose retargeter this is, which takes on what is set.
    pub fn new(end: &'a mut RobotEnd, retargeter: &mut Retargeter, period_s: f64) -> Self {
        let ViewerSettings {
            amplitude, mirror, ..
        } = end.settings;
        retargeter.set_amplitude(amplitude);
        retargeter.set_mirror(mirror);
        let ahead = (retargeter.preview_s() / period_s).round() as usize;
        Self {
            sparing: Sparing::default(),
            period_s,
            every: (1.0 / (SNAPSHOTS_HZ * period_s)).round().max(1.0) as u64,
            cycles: 0,
            poses: VecDeque::from(vec![None; ahead]),
            heard: VecDeque::with_capacity(HEARD),
            positions_rad: vec![0.0; retargeter.rest().len()],
            events_told: 0,
            amplitude,
            mirror,
            hold: false,
            counted: (Instant::now(), 0),
            rate_hz: 0.0,
            late_ms: 0.0,
            late_of_late_ms: 0.0,
            end,
        }
    }

    /// Takes in what was heard; its time may be yet to come.
    pub fn hear(&mut self, music: &MusicFrame) {
        if self.heard.len() == HEARD {
            self.heard.pop_front();
        }
        let beat = music.beat;
        let now = MusicStatus {
            phase: f64::from(beat.phase),
            tempo_bpm: f64::from(beat.tempo_bpm),
            confidence: f64::from(beat.confidence),
            lock: beat.lock,
            presence: f64::from(music.presence),
            bands: servodance_audio::bands::<BANDS>(&music.spectral),
        };
        self.heard.push_back((music.time_s, now));
    }

    /// Takes in the human pose that the robot will show one preview later.
    pub fn see(&mut self, pose: Option<BodyPoints>) {
        self.poses.push_back(pose);
        self.poses.pop_front();
    }

    /// Takes in how late this cycle is, seconds.
    pub fn note_late(&mut self, late_s: f64) {
        self.late_ms = self.late_ms.max(late_s * 1e3);
    }

    /// Brings amplitude and mirror nearer to what was asked for.
    pub fn steer(&mut self, retargeter: &mut Retargeter) {
        let wanted = self.end.settings;
        if wanted.mirror != self.mirror && self.amplitude <= STILL {
            self.mirror = wanted.mirror;
            retargeter.set_mirror(self.mirror);
        }
        let aim = match wanted.mirror == self.mirror {
            true => wanted.amplitude,
            false => 0.0,
        };
        if aim != self.amplitude {
            let step = AMPLITUDE_PER_S * self.period_s;
            self.amplitude += (aim - self.amplitude).clamp(-step, step);
            retargeter.set_amplitude(self.amplitude);
        }
    }

    /// Shows this cycle, if it is time for a snapshot.
    pub fn show(&mut self, rig: &Rig, retargeter: &Retargeter, cycle: Cycle) {
        self.cycles += 1;
        let few = self.sparing.now() >= LeftOut::Viewers;
        let every = self.every * if few { FEW } else { 1 };
        if !self.cycles.is_multiple_of(every) {
            return;
        }
        self.count();
        let states = rig.states();
        for (place, state) in self.positions_rad.iter_mut().zip(states) {
            *place = state.position_rad;
        }
        let root = retargeter.world_from_root(&self.positions_rad);
        let moment = RobotStatus {
            activity: cycle.activity,
            robot_s: rig.now_s(),
            music_s: cycle.music_s,
            root: pose_array(&root),
            human: self.poses.front().copied().flatten().map(single),
            music: self.music_at(cycle.music_s),
            idle_share: cycle.idle_share,
            settings: self.end.settings,
            amplitude: self.amplitude,
            hold: self.hold,
            bus: rig.stats(),
            rate_hz: self.rate_hz,
            late_ms: self.late_of_late_ms.max(self.late_ms),
            late_frames: cycle.late_frames,
            safety: rig.state(),
            interventions: rig.interventions(),
            violations: rig
                .violations()
                .map(|v| v.position + v.velocity + v.acceleration),
        };
        let news = &rig.transitions()[self.events_told..];
        self.events_told += news.len();
        self.end.publish(|snapshot| {
            snapshot.now = moment;
            let seen = states.iter().zip(rig.sent_rad()).zip(rig.health());
            for (joint, ((state, sent), health)) in snapshot.joints.iter_mut().zip(seen) {
                joint.target_rad = *sent;
                joint.position_rad = state.position_rad;
                joint.velocity_rad_s = state.velocity_rad_s;
                joint.current_a = state.current_a;
                joint.temperature_c = health.temperature_c.unwrap_or(f64::NAN);
            }
            for event in news {
                snapshot.push_event(ViewerEvent {
                    time_s: event.time_s,
                    state: state_name(event.to),
                    cause: event.cause.clone(),
                });
            }
        });
    }

    /// Cycles a second and lateness, by the clock on the wall.
    fn count(&mut self) {
        let (since, cycles) = self.counted;
        let elapsed_s = since.elapsed().as_secs_f64();
        if elapsed_s >= LATE_S {
            self.rate_hz = (self.cycles - cycles) as f64 / elapsed_s;
            self.late_of_late_ms = std::mem::take(&mut self.late_ms);
            self.counted = (Instant::now(), self.cycles);
        }
    }

    /// What is heard at a time: the last frame before it, its beat carried on.
    fn music_at(&mut self, time_s: f64) -> MusicStatus {
        while self.heard.get(1).is_some_and(|next| next.0 <= time_s) {
            self.heard.pop_front();
        }
        match self.heard.front() {
            Some((at_s, music)) if *at_s <= time_s => {
                let beats = (time_s - at_s) * music.tempo_bpm / 60.0;
                MusicStatus {
                    phase: (music.phase + beats).rem_euclid(1.0),
                    ..*music
                }
            }
            _ => MusicStatus::default(),
        }
    }
}

fn single(points: BodyPoints) -> [[f32; 3]; 22] {
    points.map(|p| [p.x as f32, p.y as f32, p.z as f32])
}
