//! The music's beats as one running count: which beat is when, a little back
//! and a little ahead.
//!
//! Beat 17.25 is a quarter of a beat after beat 17. The count comes from the
//! phase that the tracker gave at each music frame; ahead of the newest frame
//! the tempo goes on. Seconds of music. Constant memory.

use servodance_types::{BeatLock, MusicFrame};
use std::collections::VecDeque;

/// Frames kept: ten seconds.
const KEPT: usize = 200;
/// Frames farther apart than this do not belong to one count, seconds.
const LONGEST_HOLE_S: f64 = 1.0;

/// The beats around now, while there is one.
#[derive(Clone, Debug, Default)]
pub struct BeatClock {
    /// Time and count of each frame; the count never stands still for long.
    counted: VecDeque<(f64, f64)>,
    period_s: f64,
}

impl BeatClock {
    pub fn push(&mut self, music: &MusicFrame) {
        let beat = music.beat;
        let usable = beat.phase.is_finite() && (20.0..=400.0).contains(&beat.tempo_bpm);
        if beat.lock == BeatLock::Lost || !usable {
            self.counted.clear();
            return;
        }
        self.period_s = 60.0 / f64::from(beat.tempo_bpm);
        let phase = f64::from(beat.phase);
        let count = match self.counted.back() {
            Some((time_s, count)) if (0.0..LONGEST_HOLE_S).contains(&(music.time_s - time_s)) => {
                let expected = count + (music.time_s - time_s) / self.period_s;
                let corrected = phase - expected;
                expected + corrected - corrected.round()
            }
            _ => {
                self.counted.clear();
                phase
            }
        };
        if self.counted.len() == KEPT {
            self.counted.pop_front();
        }
        self.counted.push_back((music.time_s, count));
    }

    /// Seconds between two beats now; `None` while there is no beat.
    pub fn period_s(&self) -> Option<f64> {
        (!self.counted.is_empty()).then_some(self.period_s)
    }

    /// The count at a time; `None` where the beat was not known.
    pub fn count_at(&self, time_s: f64) -> Option<f64> {
        let (newest_s, newest) = *self.counted.back()?;
        if time_s >= newest_s {
            return Some(newest + (time_s - newest_s) / self.period_s);
        }
        let after = self.counted.partition_point(|(t, _)| *t <= time_s);
        let (from, to) = (self.counted.get(after.checked_sub(1)?)?, self.counted[after]);
        let share = (time_s - from.0) / (to.0 - from.0);
        Some(from.1 + share * (to.1 - from.1))
    }

    /// The time at which the count is reached, by the newest phase and tempo.
    pub fn time_of(&self, count: f64) -> Option<f64> {
        let (newest_s, newest) = *self.counted.back()?;
        Some(newest_s + (count - newest) * self.period_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::Beat;

    fn frame(time_s: f64, beats: f64, bpm: f64) -> MusicFrame {
        MusicFrame {
            time_s,
            beat: Beat {
                phase: beats.rem_euclid(1.0) as f32,
                tempo_bpm: bpm as f32,
                confidence: 1.0,
                lock: BeatLock::Locked,
                ..Beat::default()
            },
            ..MusicFrame::default()
        }
    }

    #[test]
    fn beats_are_counted_on_and_predicted() {
        let mut clock = BeatClock::default();
        for k in 0..100 {
            let time_s = f64::from(k) * 0.05;
            clock.push(&frame(time_s, 0.3 + 2.0 * time_s, 120.0));
        }
        let count = clock.count_at(3.1).unwrap();
        assert!((count - 6.5).abs() < 1e-4, "{count}");
        assert!((clock.time_of(12.3).unwrap() - 6.0).abs() < 1e-4);
        assert_eq!(clock.count_at(-1.0), None);
    }

    #[test]
    fn a_lost_beat_ends_the_count() {
        let mut clock = BeatClock::default();
        clock.push(&frame(0.0, 0.0, 120.0));
        assert!(clock.period_s().is_some());
        clock.push(&MusicFrame::default());
        assert_eq!(clock.period_s(), None);
        assert_eq!(clock.count_at(0.0), None);
    }
}
