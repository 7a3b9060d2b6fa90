//! Independent pieces of work on all processors.

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Results in order of the numbers; `on_progress` receives the share that is done.
pub(super) fn in_parallel<T: Send>(
    count: usize,
    on_progress: &(impl Fn(f64) + Sync),
    work: impl Fn(usize) -> anyhow::Result<T> + Sync,
) -> anyhow::Result<Vec<T>> {
    let done = AtomicUsize::new(0);
    let one = |number| {
        let result = work(number);
        let done = 1 + done.fetch_add(1, Ordering::Relaxed);
        on_progress(done as f64 / count as f64);
        result
    };
    let results: Vec<_> = (0..count).into_par_iter().map(one).collect();
    results.into_iter().collect()
}
