//! The tempi that may be followed, as a person gives them: `LO-HI` beats a minute.

use std::fmt;
use std::str::FromStr;

/// Slowest and fastest tempo that the tracker knows, beats a minute.
const SLOWEST_BPM: f64 = 50.0;
const FASTEST_BPM: f64 = 218.0;

/// A slowest and a fastest tempo, beats a minute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TempoRange {
    low_bpm: f64,
    high_bpm: f64,
}

/// Why a text is no [`TempoRange`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected two tempi from {SLOWEST_BPM} to {FASTEST_BPM} beats a minute, slow then fast, like 80-140"
)]
pub struct TempoRangeError;

impl TempoRange {
    /// Errors: tempi beyond those the tracker knows, or the faster one first.
    pub fn new(low_bpm: f64, high_bpm: f64) -> Result<Self, TempoRangeError> {
        match SLOWEST_BPM <= low_bpm && low_bpm <= high_bpm && high_bpm <= FASTEST_BPM {
            true => Ok(Self { low_bpm, high_bpm }),
            false => Err(TempoRangeError),
        }
    }

    /// Beats a minute.
    pub fn low_bpm(self) -> f64 {
        self.low_bpm
    }

    /// Beats a minute.
    pub fn high_bpm(self) -> f64 {
        self.high_bpm
    }
}

impl FromStr for TempoRange {
    type Err = TempoRangeError;

    fn from_str(text: &str) -> Result<Self, TempoRangeError> {
        let (low, high) = text.split_once('-').ok_or(TempoRangeError)?;
        let number = |text: &str| text.trim().parse().map_err(|_| TempoRangeError);
        Self::new(number(low)?, number(high)?)
    }
}

impl fmt::Display for TempoRange {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}-{}", self.low_bpm, self.high_bpm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_tempi_are_a_range_and_anything_else_is_refused() {
        let range: TempoRange = "80-140.5".parse().unwrap();
        assert_eq!((range.low_bpm(), range.high_bpm()), (80.0, 140.5));
        assert_eq!(range.to_string(), "80-140.5");
        for text in ["", "80", "140-80", "20-90", "90-400", "NaN-100", "80-NaN", "a-b", "80-90-100"]
        {
            assert_eq!(text.parse::<TempoRange>(), Err(TempoRangeError), "{text}");
        }
    }
}
