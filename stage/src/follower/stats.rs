//! Statistics of a follower.

use crate::clock::ClockEstimate;
use serde::{Deserialize, Serialize};

/// Number of dropped messages, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DropCounters {
    /// Messages of other programs, or damaged ones.
    pub malformed: u64,
    /// Messages longer than 16 KiB.
    pub huge: u64,
    /// Messages of another version of the format.
    pub other_version: u64,
    /// Messages seen before, or of a leader that was left.
    pub replayed: u64,
    /// Messages of a leader that is not followed while another is.
    pub rivals: u64,
    /// Replies to no request of this follower.
    pub unasked: u64,
    /// Well-formed messages that are not for a follower, or not plausible.
    pub misplaced: u64,
}

impl DropCounters {
    /// The sum over all causes.
    pub fn total(&self) -> u64 {
        self.malformed
            + self.huge
            + self.other_version
            + self.replayed
            + self.rivals
            + self.unasked
            + self.misplaced
    }
}

/// State and totals of a follower.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FollowerStats {
    /// Estimate of the leader's clock; `None` while unknown.
    pub clock: Option<ClockEstimate>,
    /// How long before its time a frame must be sent, seconds.
    pub needed_s: f64,
    /// How long before its time the leader sends, seconds.
    pub lead_s: f64,
    /// Longest recent transit of a frame, seconds.
    pub transit_s: f64,
    /// Number of frames that never arrived.
    pub lost: u64,
    /// Number of times that a leader was followed.
    pub joined: u64,
    /// Number of times that a leader was lost or left.
    pub left: u64,
    /// Number of dropped messages.
    pub dropped: DropCounters,
}
