//! What went wrong with each servo of a bus: counted where it happens, read from any thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// How often something went wrong with one servo since the bus was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServoErrors {
    /// Answers that did not come.
    pub timeouts: u64,
    /// Answers, or its own words about instructions, that were damaged.
    pub crc_errors: u64,
    /// Questions that it was asked again.
    pub retries: u64,
    /// Cycles for which its state was reckoned, because no answer came.
    pub reckoned: u64,
}

impl ServoErrors {
    /// Answers that did not come, or came damaged.
    pub fn lost(&self) -> u64 {
        self.timeouts + self.crc_errors
    }
}

#[derive(Debug, Default)]
struct Counters {
    timeouts: AtomicU64,
    crc_errors: AtomicU64,
    retries: AtomicU64,
    reckoned: AtomicU64,
}

/// Counters of every servo of a bus; clones count together.
#[derive(Clone, Debug, Default)]
pub struct ErrorCounters(Vec<Arc<Counters>>);

impl ErrorCounters {
    pub(crate) fn new(servos: usize) -> Self {
        Self((0..servos).map(|_| Arc::default()).collect())
    }

    /// Takes over the counters of the servos at `places` from those of their bus.
    pub(crate) fn adopt(&mut self, places: &[usize], of_bus: &Self) {
        for (&place, counters) in places.iter().zip(&of_bus.0) {
            if let Some(own) = self.0.get_mut(place) {
                own.clone_from(counters);
            }
        }
    }

    fn add(&self, index: usize, counter: impl Fn(&Counters) -> &AtomicU64) {
        if let Some(counters) = self.0.get(index) {
            counter(counters).fetch_add(1, Ordering::Relaxed);
        }
    }

    pub(crate) fn timed_out(&self, index: usize) {
        self.add(index, |counters| &counters.timeouts);
    }

    pub(crate) fn damaged(&self, index: usize) {
        self.add(index, |counters| &counters.crc_errors);
    }

    pub(crate) fn asked_again(&self, index: usize) {
        self.add(index, |counters| &counters.retries);
    }

    pub(crate) fn reckoned(&self, index: usize) {
        self.add(index, |counters| &counters.reckoned);
    }

    /// The counts of each servo, in the order of the servos.
    pub fn each(&self) -> impl Iterator<Item = ServoErrors> {
        let counted = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        self.0.iter().map(move |counters| ServoErrors {
            timeouts: counted(&counters.timeouts),
            crc_errors: counted(&counters.crc_errors),
            retries: counted(&counters.retries),
            reckoned: counted(&counters.reckoned),
        })
    }

    /// The same as a list.
    pub fn read(&self) -> Vec<ServoErrors> {
        self.each().collect()
    }
}
