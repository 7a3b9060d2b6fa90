//! What is kept of a run for its report and its picture: positions twenty
//! times a second. An hour of twenty joints takes about 40 MB; of a live run,
//! which may last for days, only the newest minutes are kept.

use servodance_types::MotionFrame;

/// Joint positions over time, flat: `joints` values a sample.
#[derive(Clone, Debug)]
pub struct JointTrace {
    joints: usize,
    times_s: Vec<f64>,
    positions_rad: Vec<f64>,
}

impl JointTrace {
    pub fn new(joints: usize) -> Self {
        Self { joints, times_s: Vec::new(), positions_rad: Vec::new() }
    }

    pub fn push(&mut self, time_s: f64, positions_rad: impl Iterator<Item = f64>) {
        self.times_s.push(time_s);
        self.positions_rad.extend(positions_rad.take(self.joints));
        debug_assert_eq!(self.positions_rad.len(), self.times_s.len() * self.joints);
    }

    fn forget_before(&mut self, time_s: f64) {
        let gone = self.times_s.partition_point(|t| *t < time_s);
        self.times_s.drain(..gone);
        self.positions_rad.drain(..gone * self.joints);
    }

    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Positions of one sample, radians.
    pub fn sample(&self, index: usize) -> &[f64] {
        &self.positions_rad[index * self.joints..][..self.joints]
    }

    /// The sample at or just after a time.
    pub fn index_at(&self, time_s: f64) -> Option<usize> {
        let index = self.times_s.partition_point(|t| *t < time_s - 1e-9);
        (index < self.times_s.len()).then_some(index)
    }

    /// One joint over time: seconds, radians.
    pub fn joint(&self, joint: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.times_s.iter().enumerate().map(move |(i, t)| (*t, self.sample(i)[joint]))
    }

    /// Mean joint speed at each sample, radians a second: the mean of the step
    /// to it and the step from it, samples being `1 / rate_hz` apart.
    pub fn mean_speed(&self, rate_hz: f64) -> Vec<f64> {
        let count = self.times_s.len();
        let step = |from: usize| -> f64 {
            let moved = self.sample(from).iter().zip(self.sample(from + 1));
            let sum: f64 = moved.map(|(a, b)| (b - a).abs()).sum();
            sum / self.joints as f64 * rate_hz
        };
        let steps: Vec<f64> = (1..count).map(|i| step(i - 1)).collect();
        (0..count)
            .map(|i| {
                let around = &steps[i.saturating_sub(1)..(i + 1).min(steps.len())];
                around.iter().sum::<f64>() / around.len().max(1) as f64
            })
            .collect()
    }
}

#[derive(Clone, Debug)]
pub struct Trace {
    pub motion: Vec<MotionFrame>,
    pub targets: JointTrace,
    pub servos: JointTrace,
    /// Pose of the root link at each sample of `servos`.
    pub roots: Vec<[f64; 7]>,
}

impl Trace {
    pub fn new(joints: usize) -> Self {
        Self {
            motion: Vec::new(),
            targets: JointTrace::new(joints),
            servos: JointTrace::new(joints),
            roots: Vec::new(),
        }
    }

    /// Drops samples older than `most_s` once in a while: at most twice that is
    /// kept at any time.
    pub fn keep_newest(&mut self, most_s: f64) {
        let ends = (self.motion.first(), self.motion.last());
        let (Some(first), Some(last)) = ends else {
            return;
        };
        if last.time_s - first.time_s <= 2.0 * most_s {
            return;
        }
        let from_s = last.time_s - most_s;
        let gone = self.motion.partition_point(|frame| frame.time_s < from_s);
        self.motion.drain(..gone);
        self.targets.forget_before(from_s);
        self.servos.forget_before(from_s);
        let kept = self.servos.times_s().len();
        self.roots.drain(..self.roots.len().saturating_sub(kept));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_newest_minutes_are_kept() {
        let mut trace = Trace::new(1);
        for i in 0..72_000 {
            let time_s = f64::from(i) * 0.05;
            trace.motion.push(MotionFrame {
                time_s,
                positions: [[0.0; 3]; servodance_types::JOINT_COUNT],
                contacts: Default::default(),
            });
            trace.targets.push(time_s, [0.0].into_iter());
            trace.servos.push(time_s, [time_s].into_iter());
            trace.keep_newest(60.0);
            assert!(trace.motion.len() <= 2402);
        }
        assert_eq!(trace.servos.times_s().len(), trace.motion.len());
        let newest = trace.servos.times_s().len() - 1;
        assert_eq!(trace.servos.sample(newest), [trace.servos.times_s()[newest]]);
    }

    #[test]
    fn mean_speed_is_per_joint_and_second() {
        let mut trace = JointTrace::new(2);
        trace.push(0.00, [0.0, 1.0].into_iter());
        trace.push(0.05, [0.1, 0.9].into_iter());
        let speed = trace.mean_speed(20.0);
        assert!(speed.iter().all(|s| (s - 2.0).abs() < 1e-5), "{speed:?}");
        assert_eq!(trace.index_at(0.02), Some(1));
        assert_eq!(trace.index_at(0.06), None);
    }
}
