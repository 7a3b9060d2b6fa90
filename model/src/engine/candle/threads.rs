//! The threads of the candle engine, which divides work by itself.

/// A pool of its own, so that its size is the one that was asked for.
#[derive(Debug)]
pub(crate) struct TensorThreads(rayon::ThreadPool);

impl TensorThreads {
    /// None where the system gives no threads: candle then uses those of the process.
    pub fn new(threads: usize) -> Option<Self> {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok().map(Self)
    }

    pub fn count(&self) -> usize {
        self.0.current_num_threads()
    }

    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.0.install(work)
    }
}
