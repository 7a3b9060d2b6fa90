//! Messages that come by two ways: the first copy counts, the second is let go.
//!
//! What comes a third time is a replay, and none of this module's business: it
//! is handed on, to be counted and dropped by whoever knows what it is. A copy
//! is known by a hash whose keys nobody else knows, among the last [`KEPT`].

use std::collections::hash_map::RandomState;
use std::collections::{HashMap, VecDeque};
use std::hash::BuildHasher;
use std::sync::{Mutex, PoisonError};

/// Ways from one program to another.
pub(crate) const WAYS: usize = 2;
/// Messages that are remembered: a way may stall for seconds while the other
/// brings fifty a second of each of many followers.
const KEPT: usize = 4096;

/// The messages that came of late.
#[derive(Debug, Default)]
pub(crate) struct Copies {
    keys: RandomState,
    /// How often each came.
    seen: HashMap<u64, usize>,
    order: VecDeque<u64>,
}

impl Copies {
    /// Whether a message is to be looked at: not if it came just once before.
    pub fn is_new(&mut self, bytes: &[u8]) -> bool {
        let hash = self.keys.hash_one(bytes);
        if let Some(times) = self.seen.get_mut(&hash) {
            *times = times.saturating_add(1);
            return *times > WAYS;
        }
        if self.order.len() == KEPT {
            let oldest = self.order.pop_front();
            oldest.and_then(|oldest| self.seen.remove(&oldest));
        }
        self.order.push_back(hash);
        self.seen.insert(hash, 1);
        true
    }
}

/// Hands on what comes by several ways, in order and without second copies.
pub fn once(each: impl Fn(&[u8]) + Send + Sync + 'static) -> impl Fn(&[u8]) + Send + Sync {
    let copies = Mutex::new(Copies::default());
    move |bytes| {
        // Held while it is handed on, so that nothing overtakes it.
        let mut copies = copies.lock().unwrap_or_else(PoisonError::into_inner);
        if copies.is_new(bytes) {
            each(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn the_second_copy_is_let_go_and_a_third_is_a_replay() {
        let mut copies = Copies::default();
        for bytes in [&b"one"[..], b"two"] {
            assert!(copies.is_new(bytes));
        }
        assert!(!copies.is_new(b"two") && !copies.is_new(b"one"));
        assert!(copies.is_new(b"one") && copies.is_new(b"one"));
    }

    #[test]
    fn what_was_long_ago_is_forgotten() {
        let mut copies = Copies::default();
        for number in 0..10 * KEPT {
            assert!(copies.is_new(&number.to_le_bytes()), "{number}");
        }
        assert_eq!((copies.seen.len(), copies.order.len()), (KEPT, KEPT));
        assert!(!copies.is_new(&(10 * KEPT - 1).to_le_bytes()));
        assert!(copies.is_new(&0_usize.to_le_bytes()));
    }

    #[test]
    fn each_is_handed_on_once() {
        let count = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&count);
        let hear = once(move |_| {
            counted.fetch_add(1, Ordering::Relaxed);
        });
        for bytes in [b"a", b"b", b"a", b"b"] {
            hear(bytes);
        }
        assert_eq!(count.load(Ordering::Relaxed), 2);
    }
}
