//! A session: one dance, or one after another, each begun by a viewer's `start`.
//!
//! Torque is off between dances. What was set (style, seed, amplitude, mirror,
//! idle behaviour) stays; report, recording and picture are those of the last
//! dance. An emergency stop, or an error, ends a dance and not the session.

use super::config::DanceConfig;
use super::dance::{Outcome, Prepared, open_generator, perform, prepare, watch_emergency_stop};
use crate::pipeline::audio_input::AudioChoice;
use crate::process::console::stderr_line;
use crate::process::interrupted::Interrupted;
use crate::viewer::{
    Activity, RobotEnd, Scene, Songs, ViewerEnd, ViewerRequest, ViewerSettings, snapshot,
};
use anyhow::bail;
use servodance_model::Generator;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often requests are looked at while the session waits.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// A robot, its music, and the link to its viewers.
pub struct Session {
    config: DanceConfig,
    generator: Generator,
    end: RobotEnd,
    songs: Songs,
    /// What it began with: danced again when the microphone of a page is closed.
    first: AudioChoice,
    /// Place of the style in the configuration.
    style: usize,
}

impl Session {
    /// Loads all that can be loaded before the first dance.
    pub fn new(config: DanceConfig) -> anyhow::Result<Self> {
        let generator = open_generator(config.generator.model.as_deref(), config.generator.engine)?;
        let style = config.generator.style.as_deref();
        let style = generator.style_index(style.unwrap_or(generator.default_style()))?;
        let settings = ViewerSettings {
            amplitude: config.robot.retarget.amplitude,
            mirror: config.robot.retarget.mirror,
            idle: config.idle,
            style,
            seed: config.generator.seed,
        };
        let mut end = RobotEnd::new(config.robot.servos.len(), settings);
        end.dead_man_s = config.dead_man_s;
        let (songs, first) = (Songs::new(&config.audio), config.audio.clone());
        Ok(Self { end, songs, first, config, generator, style })
    }

    /// The end of the link for one more viewer.
    pub fn add_viewer(&mut self) -> ViewerEnd {
        self.end.add_viewer()
    }

    /// The songs, for a page that plays and adds them.
    pub fn songs(&self) -> Songs {
        self.songs.clone()
    }

    /// What viewers get once, before the first snapshot.
    pub fn scene(&self) -> anyhow::Result<Scene> {
        let styles = self.generator.styles().to_vec();
        let scene = Scene::of_robot(&self.config.robot, styles, self.config.view.is_some())?;
        let speaker = self.config.speaker.is_some();
        Ok(Scene { waits: self.config.wait_for_start, speaker, ..scene })
    }

    /// Dances, and then to each song that viewers have added; `each` gets the outcome of every
    /// dance. With `wait_for_start` the session then waits and goes on until `stop` is set.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        mut each: impl FnMut(&DanceConfig, &anyhow::Result<Outcome>),
    ) -> anyhow::Result<()> {
        let _watch = watch_emergency_stop(&self.config, &self.end.estop)?;
        if !self.config.wait_for_start {
            return self.dance_songs(stop, &mut each).map(drop);
        }
        while self.wait(stop) {
            self.take_song();
            // Errors were told, and end no evening.
            let _ = self.dance_songs(stop, &mut each);
        }
        if self.end.is_alone() && !stop.load(Ordering::Relaxed) {
            bail!("whoever could say start broke down: the evening is over");
        }
        if !self.end.torque_was_off() {
            bail!("torque off could not be verified: cut the power");
        }
        Ok(())
    }

    /// One dance after another, until no song waits, a dance does not end by itself, or
    /// dead-man mode finds nobody there.
    fn dance_songs(
        &mut self,
        stop: &AtomicBool,
        each: &mut impl FnMut(&DanceConfig, &anyhow::Result<Outcome>),
    ) -> anyhow::Result<Outcome> {
        self.end.begins_row = true;
        loop {
            let prepared = self.prepare(stop);
            if self.passes_over(&prepared, stop) {
                continue;
            }
            let outcome = prepared.and_then(|prepared| self.dance(prepared, stop));
            let stopped = outcome.as_ref().is_err_and(|error| error.is::<Interrupted>());
            if !stopped {
                each(&self.config, &outcome);
            }
            if !self.goes_on_after(&outcome) || !self.take_song() {
                return outcome;
            }
        }
    }

    /// Takes the next song where one could not begin; `false` where there is none, or nobody
    /// wants it.
    fn passes_over(&mut self, prepared: &anyhow::Result<Prepared>, stop: &AtomicBool) -> bool {
        let Err(error) = prepared else {
            return false;
        };
        let is_stopped = stop.load(Ordering::Relaxed) || self.end.estop.is_pressed();
        if is_stopped || !self.end.is_attended() || !self.take_song() {
            return false;
        }
        stderr_line!("{error:#}; the next song is taken");
        true
    }

    /// Whether the next song may be danced without anybody's start.
    fn goes_on_after(&self, outcome: &anyhow::Result<Outcome>) -> bool {
        let Ok(outcome) = outcome else {
            return false;
        };
        !outcome.interrupted && !outcome.unattended && self.end.is_attended()
    }

    /// Takes the next song; `false` if none waits.
    fn take_song(&mut self) -> bool {
        let next = self.songs.next();
        let is_there = next.is_some();
        let is_over = matches!(&self.config.audio, AudioChoice::Page(sound) if sound.is_over());
        match next {
            Some(next) => self.config.audio = next,
            None if is_over => self.config.audio = self.first.clone(),
            None => {}
        }
        is_there
    }

    /// What a dance needs, with the settings that viewers made last. Torque stays off.
    fn prepare(&mut self, stop: &AtomicBool) -> anyhow::Result<Prepared> {
        let ViewerSettings { idle, style, seed, .. } = self.end.settings;
        self.config.idle = idle;
        self.config.generator.seed = seed;
        if style != self.style {
            self.style = style;
            self.config.generator.style = self.generator.styles().get(style).cloned();
        }
        self.end.publish(|s| {
            s.now.activity = Activity::Starting;
            s.now.stopped = None;
        });
        let prepared = prepare(&self.config, &self.generator, stop, &self.end.estop);
        // A microphone may have been silent for long.
        let prepared = prepared.and_then(|prepared| match self.end.is_attended() {
            true => Ok(prepared),
            false => bail!("no operator is there any more: torque stays off"),
        });
        prepared.inspect_err(|error| show_error(&mut self.end, error))
    }

    /// One dance.
    fn dance(&mut self, prepared: Prepared, stop: &AtomicBool) -> anyhow::Result<Outcome> {
        let estop = self.end.estop.clone();
        let end = Some(&mut self.end);
        let outcome = perform(&self.config, &self.generator, prepared, stop, &estop, end);
        outcome.inspect_err(|error| show_error(&mut self.end, error))
    }

    /// Waits for `start`; false if the session is over.
    fn wait(&mut self, stop: &AtomicBool) -> bool {
        self.end.publish(|snapshot| {
            snapshot.now.activity = Activity::Waiting;
            snapshot.now.hold = false;
        });
        let torque_is_off = self.end.torque_was_off();
        while !stop.load(Ordering::Relaxed) && !self.end.is_alone() {
            while let Some(request) = self.end.request() {
                request.apply_to(&mut self.end.settings);
                match request {
                    ViewerRequest::Start if !self.end.estop.is_pressed() => return true,
                    ViewerRequest::Release => self.end.estop.clear(),
                    _ => {}
                }
            }
            self.end.confirm_stop(torque_is_off);
            std::thread::sleep(POLL_INTERVAL);
        }
        false
    }
}

/// The last that viewers see of a dance that an error ended.
fn show_error(end: &mut RobotEnd, error: &anyhow::Error) {
    let cause = format!("{error:#}");
    end.publish(|snapshot| {
        snapshot.now.activity = Activity::Over;
        let time_s = snapshot.now.robot_s;
        snapshot.push_event(snapshot::ViewerEvent { time_s, state: "error", cause });
    });
    end.confirm_stop(end.torque_was_off());
}
