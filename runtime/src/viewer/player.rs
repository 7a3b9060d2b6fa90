//! Plays a recording to viewers: the same page, with a slider in place of the
//! controls. No servo moves.

use super::link::RobotEnd;
use super::request::ViewerRequest;
use super::snapshot::{Activity, BANDS, MusicStatus, ViewerEvent, known_state};
use crate::telemetry::recorder::Recording;
use servodance_types::BeatLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 30.0;

/// A recording and where it is.
pub struct Player<'a> {
    recording: &'a Recording,
    end: RobotEnd,
    time_s: f64,
    paused: bool,
    events_shown: usize,
}

impl<'a> Player<'a> {
    /// A player at the beginning.
    pub fn new(recording: &'a Recording, end: RobotEnd) -> Self {
        Self { recording, end, time_s: recording.span_s()[0], paused: false, events_shown: 0 }
    }

    /// Plays until `stop` is set; pauses at the end of the recording.
    pub fn run(&mut self, stop: &AtomicBool) {
        let event = self.first_event();
        self.end.publish(|snapshot| snapshot.push_event(event));
        let mut last = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_secs_f64(1.0 / RATE_HZ));
            let passed_s = last.elapsed().as_secs_f64();
            last = Instant::now();
            self.go(passed_s);
            self.show();
        }
    }

    fn go(&mut self, passed_s: f64) {
        let [first_s, last_s] = self.recording.span_s();
        while let Some(request) = self.end.request() {
            match request {
                ViewerRequest::Hold => self.paused = true,
                ViewerRequest::Resume => {
                    self.paused = false;
                    if self.time_s >= last_s {
                        self.time_s = first_s;
                    }
                }
                ViewerRequest::Seek(time_s) if time_s.is_finite() => self.time_s = time_s,
                _ => {}
            }
        }
        if !self.paused {
            self.time_s += passed_s;
        }
        self.time_s = self.time_s.clamp(first_s, last_s);
        self.paused |= self.time_s >= last_s;
    }

    fn first_event(&self) -> ViewerEvent {
        ViewerEvent {
            time_s: f64::NAN,
            state: "playing",
            cause: format!("a recording of {}", self.recording.robot),
        }
    }

    /// What had happened by now, if that is more or less than viewers know.
    fn show_events(&mut self) {
        let (recording, time_s) = (self.recording, self.time_s);
        let [first_s, _] = recording.span_s();
        let past = recording.events.iter();
        let past: Vec<_> = past.take_while(|(at_s, _)| *at_s <= time_s).collect();
        if past.len() != self.events_shown {
            self.events_shown = past.len();
            let first = self.first_event();
            let events = past.into_iter().map(|(at_s, past)| ViewerEvent {
                time_s: at_s - first_s,
                state: known_state(&past.state),
                cause: past.cause.clone(),
            });
            let all = std::iter::once(first).chain(events);
            self.end.publish(|snapshot| snapshot.replace_events(all));
        }
    }

    fn show(&mut self) {
        self.show_events();
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
                let heat = recording.temperatures.get(index);
                let heat = heat.and_then(|series| series.last_before(time_s));
                joint.temperature_c = heat.map_or(f64::NAN, |(_, celsius)| f64::from(*celsius));
            }
        });
    }
}

/// The beat as it was heard, carried on from the last frame.
fn music_at(recording: &Recording, time_s: f64) -> MusicStatus {
    let tempo_bpm = recording.beats.at(time_s).copied().unwrap_or(0.0);
    let Some((at_s, phase)) = recording.phase.last_before(time_s) else {
        return MusicStatus::default();
    };
    MusicStatus {
        phase: (phase + (time_s - at_s) * tempo_bpm / 60.0).rem_euclid(1.0),
        tempo_bpm,
        confidence: 1.0,
        lock: match tempo_bpm > 0.0 {
            true => BeatLock::Locked,
            false => BeatLock::Lost,
        },
        presence: 1.0,
        bands: spectrum_at(recording, time_s),
        ..MusicStatus::default()
    }
}

fn spectrum_at(recording: &Recording, time_s: f64) -> [f32; BANDS] {
    let heard = recording.spectrum.last_before(time_s);
    let bands = heard.and_then(|(_, bands)| bands.as_slice().try_into().ok());
    bands.unwrap_or([0.0; BANDS])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::idle::IdleStyle;
    use crate::telemetry::recorder::RecordedEvent;
    use crate::viewer::{ViewerSettings, link};

    fn settings() -> ViewerSettings {
        ViewerSettings { amplitude: 1.0, mirror: false, idle: IdleStyle::Sway, style: 0, seed: 0 }
    }

    #[test]
    fn spectrum_heat_and_events_are_those_of_the_moment_however_it_is_reached() {
        let mut recording = Recording::default();
        let mut heat = crate::telemetry::recorder::Series::default();
        for i in 0..10 {
            let time_s = f64::from(i);
            recording.states.push(time_s, vec![0.0]);
            recording.phase.push(time_s, 0.5);
            recording.spectrum.push(time_s, vec![i as f32 / 10.0; BANDS]);
            heat.push(time_s, 30.0 + i as f32);
        }
        recording.temperatures.push(heat);
        for (time_s, state, cause) in [(0.5, "running", "armed"), (6.5, "holding", "asked")] {
            let (state, cause) = (state.into(), cause.into());
            recording.events.push(time_s, RecordedEvent { state, cause });
        }
        let (end, mut viewers) = link(1, settings());
        let mut player = Player::new(&recording, end);
        let mut at = |time_s| {
            assert!(viewers.ask(&[ViewerRequest::Hold, ViewerRequest::Seek(time_s)]));
            player.go(0.0);
            player.show();
            let seen = viewers.newest();
            let states: Vec<&str> = seen.events().iter().map(|e| e.state).collect();
            let (band, heat) = (seen.now.music.bands[7], seen.joints[0].temperature_c);
            (band, heat, states.join(" "))
        };
        assert_eq!(at(8.2), (0.8, 38.0, "playing running holding".into()));
        assert_eq!(at(3.0), (0.3, 33.0, "playing running".into()));
        assert_eq!(at(0.0), (0.0, 30.0, "playing".into()));
        assert_eq!(at(9.0), (0.9, 39.0, "playing running holding".into()));
    }

    #[test]
    fn it_plays_pauses_seeks_and_starts_again_at_the_end() {
        let mut recording = Recording { ..Recording::default() };
        for i in 0..100 {
            let values = vec![i as f32 / 10.0];
            recording.states.push(f64::from(i) / 50.0 - 1.0, values);
        }
        let (end, mut viewers) = link(1, settings());
        let mut player = Player::new(&recording, end);
        let mut after = |passed_s, requests: &[ViewerRequest]| {
            assert!(viewers.ask(requests));
            player.go(passed_s);
            player.show();
            let snapshot = viewers.newest();
            (snapshot.now.music_s, snapshot.joints[0].position_rad)
        };
        assert_eq!(after(0.5, &[]).0, -0.5);
        assert_eq!(after(0.5, &[ViewerRequest::Hold]).0, -0.5);
        let (time_s, rad) = after(0.0, &[ViewerRequest::Seek(0.5)]);
        assert!((time_s - 0.5).abs() < 1e-9 && (rad - 7.5).abs() < 1e-5, "{rad}");
        assert_eq!(after(0.1, &[ViewerRequest::Seek(f64::NAN)]).0, 0.5);
        assert_eq!(after(9.0, &[ViewerRequest::Resume]).0, 0.98);
        assert_eq!(after(9.0, &[]).0, 0.98, "it waits at the end");
        assert_eq!(after(0.0, &[ViewerRequest::Resume]).0, -1.0);
    }
}
