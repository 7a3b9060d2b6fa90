//! How long each stage of the pipeline takes: one sample a call, percentiles
//! at the end. Wall-clock milliseconds; never used to decide anything.

use serde::{Deserialize, Serialize};
use std::time::Instant;

/// A stage of the way from sound to servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Audio to music features and beat, once a motion frame (50 ms of audio).
    Features,
    /// Features to tokens to a motion frame, once a motion frame.
    Model,
    /// Motion to joint targets, once a control cycle.
    Retarget,
    /// The rest of a control cycle: recording and bookkeeping.
    Control,
    /// Targets out and states in over the bus, once a control cycle.
    Bus,
}

impl Stage {
    /// All stages, in the order in which sound passes them.
    pub const ALL: [Stage; 5] = [
        Stage::Features,
        Stage::Model,
        Stage::Retarget,
        Stage::Control,
        Stage::Bus,
    ];

    /// The name in reports and recordings.
    pub const fn name(self) -> &'static str {
        match self {
            Stage::Features => "features",
            Stage::Model => "model",
            Stage::Retarget => "retarget",
            Stage::Control => "control",
            Stage::Bus => "bus",
        }
    }
}

/// Percentiles of one stage, milliseconds. All zero when it never ran.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Median.
    pub p50_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
    /// Longest.
    pub max_ms: f64,
}

impl StageTimes {
    /// Nearest-rank percentiles of `samples_ms`.
    pub fn of(samples_ms: &[f64]) -> Self {
        let mut sorted = samples_ms.to_vec();
        sorted.sort_by(f64::total_cmp);
        let rank = |share: f64| -> f64 {
            let index = (share * sorted.len() as f64).ceil() as usize;
            sorted
                .get(index.saturating_sub(1))
                .copied()
                .unwrap_or_default()
        };
        Self {
            p50_ms: rank(0.50),
            p99_ms: rank(0.99),
            max_ms: rank(1.0),
        }
    }
}

/// Times kept before every second one is let go.
const KEPT: usize = 1 << 14;

/// Times for percentiles, in constant memory: all of them for the first
/// minutes, then every second, every fourth and so on, evenly over the run. The
/// longest is never let go.
#[derive(Clone, Debug)]
pub struct Times {
    kept_ms: Vec<f64>,
    longest_ms: f64,
    seen: u64,
    stride: u64,
}

impl Default for Times {
    fn default() -> Self {
        Self {
            kept_ms: Vec::new(),
            longest_ms: 0.0,
            seen: 0,
            stride: 1,
        }
    }
}

impl Times {
    /// Adds one, milliseconds.
    pub fn book(&mut self, ms: f64) {
        self.longest_ms = self.longest_ms.max(ms);
        if self.seen.is_multiple_of(self.stride) {
            if self.kept_ms.len() == KEPT {
                let mut index = 0;
                self.kept_ms.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.stride *= 2;
            }
            if self.seen.is_multiple_of(self.stride) {
                self.kept_ms.push(ms);
            }
        }
        self.seen += 1;
    }

    /// Whether there was none.
    pub fn is_empty(&self) -> bool {
        self.seen == 0
    }

    /// Nearest-rank percentiles.
    pub fn percentiles(&self) -> StageTimes {
        StageTimes {
            max_ms: self.longest_ms,
            ..StageTimes::of(&self.kept_ms)
        }
    }
}

/// Times of every stage.
#[derive(Clone, Debug, Default)]
pub struct StageClock {
    times: [Times; Stage::ALL.len()],
}

impl StageClock {
    /// Runs `work` and books its time under `stage`; also returns the time, in
    /// milliseconds.
    pub fn time<T>(&mut self, stage: Stage, work: impl FnOnce() -> T) -> (T, f64) {
        let start = Instant::now();
        let result = work();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.book(stage, ms);
        (result, ms)
    }

    /// Books a time that was measured elsewhere.
    pub fn book(&mut self, stage: Stage, ms: f64) {
        self.times[stage as usize].book(ms);
    }

    /// Percentiles of one stage.
    pub fn times(&self, stage: Stage) -> StageTimes {
        self.times[stage as usize].percentiles()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_rank() {
        let samples: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let times = StageTimes::of(&samples);
        assert_eq!(
            (times.p50_ms, times.p99_ms, times.max_ms),
            (100.0, 198.0, 200.0)
        );
        assert_eq!(StageTimes::of(&[]), StageTimes::default());
    }

    #[test]
    fn hours_of_times_take_no_more_memory_and_keep_their_percentiles() {
        let mut times = Times::default();
        // Without a period that every sixteenth of them could fall into.
        for i in 0..1_000_000u64 {
            times.book((i.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 % 1000.0);
        }
        times.book(5000.0);
        assert!(times.kept_ms.len() <= KEPT);
        let told = times.percentiles();
        assert!((told.p50_ms - 500.0).abs() < 10.0, "{told:?}");
        assert!((told.p99_ms - 990.0).abs() < 3.0, "{told:?}");
        assert_eq!(told.max_ms, 5000.0);
    }
}
