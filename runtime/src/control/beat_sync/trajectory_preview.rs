//! Trajectory preview: the robot's own kinematic beats before they are danced.
//!
//! A second retargeter runs the same motion at an even pace, as far ahead as the
//! motion reaches. Where its joints pause, the robot's will pause: a
//! kinematic beat is a local minimum of the mean joint speed (lower than all
//! within a sixth of a second, as `model::metrics::alignment` has it). It costs
//! as much as retargeting does, a twentieth of a millisecond a cycle. Seconds of
//! motion time.

use servodance_retarget::Retargeter;
use servodance_types::MotionFrame;
use std::collections::VecDeque;

/// A kinematic beat is the slowest moment within this, seconds to each side.
const AROUND_S: f64 = 1.0 / 6.0;
/// Speed is taken over steps of this length, as long as a motion frame.
const STEP_S: f64 = 0.05;
/// Cycles computed at most in one call, so that a call takes bounded time.
const MOST_CYCLES: usize = 16;
/// Motion that starts anew this far away is previewed from there.
const FAR_S: f64 = 3.0;
/// Computed before the first frame, seconds: the retargeter's preview must fill.
const RUN_UP_S: f64 = 0.5;
/// Kinematic beats that are kept.
const KEPT: usize = 64;

pub struct TrajectoryPreview {
    retargeter: Retargeter,
    period_s: f64,
    /// Next moment to be computed; `None` before the first frame.
    next_s: Option<f64>,
    newest_s: f64,
    /// The last positions, oldest first, one a cycle.
    positions: VecDeque<Vec<f64>>,
    /// Speeds of the last cycles, oldest first; the last is `speed_lag` old.
    speeds: VecDeque<f64>,
    beats_s: VecDeque<f64>,
}

impl TrajectoryPreview {
    pub fn new(retargeter: Retargeter, period_s: f64) -> Self {
        Self {
            retargeter,
            period_s,
            next_s: None,
            newest_s: 0.0,
            positions: VecDeque::new(),
            speeds: VecDeque::new(),
            beats_s: VecDeque::with_capacity(KEPT),
        }
    }

    /// From a motion frame to the knowledge of a kinematic beat, seconds.
    pub fn delay_s(&self) -> f64 {
        self.retargeter.lookahead_s() + AROUND_S + STEP_S
    }

    pub fn push(&mut self, frame: &MotionFrame) {
        self.retargeter.push(frame);
        self.newest_s = frame.time_s;
        let far = |next_s: f64| (next_s - frame.time_s).abs() > FAR_S;
        if self.next_s.is_none_or(far) {
            self.next_s = Some(frame.time_s - RUN_UP_S);
            self.positions.clear();
            self.speeds.clear();
        }
    }

    /// Computes what has come in, a bounded piece of it.
    pub fn advance(&mut self) -> anyhow::Result<()> {
        for _ in 0..MOST_CYCLES {
            let Some(now_s) = self.next_s else { break };
            if now_s + self.retargeter.lookahead_s() > self.newest_s {
                break;
            }
            self.step(now_s)?;
            self.next_s = Some(now_s + self.period_s);
        }
        Ok(())
    }

    /// Kinematic beats after `time_s` that are known, in order.
    pub fn beats_after(&self, time_s: f64) -> impl Iterator<Item = f64> + '_ {
        self.beats_s.iter().copied().filter(move |b| *b > time_s)
    }

    fn step(&mut self, now_s: f64) -> anyhow::Result<()> {
        let reach = self.cycles(STEP_S);
        let mut position = match self.positions.len() > 2 * reach {
            true => self.positions.pop_front().unwrap_or_default(),
            false => Vec::new(),
        };
        position.resize(self.retargeter.rest().len(), 0.0);
        self.retargeter.next(now_s, &mut position)?;
        self.positions.push_back(position);
        if self.positions.len() <= 2 * reach {
            return Ok(());
        }
        let moved = |a: usize, b: usize| -> f64 {
            let pairs = self.positions[a].iter().zip(&self.positions[b]);
            pairs.map(|(a, b)| (b - a).abs()).sum()
        };
        let speed = moved(0, reach) + moved(reach, 2 * reach);
        let around = self.cycles(AROUND_S);
        if self.speeds.len() > 2 * around {
            self.speeds.pop_front();
        }
        self.speeds.push_back(speed);
        if self.speeds.len() > 2 * around {
            self.find_beat(now_s - (reach + around) as f64 * self.period_s, around);
        }
        Ok(())
    }

    /// Keeps the middle of the known speeds if it is the lowest of all.
    fn find_beat(&mut self, middle_s: f64, middle: usize) {
        let lowest = self.speeds[middle];
        let mut others = self.speeds.iter().enumerate().filter(|(i, _)| *i != middle);
        if !others.all(|(_, speed)| lowest < *speed) {
            return;
        }
        if self.beats_s.len() == KEPT {
            self.beats_s.pop_front();
        }
        self.beats_s.push_back(middle_s);
    }

    fn cycles(&self, time_s: f64) -> usize {
        (time_s / self.period_s).round().max(1.0) as usize
    }
}
