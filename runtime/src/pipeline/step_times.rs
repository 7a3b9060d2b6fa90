//! How long each step of the pipeline takes: one sample a call, percentiles
//! at the end. Wall-clock milliseconds; never used to decide anything.

use serde::{Deserialize, Serialize};
use servodance_types::named;
use std::time::Instant;

/// A step of the way from sound to servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PipelineStep {
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

named!(PipelineStep {
    Features "features", Model "model", Retarget "retarget", Control "control", Bus "bus"
});

/// Percentiles of a duration, milliseconds. All zero where there was no sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepTimes {
    /// Median of all samples.
    pub p50_ms: f64,
    /// 99th percentile of all samples.
    pub p99_ms: f64,
    /// The longest of all samples.
    pub max_ms: f64,
}

impl StepTimes {
    /// Nearest-rank percentiles of `samples_ms`.
    pub fn of(samples_ms: &[f64]) -> Self {
        Self::sorting(&mut samples_ms.to_vec())
    }

    /// The same of samples that may be put in order: nothing is allocated.
    pub fn sorting(sorted: &mut [f64]) -> Self {
        sorted.sort_unstable_by(f64::total_cmp);
        let rank = |share: f64| -> f64 {
            let index = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(index.saturating_sub(1)).copied().unwrap_or_default()
        };
        Self { p50_ms: rank(0.50), p99_ms: rank(0.99), max_ms: rank(1.0) }
    }
}

/// Times kept before every second one is let go.
const KEPT: usize = 1 << 14;

/// Times for percentiles, in constant memory: all of them for the first
/// minutes, then every second, every fourth and so on, evenly over the run. The
/// longest is never let go.
#[derive(Clone, Debug)]
pub(crate) struct DurationLog {
    kept_ms: Vec<f64>,
    longest_ms: f64,
    seen: u64,
    stride: u64,
}

impl Default for DurationLog {
    fn default() -> Self {
        Self { kept_ms: Vec::new(), longest_ms: 0.0, seen: 0, stride: 1 }
    }
}

impl DurationLog {
    pub fn push(&mut self, ms: f64) {
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

    pub fn is_empty(&self) -> bool {
        self.seen == 0
    }

    pub fn percentiles(&self) -> StepTimes {
        StepTimes { max_ms: self.longest_ms, ..StepTimes::of(&self.kept_ms) }
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct StepClock {
    durations: [DurationLog; PipelineStep::ALL.len()],
}

impl StepClock {
    /// Runs `work` and keeps its time; returns that too, in milliseconds.
    pub fn time<T>(&mut self, step: PipelineStep, work: impl FnOnce() -> T) -> (T, f64) {
        let start = Instant::now();
        let result = work();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.push(step, ms);
        (result, ms)
    }

    pub fn push(&mut self, step: PipelineStep, ms: f64) {
        self.durations[step as usize].push(ms);
    }

    pub fn times(&self, step: PipelineStep) -> StepTimes {
        self.durations[step as usize].percentiles()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_rank() {
        let samples: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let times = StepTimes::of(&samples);
        assert_eq!((times.p50_ms, times.p99_ms, times.max_ms), (100.0, 198.0, 200.0));
        assert_eq!(StepTimes::of(&[]), StepTimes::default());
    }

    #[test]
    fn hours_of_times_take_no_more_memory_and_keep_their_percentiles() {
        let mut times = DurationLog::default();
        // Without a period that every sixteenth of them could fall into.
        for i in 0..1_000_000u64 {
            times.push((i.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 % 1000.0);
        }
        times.push(5000.0);
        assert!(times.kept_ms.len() <= KEPT);
        let told = times.percentiles();
        assert!((told.p50_ms - 500.0).abs() < 10.0, "{told:?}");
        assert!((told.p99_ms - 990.0).abs() < 3.0, "{told:?}");
        assert_eq!(told.max_ms, 5000.0);
    }
}
