//! The key expressions of a stage on Zenoh.
//!
//! | key | publisher | content |
//! |---|---|---|
//! | `servodance/STAGE/frames/CHANNEL` | leader | frames |
//! | `servodance/STAGE/roles` | leader | roles, stops |
//! | `servodance/STAGE/ask/FOLLOWER` | follower | time requests and reports |
//! | `servodance/STAGE/tell/FOLLOWER` | leader | time replies, resent frames; cue replies (`FOLLOWER` is the nonce) |
//! | `servodance/STAGE/robot/FOLLOWER` | follower | its robot, for the leader's page: its id, then JSON |
//! | `servodance/STAGE/cue` | anybody | cues |
//! | `servodance/STAGE/leader/INSTANCE/TERM` | leader | liveliness token |
//!
//! `STAGE` is the name of the stage, `FOLLOWER` and `INSTANCE` 16 hexadecimal
//! digits. An access control list (see docs/stage.md) can tell leaders from
//! followers by these keys.

use crate::messages::is_valid_name;

/// The key expressions of one stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageKeys {
    base: String,
}

impl StageKeys {
    /// The keys of the stage with this name; `None` for a name that cannot be one.
    pub fn new(stage: &str) -> Option<Self> {
        is_valid_name(stage).then(|| Self { base: format!("servodance/{stage}") })
    }

    /// Key of the frames of a channel; of all channels without a number.
    pub fn frames(&self, channel: Option<u8>) -> String {
        match channel {
            Some(channel) => format!("{}/frames/{channel}", self.base),
            None => format!("{}/frames/*", self.base),
        }
    }

    /// Key of what is for all followers: roles, stops.
    pub fn roles(&self) -> String {
        format!("{}/roles", self.base)
    }

    /// Key of the messages from a follower; from all followers without one.
    pub fn from_follower(&self, follower: Option<u64>) -> String {
        match follower {
            Some(id) => format!("{}/ask/{id:016x}", self.base),
            None => format!("{}/ask/*", self.base),
        }
    }

    /// Key of the messages to a follower.
    pub fn to_follower(&self, follower: u64) -> String {
        format!("{}/tell/{follower:016x}", self.base)
    }

    /// Key of what a follower tells of its robot; of all followers without one.
    pub fn robot(&self, follower: Option<u64>) -> String {
        match follower {
            Some(id) => format!("{}/robot/{id:016x}", self.base),
            None => format!("{}/robot/*", self.base),
        }
    }

    /// Key of the cues to the leader.
    pub fn cue(&self) -> String {
        format!("{}/cue", self.base)
    }

    /// Liveliness key of a leader.
    pub fn leader(&self, instance: u64, term: u32) -> String {
        format!("{}/leader/{instance:016x}/{term}", self.base)
    }

    /// Liveliness keys of all leaders.
    pub fn leaders(&self) -> String {
        format!("{}/leader/*/*", self.base)
    }

    /// Instance and term in the liveliness key of a leader.
    pub fn parse_leader(&self, key: &str) -> Option<(u64, u32)> {
        let rest = key.strip_prefix(&self.base)?.strip_prefix("/leader/")?;
        let (instance, term) = rest.split_once('/')?;
        Some((u64::from_str_radix(instance, 16).ok()?, term.parse().ok()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leader_is_found_again_in_its_key() {
        let keys = StageKeys::new("main").unwrap();
        let key = keys.leader(0xabc, 3);
        assert_eq!(key, "servodance/main/leader/0000000000000abc/3");
        assert_eq!(keys.parse_leader(&key), Some((0xabc, 3)));
        assert_eq!(keys.parse_leader("servodance/other/leader/1/3"), None);
        assert_eq!(keys.parse_leader("servodance/main/leader/x/3"), None);
    }

    #[test]
    fn names_that_would_be_patterns_are_refused() {
        for bad in ["", "a/b", "*", "$x", "a b", "#"] {
            assert_eq!(StageKeys::new(bad), None, "{bad}");
        }
        assert!(StageKeys::new("hall-2.left_ä").is_some());
    }
}
