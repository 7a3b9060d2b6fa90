//! The beat grid of a song: from beats to seconds.

use super::error::SongError;

/// A number of beats at one tempo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TempoStep {
    /// Number of beats at this tempo.
    pub beats: usize,
    /// Beats a minute, 30 to 300.
    pub bpm: f64,
}

/// Times of the beats of a song.
#[derive(Clone, Debug, PartialEq)]
pub enum Grid {
    /// Tempi one after the other; the first beat is at 0 s.
    Tempo(Vec<TempoStep>),
    /// Beat times in seconds, increasing.
    Beats(Vec<f64>),
}

impl Grid {
    fn times_s(&self) -> Vec<f64> {
        match self {
            Grid::Beats(times) => times.clone(),
            Grid::Tempo(steps) => {
                let mut times = vec![0.0];
                let mut now = 0.0;
                for step in steps {
                    for _ in 0..step.beats {
                        now += 60.0 / step.bpm;
                        times.push(now);
                    }
                }
                times
            }
        }
    }
}

/// A checked grid that covers the whole song. Beat 0 is the first downbeat;
/// beats before it are negative.
pub(super) struct BeatGrid {
    times_s: Vec<f64>,
    zero: usize,
}

impl BeatGrid {
    pub(super) fn new(
        grid: &Grid,
        duration_s: f64,
        first_downbeat: usize,
    ) -> Result<Self, SongError> {
        let given = grid.times_s();
        if given.len() < 2 {
            return Err(SongError::TooFewBeats(given.len()));
        }
        for (i, pair) in given.windows(2).enumerate() {
            let interval_s = pair[1] - pair[0];
            if !(0.2..=2.0).contains(&interval_s) {
                let index = i + 1;
                return Err(SongError::Interval { index, interval_s });
            }
        }
        Ok(Self::covering(&given, duration_s, first_downbeat))
    }

    /// Continues at the outer tempi to one bar beyond either end of the song.
    fn covering(given: &[f64], duration_s: f64, first_downbeat: usize) -> Self {
        let (first, last) = (given[0], given[given.len() - 1]);
        let lead_s = given[1] - first;
        let tail_s = last - given[given.len() - 2];
        let before = (first.max(0.0) / lead_s).ceil() as usize + 4;
        let after = ((duration_s - last).max(0.0) / tail_s).ceil() as usize + 4;
        let mut times_s: Vec<f64> = (1..=before).rev().map(|i| first - i as f64 * lead_s).collect();
        times_s.extend_from_slice(given);
        times_s.extend((1..=after).map(|i| last + i as f64 * tail_s));
        Self { times_s, zero: before + first_downbeat.min(given.len() - 1) }
    }

    pub(super) fn time_s(&self, beat: f64) -> f64 {
        let position = beat + self.zero as f64;
        let last = self.times_s.len() - 2;
        let index = (position.floor().max(0.0) as usize).min(last);
        let (a, b) = (self.times_s[index], self.times_s[index + 1]);
        a + (b - a) * (position - index as f64)
    }

    /// Bars that sound between 0 s and `duration_s`.
    pub(super) fn bars(&self) -> std::ops::Range<i64> {
        let beats_before = self.zero as i64;
        let beats_after = self.times_s.len() as i64 - beats_before;
        -(beats_before / 4)..(beats_after / 4)
    }

    /// Beats from 0 s up to `duration_s`, and the indices of those that open a bar.
    pub(super) fn truth(&self, duration_s: f64) -> (Vec<f64>, Vec<usize>) {
        let mut beats_s = Vec::new();
        let mut downbeats = Vec::new();
        for (i, &time) in self.times_s.iter().enumerate() {
            if time < -1e-9 || time >= duration_s {
                continue;
            }
            if (i as i64 - self.zero as i64).rem_euclid(4) == 0 {
                downbeats.push(beats_s.len());
            }
            beats_s.push(time.max(0.0));
        }
        (beats_s, downbeats)
    }
}
