//! An evening: one dance, or one after another whenever somebody who watches
//! says `start`.
//!
//! Torque is off between dances. What was set (style, seed, amplitude, mirror,
//! idle behaviour) stays; report, recording and picture are those of the last
//! dance. An emergency stop, or an error, ends a dance and not the evening.

use crate::robot::Meshes;
use crate::session::config::DanceConfig;
use crate::session::dance::Outcome;
use crate::session::dance::open_generator;
use crate::session::dance::perform;
use crate::session::dance::watch;
use crate::viewer::{
    Activity, RobotEnd, Scene, ViewerEnd, ViewerRequest, ViewerSettings, snapshot,
};
use anyhow::bail;
use servodance_drivers::State;
use servodance_model::Generator;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often somebody may have said `start`.
const EVERY: Duration = Duration::from_millis(20);

/// A robot, its music, and the line to those who watch.
pub struct Evening {
    config: DanceConfig,
    generator: Generator,
    end: RobotEnd,
}

impl Evening {
    /// Everything that can be loaded before somebody watches.
    ///
    /// # Errors
    /// A model that cannot be loaded, a style that it does not know.
    pub fn new(config: DanceConfig) -> anyhow::Result<Self> {
        let generator = open_generator(config.model.as_deref(), config.engine)?;
        let style = config.style.as_deref();
        let settings = ViewerSettings {
            amplitude: config.robot.retarget.amplitude,
            mirror: config.robot.retarget.mirror,
            idle: config.idle,
            style: generator.style_index(style.unwrap_or(generator.default_style()))?,
            seed: config.seed,
        };
        Ok(Self {
            end: RobotEnd::new(config.robot.servos.len(), settings),
            config,
            generator,
        })
    }

    /// A viewer's end of the line; each viewer has their own.
    pub fn seat(&mut self) -> ViewerEnd {
        self.end.add_viewer()
    }

    /// The same, waiting for `start` before each dance.
    pub fn waiting_for_start(mut self) -> Self {
        self.config.wait_for_start = true;
        self
    }

    /// What those who watch are told once.
    ///
    /// # Errors
    /// A robot that cannot be drawn.
    pub fn scene(&self) -> anyhow::Result<Scene> {
        let robot = &self.config.robot;
        let model = robot.retargeter()?.model().clone();
        let meshes = match self.config.view {
            Some(_) => Meshes::load(robot, &model),
            None => Meshes::default(),
        };
        Ok(Scene {
            robot: robot.name.clone(),
            model,
            meshes,
            joints: robot.joint_limits(),
            styles: self.generator.styles().to_vec(),
            control_hz: robot.control_hz,
            waits: self.config.wait_for_start,
            recording_s: None,
        })
    }

    /// Dances, `each` being told of every dance. With `wait_for_start` it goes
    /// on until `stop` is set; otherwise there is one dance.
    ///
    /// # Errors
    /// That of a single dance. Of several, `each` is told.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        mut each: impl FnMut(&DanceConfig, &anyhow::Result<Outcome>),
    ) -> anyhow::Result<()> {
        let _watch = watch(&self.config, &self.end.estop)?;
        if !self.config.wait_for_start {
            let outcome = self.dance(stop);
            each(&self.config, &outcome);
            return outcome.map(drop);
        }
        while self.wait(stop) {
            let outcome = self.dance(stop);
            each(&self.config, &outcome);
        }
        if self.end.is_alone() && !stop.load(Ordering::Relaxed) {
            bail!("whoever could say start broke down: the evening is over");
        }
        Ok(())
    }

    /// One dance as it was last set.
    fn dance(&mut self, stop: &AtomicBool) -> anyhow::Result<Outcome> {
        let ViewerSettings {
            idle, style, seed, ..
        } = self.end.settings;
        self.config.idle = idle;
        self.config.seed = seed;
        let styles = self.generator.styles();
        let style = styles[style.min(styles.len() - 1)].clone();
        let usual = style == self.generator.default_style() && self.config.style.is_none();
        self.config.style = (!usual).then_some(style);
        self.end.publish(|s| s.now.activity = Activity::Starting);
        let estop = self.end.estop.clone();
        let end = Some(&mut self.end);
        let outcome = perform(&self.config, &self.generator, stop, &estop, end);
        if let Err(error) = &outcome {
            let cause = format!("{error:#}");
            self.end.publish(|snapshot| {
                snapshot.now.activity = Activity::Over;
                snapshot.push_event(snapshot::ViewerEvent {
                    time_s: snapshot.now.robot_s,
                    state: "error",
                    cause,
                });
            });
        }
        outcome
    }

    /// Waits for `start`; false if the evening is over.
    fn wait(&mut self, stop: &AtomicBool) -> bool {
        self.end.publish(|snapshot| {
            snapshot.now.activity = Activity::Waiting;
            snapshot.now.safety = State::Disarmed;
            snapshot.now.hold = false;
        });
        while !stop.load(Ordering::Relaxed) && !self.end.is_alone() {
            let mut changed = false;
            while let Some(request) = self.end.request() {
                request.apply_to(&mut self.end.settings);
                changed = true;
                match request {
                    ViewerRequest::Start if !self.end.estop.is_pressed() => return true,
                    ViewerRequest::Release => self.end.estop.clear(),
                    _ => {}
                }
            }
            if changed {
                self.end.publish(|_| {});
            }
            std::thread::sleep(EVERY);
        }
        false
    }
}
