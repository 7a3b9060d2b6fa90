//! The key expressions of a stage on Zenoh.
//!
//! | key | who writes | what |
//! |---|---|---|
//! | `servodance/STAGE/frames/VOICE` | leader | frames |
//! | `servodance/STAGE/roles` | leader | roles |
//! | `servodance/STAGE/ask/FOLLOWER` | follower | questions and reports |
//! | `servodance/STAGE/tell/FOLLOWER` | leader | answers |
//! | `servodance/STAGE/cue` | anybody | cues |
//! | `servodance/STAGE/leader/INSTANCE/TERM` | leader | liveliness token |
//!
//! `STAGE` is the name of the stage, `FOLLOWER` and `INSTANCE` 16 hexadecimal
//! digits. An access control list (see docs/stage.md) can tell leaders from
//! followers by these keys.

/// The stage that is meant when none is named.
pub const DEFAULT_STAGE: &str = "main";

/// Whether a word may stand in a key, and as a name.
pub fn is_plain(word: &str) -> bool {
    let plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.');
    !word.is_empty() && word.chars().all(plain)
}

/// The keys of one stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Keys {
    base: String,
}

impl Keys {
    /// Of the stage with this name; `None` if it cannot be a name.
    pub fn new(stage: &str) -> Option<Self> {
        is_plain(stage).then(|| Self {
            base: format!("servodance/{stage}"),
        })
    }

    /// Where a voice is heard; all of them without a number.
    pub fn frames(&self, voice: Option<u8>) -> String {
        match voice {
            Some(voice) => format!("{}/frames/{voice}", self.base),
            None => format!("{}/frames/*", self.base),
        }
    }

    /// Where roles are told.
    pub fn roles(&self) -> String {
        format!("{}/roles", self.base)
    }

    /// Where a follower asks; all of them without one.
    pub fn ask(&self, follower: Option<u64>) -> String {
        match follower {
            Some(id) => format!("{}/ask/{id:016x}", self.base),
            None => format!("{}/ask/*", self.base),
        }
    }

    /// Where a follower is answered.
    pub fn tell(&self, follower: u64) -> String {
        format!("{}/tell/{follower:016x}", self.base)
    }

    /// Where cues are given.
    pub fn cue(&self) -> String {
        format!("{}/cue", self.base)
    }

    /// The sign of life of a leader.
    pub fn leader(&self, instance: u64, term: u32) -> String {
        format!("{}/leader/{instance:016x}/{term}", self.base)
    }

    /// The signs of life of all leaders.
    pub fn leaders(&self) -> String {
        format!("{}/leader/*/*", self.base)
    }

    /// Instance and term of the leader that has this sign of life.
    pub fn read_leader(&self, key: &str) -> Option<(u64, u32)> {
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
        let keys = Keys::new("main").unwrap();
        let key = keys.leader(0xabc, 3);
        assert_eq!(key, "servodance/main/leader/0000000000000abc/3");
        assert_eq!(keys.read_leader(&key), Some((0xabc, 3)));
        assert_eq!(keys.read_leader("servodance/other/leader/1/3"), None);
        assert_eq!(keys.read_leader("servodance/main/leader/x/3"), None);
    }

    #[test]
    fn names_that_would_be_patterns_are_refused() {
        for bad in ["", "a/b", "*", "$x", "a b", "#"] {
            assert_eq!(Keys::new(bad), None, "{bad}");
        }
        assert!(Keys::new("hall-2.left_ä").is_some());
    }
}
