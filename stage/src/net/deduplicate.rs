//! Removes duplicates of messages that arrive by two paths: the first copy counts,
//! the second is dropped.
//!
//! A third copy is a replay: it is passed on, and its receiver counts and drops it.
//! A copy is recognized by a hash with secret keys among the last [`KEPT`].

use std::collections::hash_map::RandomState;
use std::collections::{HashMap, VecDeque};
use std::hash::BuildHasher;
use std::sync::{Mutex, PoisonError};

/// Paths from one program to another.
pub(crate) const PATHS: usize = 2;
/// Messages that are remembered: one path may stall for seconds while the other
/// delivers fifty messages a second of each of many followers.
const KEPT: usize = 4096;

#[derive(Debug, Default)]
pub(crate) struct Deduplicator {
    keys: RandomState,
    /// Number of copies of each message.
    seen: HashMap<u64, usize>,
    order: VecDeque<u64>,
}

impl Deduplicator {
    /// Whether a message is passed on: not if exactly one copy came before.
    pub fn is_new(&mut self, bytes: &[u8]) -> bool {
        let hash = self.keys.hash_one(bytes);
        if let Some(times) = self.seen.get_mut(&hash) {
            *times = times.saturating_add(1);
            return *times > PATHS;
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

/// A callback that passes messages of two paths on, in order and without second copies.
pub fn deduplicated(each: impl Fn(&[u8]) + Send + Sync + 'static) -> impl Fn(&[u8]) + Send + Sync {
    let seen = Mutex::new(Deduplicator::default());
    move |bytes| {
        // Locked during the call, so that no message overtakes another.
        let mut seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
        if seen.is_new(bytes) {
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
        let mut seen = Deduplicator::default();
        for bytes in [&b"one"[..], b"two"] {
            assert!(seen.is_new(bytes));
        }
        assert!(!seen.is_new(b"two") && !seen.is_new(b"one"));
        assert!(seen.is_new(b"one") && seen.is_new(b"one"));
    }

    #[test]
    fn what_was_long_ago_is_forgotten() {
        let mut seen = Deduplicator::default();
        for number in 0..10 * KEPT {
            assert!(seen.is_new(&number.to_le_bytes()), "{number}");
        }
        assert_eq!((seen.seen.len(), seen.order.len()), (KEPT, KEPT));
        assert!(!seen.is_new(&(10 * KEPT - 1).to_le_bytes()));
        assert!(seen.is_new(&0_usize.to_le_bytes()));
    }

    #[test]
    fn each_is_handed_on_once() {
        let count = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&count);
        let hear = deduplicated(move |_| {
            counted.fetch_add(1, Ordering::Relaxed);
        });
        for bytes in [b"a", b"b", b"a", b"b"] {
            hear(bytes);
        }
        assert_eq!(count.load(Ordering::Relaxed), 2);
    }
}
