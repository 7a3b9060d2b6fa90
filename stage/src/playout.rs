//! Frames wait here for their turn: put in order, each once, those of a hole
//! waited for as long as there is time.

use crate::wire::StageFrame;
use std::collections::BTreeMap;

/// Frames that may wait: more than the longest canon of a slow song.
const MOST: usize = 2048;

/// The frames of one voice.
#[derive(Clone, Debug, Default)]
pub(crate) struct Playout {
    waiting: BTreeMap<u64, StageFrame>,
    /// Number of the frame whose turn is next; `None` before the first.
    next: Option<u64>,
    /// Frames that were not there when it was their turn.
    pub lost: u64,
}

impl Playout {
    /// Takes in a frame and says whether it is new; one whose turn is over is
    /// left out.
    pub fn push(&mut self, number: u64, frame: &StageFrame) -> bool {
        let over = self.next.is_some_and(|next| number < next);
        if over || self.waiting.contains_key(&number) {
            return false;
        }
        self.waiting.insert(number, *frame);
        if self.waiting.len() > MOST {
            self.waiting.pop_first();
        }
        true
    }

    /// What comes next begins anew, with what waits already.
    pub fn begin(&mut self) {
        self.next = None;
    }

    /// Forgets what waits, too.
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.begin();
    }

    /// Whether it has not begun and lacks frames from `from_ns` of music on.
    pub fn lacks(&self, from_ns: i64) -> bool {
        let waits = |frame: &StageFrame| frame.music_ns <= from_ns;
        self.next.is_none() && !self.waiting.values().any(waits)
    }

    /// The next frame if it is its turn. Music time: before `from_ns` the first
    /// frame is too late to begin with; up to `soon_ns` a frame may go that
    /// follows the last; up to `now_ns` one may go before which others are missing.
    pub fn pop(&mut self, from_ns: i64, now_ns: i64, soon_ns: i64) -> Option<StageFrame> {
        if self.next.is_none() {
            self.waiting.retain(|_, frame| frame.music_ns >= from_ns);
        }
        let entry = self.waiting.first_entry()?;
        let (number, frame) = (*entry.key(), *entry.get());
        let missing = self.next.map_or(0, |next| number - next);
        let until_ns = if missing > 0 { now_ns } else { soon_ns };
        if frame.music_ns > until_ns {
            return None;
        }
        entry.remove();
        self.lost += missing;
        self.next = Some(number + 1);
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::{Beat, Contacts};

    fn frame(number: u64) -> StageFrame {
        StageFrame {
            present_ns: 0,
            music_ns: number as i64 * 50,
            beat: Beat::default(),
            presence: 1.0,
            level: 0.0,
            contacts: Contacts::default(),
            positions: Default::default(),
            posture: Default::default(),
        }
    }

    #[test]
    fn frames_come_out_in_order_each_once_and_a_hole_is_waited_for() {
        let mut playout = Playout::default();
        for number in [4, 3, 5, 3, 8] {
            playout.push(number, &frame(number));
        }
        assert!(!playout.push(8, &frame(8)), "it waits already");
        let mut out = Vec::new();
        let mut pop = |playout: &mut Playout, now, soon| {
            let popped = playout.pop(0, now, soon);
            out.extend(popped.map(|f| f.music_ns / 50));
        };
        for _ in 0..5 {
            pop(&mut playout, 300, 10_000);
        }
        playout.push(6, &frame(6));
        assert!(!playout.push(4, &frame(4)), "its turn is over");
        for now in [300, 350, 400, 450] {
            pop(&mut playout, now, 10_000);
        }
        assert_eq!(out, [3, 4, 5, 6, 8]);
        assert_eq!(playout.lost, 1);
    }

    #[test]
    fn one_begins_with_what_is_not_yet_over() {
        let mut playout = Playout::default();
        assert!((5..20).all(|n| playout.push(n, &frame(n))));
        assert!(playout.lacks(240) && !playout.lacks(250));
        let first = playout.pop(480, 500, 1000).unwrap();
        assert_eq!(first.music_ns, 500);
    }

    #[test]
    fn a_flood_takes_no_memory() {
        let mut playout = Playout::default();
        assert!((0..100_000).all(|n| playout.push(n * 7, &frame(n))));
        assert_eq!(playout.waiting.len(), MOST);
    }
}
