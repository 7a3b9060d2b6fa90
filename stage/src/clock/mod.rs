//! Time on a stage: the leader's clock as a follower estimates it, and the pace of
//! the motion that is shown.

mod estimator;
mod playback;
mod rolling_max;

pub use estimator::{ClockEstimate, LeaderClock};
pub use playback::PlaybackClock;

pub(crate) use rolling_max::RollingMax;

pub(crate) fn seconds(nanoseconds: i64) -> f64 {
    nanoseconds as f64 * 1e-9
}

pub(crate) fn nanoseconds(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}
