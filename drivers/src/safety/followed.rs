//! Whether the servos follow: the share of cycles in which each joint was where its
//! command had been a moment ago.
//!
//! A servo lags by some 50 ms and cuts the corners of a quick motion, so that its error
//! against the last command says little. It has followed if it is within
//! [`EXPECTED_RAD`] of the range that its command crossed in the last quarter of a second.
//! A joint that is frozen, limp or blocked is outside that as soon as its command moves.

/// What backlash, sag under a load and a soft gain may add, radians.
const EXPECTED_RAD: f64 = 0.07;
/// The range of the last commands, in parts: the newest and so many before it.
const PARTS: usize = 9;
const PART_S: f64 = 0.03;

/// How one joint followed.
#[derive(Clone, Copy, Debug)]
struct Track {
    /// Lowest and highest command of each part, radians.
    parts: [(f64, f64); PARTS],
    last_rad: f64,
    cycles: u64,
    followed: u64,
}

/// How every joint followed so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Followed {
    tracks: Vec<Track>,
    newest: usize,
    /// When the newest part began, seconds.
    began_s: f64,
}

impl Followed {
    /// Begins with joints that were told to be at `sent_rad`; what was counted stays.
    pub fn begin(&mut self, now_s: f64, sent_rad: &[f64]) {
        self.began_s = now_s;
        let new = Track { parts: [(0.0, 0.0); PARTS], last_rad: 0.0, cycles: 0, followed: 0 };
        self.tracks.resize(sent_rad.len(), new);
        for (track, &sent) in self.tracks.iter_mut().zip(sent_rad) {
            track.parts = [(sent, sent); PARTS];
            track.last_rad = sent;
        }
    }

    /// The next part begins when the newest is old enough.
    pub fn begin_cycle(&mut self, now_s: f64) {
        if now_s - self.began_s < PART_S {
            return;
        }
        self.began_s = now_s;
        self.newest = (self.newest + 1) % PARTS;
        for track in &mut self.tracks {
            track.parts[self.newest] = (track.last_rad, track.last_rad);
        }
    }

    /// One joint in this cycle: its command and where it is.
    pub fn push(&mut self, index: usize, sent_rad: f64, position_rad: f64) {
        let Some(track) = self.tracks.get_mut(index) else { return };
        let (low, high) = &mut track.parts[self.newest];
        (*low, *high) = (low.min(sent_rad), high.max(sent_rad));
        track.last_rad = sent_rad;
        let low = track.parts.iter().fold(f64::INFINITY, |low, part| low.min(part.0));
        let high = track.parts.iter().fold(f64::NEG_INFINITY, |high, part| high.max(part.1));
        let expected = low - EXPECTED_RAD..=high + EXPECTED_RAD;
        track.cycles += 1;
        track.followed += u64::from(expected.contains(&position_rad));
    }

    /// The share of its cycles in which each joint followed, 1 before the first.
    pub fn shares(&self) -> impl Iterator<Item = f64> + '_ {
        self.tracks.iter().map(|track| match track.cycles {
            0 => 1.0,
            cycles => track.followed as f64 / cycles as f64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share in which a joint followed that was where `position` says.
    fn share(position: impl Fn(f64) -> f64) -> f64 {
        let mut followed = Followed::default();
        followed.begin(0.0, &[0.0]);
        for k in 0..1000 {
            let now_s = f64::from(k) * 0.01;
            followed.begin_cycle(now_s);
            followed.push(0, 0.5 * (6.0 * now_s).sin(), position(now_s));
        }
        followed.shares().next().unwrap_or(0.0)
    }

    #[test]
    fn a_lag_is_expected_and_standing_still_is_not() {
        assert_eq!(share(|now_s| 0.48 * (6.0 * (now_s - 0.05).max(0.0)).sin()), 1.0);
        assert!(share(|_| 0.0) < 0.7, "{}", share(|_| 0.0));
        assert!(share(|_| 0.5) < 0.7);
        assert!(share(|_| f64::NAN) < 0.01);
    }
}
