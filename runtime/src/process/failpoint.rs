//! Drills: a thread that breaks down, or work that is slow, when the hidden
//! variable `SERVODANCE_DRILL` says so. They are how tests see what follows
//! (docs/crash-safety.md); without the variable each call is one comparison.
//!
//! - `panic:PLACE@N`: the thread that passes PLACE for the Nth time panics.
//! - `slow:PLACE@MS`: whoever passes PLACE takes so many milliseconds more.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// The variable.
pub const VARIABLE: &str = "SERVODANCE_DRILL";

#[derive(Clone, Debug, PartialEq, Eq)]
struct Drill {
    panics: bool,
    place: String,
    number: u64,
}

impl Drill {
    fn parse(text: &str) -> Option<Self> {
        let (what, rest) = text.split_once(':')?;
        let (place, number) = rest.split_once('@')?;
        Some(Self {
            panics: match what {
                "panic" => true,
                "slow" => false,
                _ => return None,
            },
            place: place.to_owned(),
            number: number.parse().ok()?,
        })
    }
}

/// A place in the program where a drill may strike.
///
/// # Panics
/// If the drill says so.
pub fn pass(place: &str) {
    static DRILL: OnceLock<Option<Drill>> = OnceLock::new();
    static PASSES: AtomicU64 = AtomicU64::new(0);
    let told = || Drill::parse(&std::env::var(VARIABLE).ok()?);
    let Some(drill) = DRILL.get_or_init(told) else {
        return;
    };
    if drill.place != place {
        return;
    }
    if !drill.panics {
        std::thread::sleep(Duration::from_millis(drill.number));
    } else if PASSES.fetch_add(1, Ordering::Relaxed) + 1 == drill.number {
        panic!("this is a drill");
    }
}

/// A reader that passes a place at each read.
pub struct FailpointReader<R> {
    /// What is read.
    pub reader: R,
    /// The place.
    pub place: &'static str,
}

impl<R: std::io::Read> std::io::Read for FailpointReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        pass(self.place);
        self.reader.read(buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_drill_does_nothing() {
        assert_eq!(Drill::parse("panic:model"), None);
        assert_eq!(Drill::parse("smile:model@3"), None);
        let drill = Drill::parse("panic:model@3").unwrap();
        assert!(drill.panics && drill.place == "model" && drill.number == 3);
    }
}
