//! The control loop's side of the viewers: requests in, snapshots out.
//!
//! Nothing here waits, and nothing allocates while nothing happens. Amplitude and mirror change gently: the movement
//! shrinks or grows `AMPLITUDE_PER_S`; before it is mirrored it shrinks to
//! nothing.

use super::robot_buses::RobotBuses;
use crate::pipeline::load_shedding::{LeftOut, LoadShedding};
use crate::viewer::music_track::MusicTrack;
use crate::viewer::snapshot::{Activity, RobotStatus, ViewerEvent, state_name};
use crate::viewer::{RobotEnd, ViewerSettings};
use servodance_drivers::{Bus, ErrorCounters, Transition};
use servodance_retarget::{BodyPoints, Retargeter};
use servodance_types::{HeldBack, MusicFrame};
use std::collections::VecDeque;
use std::time::Instant;

const SNAPSHOTS_HZ: f64 = 30.0;
/// One snapshot of so many is left while viewers are left out: five a second, so that
/// pages still know that the robot is there.
const FEW: u64 = 6;
/// Fastest change of the amplitude, 1/s.
const AMPLITUDE_PER_S: f64 = 1.5;
/// Below this the movement may be mirrored unseen.
const STILL: f64 = 0.01;
/// The lateness shown is the worst of this long, seconds.
const LATE_S: f64 = 1.0;

pub struct ViewerLink<'a> {
    pub end: &'a mut RobotEnd,
    pub shedding: LoadShedding,
    period_s: f64,
    every: u64,
    cycles: u64,
    /// Human poses that are taken in ahead of the robot, oldest first.
    poses: VecDeque<Option<BodyPoints>>,
    music: MusicTrack,
    /// Transitions of the safety layer that viewers have got.
    events_sent: usize,
    amplitude: f64,
    mirror: bool,
    pub hold: bool,
    /// When the rate was measured last, and the cycles by then.
    rated: (Instant, u64),
    rate_hz: f64,
    /// Worst lateness since then, and of the second before.
    late_ms: f64,
    shown_late_ms: f64,
    /// What held each joint back since the last snapshot.
    held: Vec<HeldBack>,
    errors: Option<ErrorCounters>,
}

/// What only the control loop knows of a cycle.
#[derive(Clone, Copy, Debug)]
pub struct CycleView {
    pub activity: Activity,
    pub music_s: f64,
    pub idle_share: f64,
    /// Cycles without the motion that they needed.
    pub late_frames: u64,
}

impl<'a> ViewerLink<'a> {
    /// Applies the settings to `retargeter`.
    pub fn new(end: &'a mut RobotEnd, retargeter: &mut Retargeter, period_s: f64) -> Self {
        let ViewerSettings { amplitude, mirror, .. } = end.settings;
        retargeter.set_amplitude(amplitude);
        retargeter.set_mirror(mirror);
        if std::mem::take(&mut end.begins_row) {
            end.operators.hear(); // dead-man mode counts from torque on
        }
        let ahead = (retargeter.preview_s() / period_s).round() as usize;
        Self {
            shedding: LoadShedding::default(),
            period_s,
            every: (1.0 / (SNAPSHOTS_HZ * period_s)).round().max(1.0) as u64,
            cycles: 0,
            poses: VecDeque::from(vec![None; ahead]),
            music: MusicTrack::default(),
            events_sent: 0,
            amplitude,
            mirror,
            hold: false,
            rated: (Instant::now(), 0),
            rate_hz: 0.0,
            late_ms: 0.0,
            shown_late_ms: 0.0,
            held: vec![HeldBack::Nothing; retargeter.rest().len()],
            errors: None,
            end,
        }
    }

    /// Takes in a music frame; its time may be yet to come.
    pub fn push_music(&mut self, music: &MusicFrame) {
        self.music.push(music);
    }

    /// Takes in the human pose that the robot will show one preview later.
    pub fn push_pose(&mut self, pose: Option<BodyPoints>) {
        self.poses.push_back(pose);
        self.poses.pop_front();
    }

    /// Takes in how late this cycle is, seconds.
    pub fn note_late(&mut self, late_s: f64) {
        self.late_ms = self.late_ms.max(late_s * 1e3);
    }

    /// Brings amplitude and mirror nearer to the settings.
    pub fn adjust(&mut self, retargeter: &mut Retargeter) {
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

    /// Publishes this cycle, if it is time for a snapshot.
    pub fn publish(&mut self, servos: &RobotBuses, retargeter: &Retargeter, cycle: CycleView) {
        self.cycles += 1;
        self.note_held(servos, retargeter, cycle.activity);
        let few = self.shedding.now() >= LeftOut::Viewers;
        let every = self.every * if few { FEW } else { 1 };
        if !self.cycles.is_multiple_of(every) {
            return;
        }
        self.measure_rate();
        let states = servos.states();
        let moment = RobotStatus {
            published: Instant::now(),
            activity: cycle.activity,
            robot_s: servos.now_s(),
            music_s: cycle.music_s,
            root: servos.root_pose(retargeter),
            human: self.poses.front().copied().flatten().map(single),
            music: self.music.at(cycle.music_s),
            idle_share: cycle.idle_share,
            settings: self.end.settings,
            amplitude: self.amplitude,
            hold: self.hold,
            bus: servos.safety().stats(),
            rate_hz: self.rate_hz,
            late_ms: self.shown_late_ms.max(self.late_ms),
            gaps: servos.recent_gaps(),
            late_frames: cycle.late_frames,
            safety: servos.safety().state(),
            stopped: None,
            interventions: servos.interventions(),
            violations: servos.violations().map(|v| v.position + v.velocity + v.acceleration),
        };
        let new_events = &servos.safety().transitions()[self.events_sent..];
        self.events_sent += new_events.len();
        let errors = &*self.errors.get_or_insert_with(|| servos.safety().bus().error_counters());
        self.end.publish(|snapshot| {
            snapshot.now = moment;
            for (joint, errors) in snapshot.joints.iter_mut().zip(errors.each()) {
                joint.errors = errors;
            }
            for (joint, held) in snapshot.joints.iter_mut().zip(&mut self.held) {
                joint.held = std::mem::take(held);
            }
            let seen = states.iter().zip(servos.safety().sent_rad()).zip(servos.safety().health());
            for (joint, ((state, sent), health)) in snapshot.joints.iter_mut().zip(seen) {
                joint.target_rad = *sent;
                joint.position_rad = state.position_rad;
                joint.velocity_rad_s = state.velocity_rad_s;
                joint.current_a = state.current_a;
                joint.temperature_c = health.temperature_c.unwrap_or(f64::NAN);
            }
            for event in new_events {
                snapshot.push_event(event_of(event));
            }
        });
    }

    /// Takes in what held joints back in this cycle: the plan, then the safety layer.
    fn note_held(&mut self, servos: &RobotBuses, retargeter: &Retargeter, activity: Activity) {
        let planned = match activity {
            Activity::Prelude | Activity::Dancing => retargeter.held_back(),
            _ => &[],
        };
        let changed = servos.safety().held_back();
        self.held.iter_mut().zip(changed).for_each(|(held, now)| *held = (*held).max(now));
        self.held.iter_mut().zip(planned).for_each(|(held, now)| *held = (*held).max(*now));
    }

    /// Cycles a second and lateness, by the clock on the wall.
    fn measure_rate(&mut self) {
        let (since, cycles) = self.rated;
        let elapsed_s = since.elapsed().as_secs_f64();
        if elapsed_s >= LATE_S {
            self.rate_hz = (self.cycles - cycles) as f64 / elapsed_s;
            self.shown_late_ms = std::mem::take(&mut self.late_ms);
            self.rated = (Instant::now(), self.cycles);
        }
    }
}

fn single(points: BodyPoints) -> [[f32; 3]; 22] {
    points.map(|p| [p.x as f32, p.y as f32, p.z as f32])
}

/// Turns torque on; returns what the user should know. Where that fails torque is turned off
/// again, and those who watch are told.
pub fn arm_watched(
    servos: &mut RobotBuses,
    end: Option<&mut RobotEnd>,
) -> anyhow::Result<Vec<String>> {
    let armed = servos.arm();
    if armed.is_err() {
        // What went wrong is the error; whether torque is off, the state left here.
        let _ = servos.disarm("the servos could not be armed");
        if let Some(end) = end {
            publish_end(end, servos);
        }
    }
    armed
}

/// The last that viewers see of a dance: torque is off, and why.
pub fn publish_end(end: &mut RobotEnd, servos: &RobotBuses) {
    let transitions = servos.safety().transitions();
    end.publish(|snapshot| {
        snapshot.now.activity = Activity::Over;
        snapshot.now.safety = servos.safety().state();
        for event in &transitions[transitions.len().saturating_sub(2)..] {
            snapshot.push_event(event_of(event));
        }
    });
    end.confirm_stop(end.torque_was_off());
}

fn event_of(transition: &Transition) -> ViewerEvent {
    ViewerEvent {
        time_s: transition.time_s,
        state: state_name(transition.to),
        cause: transition.cause.clone(),
    }
}
