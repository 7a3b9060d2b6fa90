//! Plays a recording to those who watch: the same page, a slider in place of
//! the controls. Nothing moves but the picture.

use super::link::RobotEnd;
use super::request::Request;
use super::snapshot::{Activity, Event, MusicNow};
use crate::record::Recording;
use servodance_types::BeatLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Snapshots a second.
const RATE_HZ: f64 = 30.0;

/// A recording and where it is.
pub struct Player<'a> {
    recording: &'a Recording,
    end: RobotEnd,
    time_s: f64,
    paused: bool,
}

impl<'a> Player<'a> {
    /// A player at the beginning.
    pub fn new(recording: &'a Recording, end: RobotEnd) -> Self {
        Self {
            recording,
            end,
            time_s: recording.span_s()[0],
            paused: false,
        }
    }

    /// Plays until `stop` is set; at its end the recording waits to be played
    /// again.
    pub fn run(&mut self, stop: &AtomicBool) {
        let event = Event {
            time_s: f64::NAN,
            state: "playing",
            cause: format!("a recording of {}", self.recording.robot),
        };
        self.end.publish(|snapshot| snapshot.note(event));
        let mut last = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_secs_f64(1.0 / RATE_HZ));
            let passed_s = last.elapsed().as_secs_f64();
            last = Instant::now();
            self.go(passed_s);
            self.show();
        }
    }

    /// Does what was asked, and lets time pass.
    fn go(&mut self, passed_s: f64) {
        let [first_s, last_s] = self.recording.span_s();
        while let Some(request) = self.end.request() {
            match request {
                Request::Hold => self.paused = true,
                Request::Resume => {
                    self.paused = false;
                    if self.time_s >= last_s {
                        self.time_s = first_s;
                    }
                }
                Request::Seek(time_s) if time_s.is_finite() => self.time_s = time_s,
                _ => {}
            }
        }
        if !self.paused {
            self.time_s += passed_s;
        }
        self.time_s = self.time_s.clamp(first_s, last_s);
        self.paused |= self.time_s >= last_s;
    }

    fn show(&mut self) {
        let (recording, time_s, paused) = (self.recording, self.time_s, self.paused);
        let lead_s = recording.lead.at(time_s).copied().unwrap_or(0.0);
        self.end.publish(|snapshot| {
            let now = &mut snapshot.now;
            now.activity = Activity::Playing;
            now.music_s = time_s;
            now.robot_s = time_s - recording.span_s()[0];
            now.hold = paused;
            now.rate_hz = recording.control_hz;
            now.idle_share = recording.idle.at(time_s).copied().unwrap_or(0.0);
            now.root = recording.root_at(time_s);
            now.human = recording.motion.at(time_s + lead_s).copied();
            now.music = music_at(recording, time_s);
            let sent = recording.commands.at(time_s);
            let reported = recording.states.at(time_s);
            for (index, joint) in snapshot.joints.iter_mut().enumerate() {
                let of = |values: Option<&Vec<f32>>| values.map_or(0.0, |v| f64::from(v[index]));
                joint.target_rad = of(sent);
                joint.position_rad = of(reported);
                joint.velocity_rad_s = f64::NAN;
                joint.current_a = f64::NAN;
            }
        });
    }
}

/// The beat as it was heard, carried on from the last frame.
fn music_at(recording: &Recording, time_s: f64) -> MusicNow {
    let tempo_bpm = recording.beats.at(time_s).copied().unwrap_or(0.0);
    let Some((at_s, phase)) = recording.phase.last_before(time_s) else {
        return MusicNow::default();
    };
    MusicNow {
        phase: (phase + (time_s - at_s) * tempo_bpm / 60.0).rem_euclid(1.0),
        tempo_bpm,
        confidence: 1.0,
        lock: match tempo_bpm > 0.0 {
            true => BeatLock::Locked,
            false => BeatLock::Lost,
        },
        presence: 1.0,
        ..MusicNow::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dance::IdleStyle;
    use crate::show::{Settings, link};

    #[test]
    fn it_plays_pauses_seeks_and_starts_again_at_the_end() {
        let mut recording = Recording {
            ..Recording::default()
        };
        for i in 0..100 {
            let values = vec![i as f32 / 10.0];
            recording.states.push(f64::from(i) / 50.0 - 1.0, values);
        }
        let settings = Settings {
            amplitude: 1.0,
            mirror: false,
            idle: IdleStyle::Sway,
            style: 0,
            seed: 0,
        };
        let (end, mut viewers) = link(1, settings);
        let mut player = Player::new(&recording, end);
        let mut after = |passed_s, requests: &[Request]| {
            assert!(viewers.ask(requests));
            player.go(passed_s);
            player.show();
            let snapshot = viewers.newest();
            (snapshot.now.music_s, snapshot.joints[0].position_rad)
        };
        assert_eq!(after(0.5, &[]).0, -0.5);
        assert_eq!(after(0.5, &[Request::Hold]).0, -0.5);
        let (time_s, rad) = after(0.0, &[Request::Seek(0.5)]);
        assert!(
            (time_s - 0.5).abs() < 1e-9 && (rad - 7.5).abs() < 1e-5,
            "{rad}"
        );
        assert_eq!(after(0.1, &[Request::Seek(f64::NAN)]).0, 0.5);
        assert_eq!(after(9.0, &[Request::Resume]).0, 0.98);
        assert_eq!(after(9.0, &[]).0, 0.98, "it waits at the end");
        assert_eq!(after(0.0, &[Request::Resume]).0, -1.0);
    }
}
