//! How old the last reading of a motion sensor is: it counts for 100 ms.

use servodance_types::ImuState;

/// How long a reading counts, seconds.
const FRESH_S: f64 = 0.1;

/// The last reading, and for how many cycles there was none.
#[derive(Debug)]
pub(super) struct Freshness {
    hz: f64,
    state: Option<ImuState>,
    missed: u32,
}

impl Freshness {
    /// For a sensor that is looked at so many times a second.
    pub fn new(hz: f64) -> Self {
        Self { hz, state: None, missed: 0 }
    }

    /// What this cycle brought.
    pub fn cycle(&mut self, reading: Option<ImuState>) {
        match reading {
            Some(state) => (self.state, self.missed) = (Some(state), 0),
            None => {
                self.missed = self.missed.saturating_add(1);
                if self.is_lost() {
                    self.state = None;
                }
            }
        }
    }

    /// Cycles since the last reading.
    pub fn missed(&self) -> u32 {
        self.missed
    }

    pub fn is_lost(&self) -> bool {
        f64::from(self.missed) >= FRESH_S * self.hz
    }

    /// The last reading, unless it is too old.
    pub fn state(&self) -> Option<ImuState> {
        self.state
    }
}
