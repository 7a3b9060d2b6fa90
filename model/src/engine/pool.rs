//! Threads that help with a step, and sleep between steps.
//!
//! Work is taken in pieces by whoever is free, the caller first of all: a
//! helper that the system has not let run yet costs nothing, and one that is
//! interrupted holds up the caller by one piece. Results do not depend on who
//! took what. Not for long work: helpers spin while a [`Team`] is held.
#![allow(unsafe_code)]

use std::cell::UnsafeCell;
use std::hint;
use std::mem;
use std::num::NonZero;
use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::{self, JoinHandle};

use super::candle::TensorThreads;
use super::kernels::Cpu;

/// Turns of a spinning thread before it lets others run.
const SPINS: u32 = 4_000;
/// A thread takes this part of its share of what is left.
const SHARES: usize = 2;
/// `state`: one more helper is at work.
const HELPER: u64 = 1;
/// `state`: work may be joined.
const OPEN: u64 = 1 << 16;
/// `state`: the next work.
const TURN: u64 = 1 << 17;

/// Threads that a step uses if nobody says: two, or what there is. More wait
/// for the same memory.
pub fn default_threads() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get).min(2)
}

/// The helpers; ends them when dropped.
#[derive(Debug)]
pub struct Pool {
    cpu: Cpu,
    shared: Arc<Shared>,
    helpers: Vec<JoinHandle<()>>,
    busy: Mutex<()>,
    tensors: Option<TensorThreads>,
}

/// Work of the moment, as the helpers see it.
type Work = *const (dyn Fn() + Sync);

#[derive(Debug)]
struct Shared {
    /// Turn, whether it is open, and how many helpers are at it.
    state: AtomicU64,
    work: UnsafeCell<Option<Work>>,
    /// A team is held: spin, do not sleep.
    awake: AtomicBool,
    quit: AtomicBool,
    panicked: AtomicBool,
}

// SAFETY: `work` is written only by the one who holds the team, while no helper
// is at work and none can join; helpers read it only after they have joined.
unsafe impl Sync for Shared {}
// SAFETY: the pointer in `work` is followed only while its owner waits.
unsafe impl Send for Shared {}

impl Pool {
    /// A pool for `threads` threads, the caller's among them.
    pub fn new(threads: usize) -> Self {
        Self::with(Cpu::detect(), threads)
    }

    /// The same with other kernels than this processor's best.
    pub fn with(cpu: Cpu, threads: usize) -> Self {
        let shared = Arc::new(Shared {
            state: AtomicU64::new(0),
            work: UnsafeCell::new(None),
            awake: AtomicBool::new(false),
            quit: AtomicBool::new(false),
            panicked: AtomicBool::new(false),
        });
        let helper = |_| {
            let shared = Arc::clone(&shared);
            let name = "model-helper".to_owned();
            thread::Builder::new().name(name).spawn(move || shared.help())
        };
        Self {
            cpu,
            // Where no more threads are to be had, the caller works alone.
            helpers: (1..threads).map_while(|i| helper(i).ok()).collect(),
            shared,
            busy: Mutex::new(()),
            tensors: None,
        }
    }

    /// A pool of so many threads for the candle engine.
    pub(super) fn for_tensors(threads: usize) -> Self {
        let mut pool = Self::new(1);
        pool.tensors = TensorThreads::new(threads);
        pool
    }

    /// Threads that work, the caller's among them.
    pub fn threads(&self) -> usize {
        let tensors = self.tensors.as_ref();
        tensors.map_or(1 + self.helpers.len(), TensorThreads::count)
    }

    /// Borrows the helpers for a while; alone if somebody else has them.
    pub fn team(&self) -> Team<'_> {
        let held = match self.busy.try_lock() {
            _ if self.helpers.is_empty() => None,
            Ok(held) => Some(held),
            Err(TryLockError::Poisoned(held)) => Some(held.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        };
        if held.is_some() {
            self.shared.awake.store(true, Ordering::Release);
            self.helpers.iter().for_each(|helper| helper.thread().unpark());
        }
        Team { pool: self, held }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.quit.store(true, Ordering::Release);
        for helper in self.helpers.drain(..) {
            helper.thread().unpark();
            let _ = helper.join();
        }
    }
}

/// The right to share work; the helpers sleep again when it is dropped.
#[derive(Debug)]
pub struct Team<'a> {
    pool: &'a Pool,
    held: Option<MutexGuard<'a, ()>>,
}

impl Team<'_> {
    pub(crate) fn cpu(&self) -> Cpu {
        self.pool.cpu
    }

    /// Runs work of the candle engine on the threads meant for it.
    pub(crate) fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool.tensors {
            Some(threads) => threads.install(work),
            None => work(),
        }
    }

    /// Threads that may share work, the caller's among them.
    pub(crate) fn threads(&self) -> usize {
        match self.held {
            Some(_) => self.pool.threads(),
            None => 1,
        }
    }

    /// Calls `work` with every piece of `out` of `size` numbers and its index.
    pub(crate) fn share<T: Send>(
        &self,
        out: &mut [T],
        size: usize,
        work: impl Fn(usize, &mut [T]) + Sync,
    ) {
        self.share_rows(out, size, 1..=1, work);
    }

    /// Calls `work` with pieces of so many rows of `width` numbers, and the first
    /// of them: the fewer the less is left, so that all are done together.
    pub(crate) fn share_rows<T: Send>(
        &self,
        out: &mut [T],
        width: usize,
        rows: RangeInclusive<usize>,
        work: impl Fn(usize, &mut [T]) + Sync,
    ) {
        let alone = self.held.is_none() || out.len() <= width * rows.start();
        let left = Mutex::new(Left {
            first: 0,
            out,
            width: width.max(1),
            rows,
            shares: SHARES * self.threads(),
        });
        let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
        let everything = || {
            while let Some((first, piece)) = next() {
                work(first, piece);
            }
        };
        match alone {
            true => everything(),
            false => self.everybody(&everything),
        }
    }

    /// Runs `work` here and in every helper that comes in time.
    fn everybody(&self, work: &(dyn Fn() + Sync)) {
        let shared = &*self.pool.shared;
        // SAFETY: only the lifetime changes. `closing` below does not go before
        // all helpers that took the pointer are done, not even in a panic.
        let pointer: Work = unsafe { mem::transmute::<&(dyn Fn() + Sync), Work>(work) };
        // SAFETY: this thread holds the team, no helper is at work, and the last
        // turn is closed, so nobody else looks at it.
        unsafe { *shared.work.get() = Some(pointer) };
        let turn = (shared.state.load(Ordering::Relaxed) & !(TURN - 1)) + TURN;
        shared.state.store(turn | OPEN, Ordering::Release);
        let closing = Closing(shared);
        work();
        drop(closing);
        assert!(!shared.panicked.load(Ordering::Acquire), "a helper thread of the model panicked");
    }
}

impl Drop for Team<'_> {
    fn drop(&mut self) {
        if self.held.is_some() {
            self.pool.shared.awake.store(false, Ordering::Release);
        }
    }
}

struct Left<'a, T> {
    first: usize,
    out: &'a mut [T],
    width: usize,
    rows: RangeInclusive<usize>,
    shares: usize,
}

impl<'a, T> Iterator for Left<'a, T> {
    type Item = (usize, &'a mut [T]);

    fn next(&mut self) -> Option<Self::Item> {
        if self.out.is_empty() {
            return None;
        }
        let left = self.out.len().div_ceil(self.width);
        let rows = (left / self.shares).clamp(*self.rows.start(), *self.rows.end());
        let numbers = (rows * self.width).min(self.out.len());
        let (piece, out) = mem::take(&mut self.out).split_at_mut(numbers);
        self.out = out;
        let first = self.first;
        self.first += rows;
        Some((first, piece))
    }
}

/// Closes the turn and waits for those who are at it.
struct Closing<'a>(&'a Shared);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        let state = &self.0.state;
        state.fetch_and(!OPEN, Ordering::AcqRel);
        let mut spins = 0;
        while state.load(Ordering::Acquire) & (OPEN - 1) != 0 {
            pause(&mut spins);
        }
    }
}

impl Shared {
    fn help(&self) {
        let mut last_turn = 0;
        while !self.quit.load(Ordering::Acquire) {
            if !self.awake.load(Ordering::Acquire) {
                thread::park();
                continue;
            }
            let mut spins = 0;
            while self.awake.load(Ordering::Acquire) {
                if self.join(&mut last_turn) {
                    spins = 0;
                } else {
                    pause(&mut spins);
                }
            }
        }
    }

    /// Takes part in the open turn, once; whether there was one.
    fn join(&self, last_turn: &mut u64) -> bool {
        let state = self.state.load(Ordering::Acquire);
        let turn = state & !(TURN - 1);
        if state & OPEN == 0 || turn == *last_turn {
            return false;
        }
        let joined =
            self.state.compare_exchange(state, state + HELPER, Ordering::AcqRel, Ordering::Relaxed);
        if joined.is_err() {
            return true;
        }
        *last_turn = turn;
        let leaving = Leaving(self);
        // SAFETY: joined while the turn was open: its owner does not leave, nor
        // write another, before this one is counted out again.
        if let Some(work) = unsafe { *self.work.get() } {
            // SAFETY: the same.
            unsafe { (*work)() };
        }
        drop(leaving);
        true
    }
}

/// Counts a helper out again, and tells of its panic.
struct Leaving<'a>(&'a Shared);

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.panicked.store(true, Ordering::Release);
        }
        self.0.state.fetch_sub(HELPER, Ordering::AcqRel);
    }
}

/// Spins for a moment, then lets other threads run at every turn.
fn pause(spins: &mut u32) {
    *spins += 1;
    if *spins < SPINS {
        hint::spin_loop();
    } else {
        thread::yield_now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_is_done_once_whoever_is_there() {
        for threads in [1, 2, 5] {
            let pool = Pool::new(threads);
            for round in 0..2000 {
                let team = pool.team();
                let mut counts = vec![0u32; 100 + round % 7];
                team.share(&mut counts, 3, |i, piece| {
                    piece.iter_mut().for_each(|n| *n += 1 + i as u32);
                });
                let expected = (0..counts.len()).map(|n| 1 + n as u32 / 3);
                assert!(counts.iter().copied().eq(expected), "{counts:?}");
            }
        }
    }

    #[test]
    fn pieces_shrink_and_cover_every_row_once() {
        for threads in [1, 2, 5] {
            let pool = Pool::new(threads);
            for rows in [1, 2, 9, 1000] {
                let mut out = vec![usize::MAX; 3 * rows];
                let sizes = Mutex::new(Vec::new());
                pool.team().share_rows(&mut out, 3, 2..=100, |first, piece| {
                    sizes.lock().unwrap().push((first, piece.len() / 3));
                    for (i, number) in piece.iter_mut().enumerate() {
                        assert_eq!(*number, usize::MAX);
                        *number = 3 * first + i;
                    }
                });
                assert!(out.iter().copied().eq(0..3 * rows), "{out:?}");
                let mut sizes = sizes.into_inner().unwrap();
                sizes.sort_unstable();
                assert!(sizes.is_sorted_by(|one, next| one.1 >= next.1), "{sizes:?}");
                assert!(sizes.iter().all(|(_, rows)| *rows <= 100), "{sizes:?}");
            }
        }
    }

    #[test]
    fn who_comes_second_works_alone() {
        let pool = Pool::new(2);
        let (first, second) = (pool.team(), pool.team());
        assert!(first.held.is_some() && second.held.is_none());
        let mut out = [0; 9];
        second.share(&mut out, 1, |i, piece| piece[0] = i);
        first.share(&mut out, 1, |i, piece| assert_eq!(piece[0], i));
        drop(first);
        assert!(pool.team().held.is_some());
    }

    #[test]
    fn a_panic_in_a_piece_reaches_the_caller() {
        let pool = Pool::new(2);
        let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let mut out = [0; 64];
            pool.team().share(&mut out, 1, |i, _| assert!(i < 40));
        }));
        assert!(caught.is_err());
    }
}
