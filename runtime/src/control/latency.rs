//! From sound to command, measured in every live run on the program's own
//! clock.
//!
//! Both times begin when the newest sample of a music frame was captured.
//! `ready`: until the control loop can use the motion frame made from it.
//! `command`: until the first command that was decided with it known is on the
//! wire. Motion that is shown late on purpose, to be on a beat, is no part of
//! this (`lead_s` in the report). Constant memory.

use crate::pipeline::dance_step::DanceStep;
use crate::pipeline::step_times::{DurationLog, StepTimes};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Percentiles of the time from sound to command, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatencyReport {
    /// From a captured sample to a motion frame that can be used.
    pub ready: StepTimes,
    /// From a captured sample to the first command decided with it known.
    pub command: StepTimes,
}

#[derive(Debug, Default)]
pub(crate) struct LatencyLog {
    /// Capture times of the frames that wait for a command.
    waiting: Vec<Instant>,
    ready_ms: DurationLog,
    command_ms: DurationLog,
}

impl LatencyLog {
    pub fn arrived(&mut self, step: &DanceStep) {
        let Some(captured) = step.captured else {
            return;
        };
        self.ready_ms.push(milliseconds(captured, step.ready));
        self.waiting.push(captured);
    }

    /// A command went out at `now`.
    pub fn sent(&mut self, now: Instant) {
        for captured in self.waiting.drain(..) {
            self.command_ms.push(milliseconds(captured, now));
        }
    }

    /// `None` if the audio was not live.
    pub fn report(&self) -> Option<LatencyReport> {
        (!self.ready_ms.is_empty()).then(|| LatencyReport {
            ready: self.ready_ms.percentiles(),
            command: self.command_ms.percentiles(),
        })
    }
}

/// Live frames that are timed before the first cycle.
const TIMED: usize = 8;
/// Kept between the arrival of a frame and the cycle that uses it.
const MARGIN: Duration = Duration::from_micros(2500);

/// How the first live frames arrive, so that the control cycles can be placed
/// just after them: a frame that waits for its cycle is latency.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Arrivals {
    /// Whether the frames that were there at the beginning are used up.
    is_live: bool,
    seen: usize,
    longest: Duration,
    /// Time of the newest frame, when its sound was captured.
    newest: Option<(f64, Instant)>,
}

impl Arrivals {
    pub fn push(&mut self, step: &DanceStep) {
        let captured = step.captured.unwrap_or(step.ready);
        self.newest = Some((step.motion.time_s, captured));
        if self.is_live {
            self.seen += 1;
            let took = step.ready.saturating_duration_since(captured);
            self.longest = self.longest.max(took);
        }
    }

    /// No frame is waiting: from here on they come as they are made.
    pub fn caught_up(&mut self) {
        self.is_live |= self.newest.is_some();
    }

    /// When the first cycle shall be: within a period from `now`, for the servos' watchdogs
    /// wait for it. `None` before enough frames were seen.
    pub fn first_cycle(&self, period_s: f64, now: Instant) -> Option<Instant> {
        let (_, captured) = self.newest.filter(|_| self.seen >= TIMED)?;
        // The cycles lie as if one were there: sound in bursts may take longer than a period.
        let aligned = captured + self.longest + MARGIN;
        let ahead_s = match aligned.checked_duration_since(now) {
            Some(ahead) => ahead.as_secs_f64(),
            None => -now.duration_since(aligned).as_secs_f64(),
        };
        Some(now + Duration::from_secs_f64(ahead_s.rem_euclid(period_s)))
    }

    /// The time in the music at a moment.
    pub fn music_s(&self, moment: Instant) -> f64 {
        self.newest.map_or(0.0, |(time_s, captured)| {
            time_s + moment.saturating_duration_since(captured).as_secs_f64()
        })
    }
}

fn milliseconds(from: Instant, to: Instant) -> f64 {
    to.saturating_duration_since(from).as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::{Beat, JOINT_COUNT, MotionFrame, MusicFrame, SPECTRAL_DIM};

    fn step(captured: Instant, ready: Instant) -> DanceStep {
        DanceStep {
            music: MusicFrame {
                time_s: 0.0,
                spectral: [0.0; SPECTRAL_DIM],
                beat: Beat::default(),
                presence: 0.0,
            },
            motion: MotionFrame {
                time_s: 0.0,
                positions: [[0.0; 3]; JOINT_COUNT],
                contacts: Default::default(),
            },
            posture: None,
            extra_styles: Default::default(),
            features_ms: 0.0,
            model_ms: 0.0,
            captured: Some(captured),
            ready,
        }
    }

    #[test]
    fn the_first_cycle_is_within_a_period_whatever_the_longest_burst() {
        const PERIOD_S: f64 = 0.01;
        let start = Instant::now() + Duration::from_secs(1);
        let at = |ms: u64| start + Duration::from_millis(ms);
        for longest_ms in [5, 20, 503, 9_007] {
            let mut arrivals = Arrivals::default();
            arrivals.push(&step(start, start));
            arrivals.caught_up();
            arrivals.push(&step(start, at(longest_ms)));
            assert_eq!(arrivals.first_cycle(PERIOD_S, start), None, "too few were seen");
            (1..TIMED).for_each(|_| arrivals.push(&step(start, at(3))));
            for now in [at(4), at(700)] {
                let first = arrivals.first_cycle(PERIOD_S, now).expect("a moment");
                let wait_s = first.duration_since(now).as_secs_f64();
                assert!(wait_s <= PERIOD_S, "{longest_ms} ms: {wait_s} s without a command");
                let aligned = at(longest_ms) + MARGIN;
                let off_s = (aligned.max(first) - aligned.min(first)).as_secs_f64() / PERIOD_S;
                assert!((off_s - off_s.round()).abs() < 1e-3, "{longest_ms} ms: {off_s} periods");
            }
        }
    }

    #[test]
    fn a_frame_counts_from_its_sound_to_the_command_after_it() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut latency = LatencyLog::default();
        latency.sent(at(5)); // nothing was known yet
        latency.arrived(&step(at(10), at(18)));
        latency.sent(at(22));
        latency.sent(at(30));
        let report = latency.report().expect("it was live");
        assert_eq!((report.ready.max_ms, report.command.max_ms), (8.0, 12.0));
        assert_eq!(LatencyLog::default().report(), None);
    }
}
