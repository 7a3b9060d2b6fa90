//! When the motion of which moment of the music is shown.
//!
//! A recording begins [`LEAD_IN_S`] after the start, so that followers are on
//! their way to the first pose. Live music is shown as late as the slowest
//! follower needs, in whole beats where there is a beat.

use crate::control::timing::LEAD_IN_S;
use crate::pipeline::dance_step::DanceStep;
use crate::pipeline::stage_source::LocalClock;
use servodance_types::FRAME_RATE_HZ;

/// Features and motion of live music take at most this, seconds.
const COMPUTING_S: f64 = 0.15;
/// Live motion is moved to another delay by so much in a second.
const DELAY_CHANGE: f64 = 0.1;
/// The capture times of live music are followed by this share a frame.
const CAPTURE_SHARE: f64 = 0.02;

#[derive(Clone, Copy, Debug, Default)]
pub struct Timeline {
    /// The leader's clock at the beginning of the music, nanoseconds.
    start_ns: Option<i64>,
    /// How much later than it was captured live music is shown, seconds.
    delay_s: Option<f64>,
    /// When the newest step is shown.
    pub newest_ns: i64,
}

impl Timeline {
    /// When to show a step, nanoseconds of the leader's clock.
    pub fn place(&mut self, step: &DanceStep, clock: LocalClock, needed_s: f64) -> i64 {
        let music_ns = nanoseconds(step.motion.time_s);
        let present_ns = match step.captured {
            None => *self.start_ns.get_or_insert_with(|| clock.now_ns() + nanoseconds(LEAD_IN_S)),
            Some(captured) => {
                let seen_ns = clock.at(captured) - music_ns;
                let start_ns = self.start_ns.get_or_insert(seen_ns);
                *start_ns += ((seen_ns - *start_ns) as f64 * CAPTURE_SHARE) as i64;
                *start_ns + nanoseconds(self.delay_s(step, needed_s))
            }
        } + music_ns;
        self.newest_ns = self.newest_ns.max(present_ns);
        present_ns
    }

    /// The moment of the music that is shown now, seconds; negative before it begins.
    pub fn music_s(&self, now_ns: i64) -> Option<f64> {
        let shown_ns = now_ns - self.start_ns?;
        Some(shown_ns as f64 * 1e-9 - self.delay_s.unwrap_or(0.0))
    }

    /// How late live motion is shown: as few whole beats as will do.
    fn delay_s(&mut self, step: &DanceStep, needed_s: f64) -> f64 {
        let least_s = needed_s + COMPUTING_S;
        let tempo = f64::from(step.music.beat.tempo_bpm);
        let wanted_s = match tempo > 0.0 {
            true => (least_s * tempo / 60.0).ceil() * 60.0 / tempo,
            false => least_s,
        };
        let most = DELAY_CHANGE / FRAME_RATE_HZ;
        let delay_s = self.delay_s.get_or_insert(wanted_s);
        *delay_s += (wanted_s - *delay_s).clamp(-most, most);
        *delay_s
    }
}

pub fn nanoseconds(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}
