//! Before live music: the robot stands until motion comes as it is made.

use super::{ControlLoop, LoopState};
use crate::control::latency::Arrivals;
use crate::pipeline::dance_step::Polled;
use crate::pipeline::motion_source::MotionSource;
use std::time::{Duration, Instant};

impl ControlLoop<'_> {
    /// Stands until music comes as it is made, then starts the clock by its
    /// time stamps, the cycles being so placed that each motion frame is
    /// there just before one of them. `false` if interrupted.
    pub(super) fn wait_for_music(
        &mut self,
        source: &mut MotionSource,
        on_frame: &mut impl FnMut(f64),
    ) -> anyhow::Result<bool> {
        self.state = LoopState::Listening;
        let standing: Vec<f64> = self.servos.safety().sent_rad().to_vec();
        let mut arrivals = Arrivals::default();
        while !self.is_interrupted() {
            self.handle_requests(source)?;
            if self.stop_requested || self.servos.has_fallen() {
                self.plan.targets_rad.copy_from_slice(&standing);
                self.clock.start_now();
                return Ok(true);
            }
            match source.poll()? {
                Polled::Step(step) => {
                    self.accept(&step, on_frame);
                    arrivals.push(&step);
                }
                Polled::Ended => {
                    self.input.ended = true;
                    return Ok(true);
                }
                Polled::Late | Polled::Away => {
                    arrivals.caught_up();
                    if let Some(first) = arrivals.first_cycle(self.robot.period_s(), Instant::now())
                    {
                        std::thread::sleep(first.saturating_duration_since(Instant::now()));
                        self.clock.cycles.start_at(first);
                        self.clock.music_start_s = -arrivals.music_s(first);
                        return Ok(true);
                    }
                    self.stand(&standing)?;
                }
            }
        }
        Ok(false)
    }

    /// One cycle in the present pose, so that the servos' watchdogs stay fed.
    fn stand(&mut self, pose_rad: &[f64]) -> anyhow::Result<()> {
        std::thread::sleep(Duration::from_secs_f64(self.robot.period_s()));
        self.servos.cycle(self.clock.cycles.elapsed_s(), pose_rad)?;
        self.publish();
        Ok(())
    }
}
