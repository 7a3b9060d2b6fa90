//! How a follower fares.

use crate::clock::Estimate;
use serde::{Deserialize, Serialize};

/// What was dropped, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// No message of a stage, or one that is damaged.
    pub malformed: u64,
    /// Longer than any message is.
    pub huge: u64,
    /// Of another version of the format.
    pub other_version: u64,
    /// Seen before, or of a leader that was left.
    pub replayed: u64,
    /// Of a leader that is not followed while another is.
    pub rivals: u64,
    /// Answers to nothing that was asked.
    pub unasked: u64,
    /// Good, but not for a follower, or not believable.
    pub misplaced: u64,
}

impl Counters {
    /// All of them.
    pub fn total(&self) -> u64 {
        let Self {
            malformed,
            huge,
            other_version,
            replayed,
            rivals,
            unasked,
            misplaced,
        } = self;
        malformed + huge + other_version + replayed + rivals + unasked + misplaced
    }
}

/// How it goes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// The leader's clock; `None` while it is not known.
    pub clock: Option<Estimate>,
    /// How long before its time a frame must be sent, seconds.
    pub needed_s: f64,
    /// How long before its time the leader sends, seconds.
    pub lead_s: f64,
    /// Longest way of a frame of late, seconds.
    pub way_s: f64,
    /// Frames that never came.
    pub lost: u64,
    /// How often a leader was followed.
    pub joined: u64,
    /// How often one was lost or left.
    pub left: u64,
    /// What was dropped.
    pub dropped: Counters,
}
