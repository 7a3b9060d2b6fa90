//! The jitter buffer: hands out frames in order, each once, and waits for missing
//! frames as long as there is time.

use crate::messages::StageFrame;
use std::collections::BTreeMap;

/// Capacity: more than the longest canon of a slow song.
const MOST: usize = 2048;

#[derive(Clone, Debug, Default)]
pub(crate) struct JitterBuffer {
    waiting: BTreeMap<u64, StageFrame>,
    /// Number of the next frame; `None` before the first.
    next: Option<u64>,
    /// Number of frames that were missing at their time.
    pub lost: u64,
}

impl JitterBuffer {
    /// Takes a frame, unless its turn is over; returns whether it is new.
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

    /// Restarts the order with the frames that wait already.
    pub fn restart(&mut self) {
        self.next = None;
    }

    /// Restarts without the frames that wait.
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.restart();
    }

    /// Whether the order has not begun and frames from `from_ns` of music on are missing.
    pub fn lacks(&self, from_ns: i64) -> bool {
        let waits = |frame: &StageFrame| frame.music_ns <= from_ns;
        self.next.is_none() && !self.waiting.values().any(waits)
    }

    /// The next frame if it is its turn. Times are music time: a first frame before
    /// `from_ns` is too late; a frame that follows the last is handed out up to
    /// `soon_ns`, one before which others are missing up to `now_ns`.
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
        let mut buffer = JitterBuffer::default();
        for number in [4, 3, 5, 3, 8] {
            buffer.push(number, &frame(number));
        }
        assert!(!buffer.push(8, &frame(8)), "it waits already");
        let mut out = Vec::new();
        let mut pop = |buffer: &mut JitterBuffer, now, soon| {
            let popped = buffer.pop(0, now, soon);
            out.extend(popped.map(|f| f.music_ns / 50));
        };
        for _ in 0..5 {
            pop(&mut buffer, 300, 10_000);
        }
        buffer.push(6, &frame(6));
        assert!(!buffer.push(4, &frame(4)), "its turn is over");
        for now in [300, 350, 400, 450] {
            pop(&mut buffer, now, 10_000);
        }
        assert_eq!(out, [3, 4, 5, 6, 8]);
        assert_eq!(buffer.lost, 1);
    }

    #[test]
    fn one_begins_with_what_is_not_yet_over() {
        let mut buffer = JitterBuffer::default();
        assert!((5..20).all(|n| buffer.push(n, &frame(n))));
        assert!(buffer.lacks(240) && !buffer.lacks(250));
        let first = buffer.pop(480, 500, 1000).unwrap();
        assert_eq!(first.music_ns, 500);
    }

    #[test]
    fn a_flood_takes_no_memory() {
        let mut buffer = JitterBuffer::default();
        assert!((0..100_000).all(|n| buffer.push(n * 7, &frame(n))));
        assert_eq!(buffer.waiting.len(), MOST);
    }
}
