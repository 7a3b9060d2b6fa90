//! A cue at a moment of the music.

use serde::{Serialize, Serializer};
use servodance_stage::messages::{Role, is_valid_name};

/// Moments are within a day, seconds.
const LATEST_S: f64 = 86_400.0;

/// Who shall dance otherwise, how, and from when on.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedCue {
    /// Seconds of the music; none: now.
    pub at_s: Option<f64>,
    /// Name of the follower; `all` is everybody.
    pub follower: String,
    /// The change.
    pub role: Role,
}

impl TimedCue {
    /// A cue if it can be given. The error is one line: what is wrong with it.
    pub fn checked(at_s: Option<f64>, follower: String, role: Role) -> Result<Self, String> {
        if let Some(at_s) = at_s.filter(|at_s| !(0.0..=LATEST_S).contains(at_s)) {
            return Err(format!("at_s is {at_s}, expected 0 to {LATEST_S} seconds"));
        }
        if !is_valid_name(&follower) {
            return Err(format!("\"{follower}\" cannot be the name of a follower"));
        }
        let role = role.checked().map_err(|error| error.to_string())?;
        match role == Role::default() {
            true => Err("nothing to change: mirror, amplitude, canon or style".into()),
            false => Ok(Self { at_s, follower, role }),
        }
    }

    /// When; the beginning if it does not say.
    pub fn time_s(&self) -> f64 {
        self.at_s.unwrap_or(0.0)
    }

    /// What it changes, in words.
    pub fn words(&self) -> String {
        let role = &self.role;
        let words = [
            role.mirror.map(|on| if on { "mirror" } else { "no mirror" }.to_owned()),
            role.amplitude.map(|share| format!("amplitude {:.0} %", share * 100.0)),
            role.canon_beats.map(|beats| format!("{beats} beats later")),
            role.style.as_ref().map(|style| format!("style {style}")),
        ];
        format!("{}: {}", self.follower, words.into_iter().flatten().collect::<Vec<_>>().join(", "))
    }
}

impl Serialize for TimedCue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.time_s(), self.words()).serialize(serializer)
    }
}
