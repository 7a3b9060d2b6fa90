//! Errors of song specifications.

/// Why a song cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SongError {
    /// The duration in seconds is not above 0 and at most an hour.
    #[error("a song lasts above 0 and at most 3600 seconds, not {0}")]
    Duration(f64),
    /// The sample rate in hertz cannot carry music.
    #[error("the sample rate must be 8000 to 192000 Hz, not {0}")]
    SampleRate(u32),
    /// The grid has fewer than two beats, so that there is no tempo.
    #[error("a beat grid needs at least 2 beats, not {0}")]
    TooFewBeats(usize),
    /// Two neighbouring beats are not a musical distance apart.
    #[error("beat {index} comes {interval_s:.3} s after the one before; 0.2 to 2 s are allowed")]
    Interval {
        /// Index of the later beat.
        index: usize,
        /// Interval between the two beats, seconds.
        interval_s: f64,
    },
}
