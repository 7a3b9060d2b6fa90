//! When an operator was heard last: the page of an operator's link says four times a second
//! that it is open in front of somebody.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Shared by the page's server, which hears operators, and the control loop, which asks.
#[derive(Clone, Debug)]
pub struct OperatorWatch {
    began: Instant,
    heard_ms: Arc<AtomicU64>,
}

impl Default for OperatorWatch {
    fn default() -> Self {
        Self { began: Instant::now(), heard_ms: Arc::default() }
    }
}

impl OperatorWatch {
    /// An operator is there now.
    pub fn hear(&self) {
        let now_ms = self.began.elapsed().as_millis() as u64;
        self.heard_ms.store(now_ms, Ordering::Release);
    }

    /// Whether one was ever heard.
    pub fn was_heard(&self) -> bool {
        self.heard_ms.load(Ordering::Acquire) > 0
    }

    /// Seconds since then.
    pub fn silent_s(&self) -> f64 {
        let heard_s = self.heard_ms.load(Ordering::Acquire) as f64 * 1e-3;
        (self.began.elapsed().as_secs_f64() - heard_s).max(0.0)
    }
}
