//! The emergency stop: pressed from anywhere, cleared only on purpose.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// An emergency stop button: clones press the same button, from any thread.
/// Only [`EStop::clear`] releases the button.
#[derive(Clone, Debug, Default)]
pub struct EStop {
    pressed: Arc<AtomicBool>,
    cause: Arc<Mutex<Option<String>>>,
    releases: Arc<AtomicU64>,
}

impl EStop {
    /// Presses the button. Torque goes off at the next tick, and the button stays down.
    pub fn press(&self, cause: &str) {
        let mut first = self.cause.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert_with(|| cause.into());
        self.pressed.store(true, Ordering::Release);
    }

    /// Whether the button is down.
    pub fn is_pressed(&self) -> bool {
        self.pressed.load(Ordering::Acquire)
    }

    /// What pressed the button first; empty while nothing has.
    pub fn cause(&self) -> String {
        let cause = self.cause.lock().unwrap_or_else(PoisonError::into_inner);
        cause.clone().unwrap_or_default()
    }

    /// Releases the button. Torque stays off until the next arming.
    pub fn clear(&self) {
        let mut cause = self.cause.lock().unwrap_or_else(PoisonError::into_inner);
        *cause = None;
        self.pressed.store(false, Ordering::Release);
        self.releases.fetch_add(1, Ordering::AcqRel);
    }

    /// How often the button was released: it was down all the time between two moments at
    /// which it is pressed and this number is the same.
    pub fn releases(&self) -> u64 {
        self.releases.load(Ordering::Acquire)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_stays_down_and_remembers_who_was_first() {
        let button = EStop::default();
        button.clone().press("the key");
        button.press("the file");
        assert!(button.is_pressed());
        assert_eq!(button.cause(), "the key");
        button.clear();
        assert!(!button.is_pressed());
        assert!(button.cause().is_empty() && button.releases() == 1);
    }
}
