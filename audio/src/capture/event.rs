//! Events of live sound that the user is told, and their totals.

use std::fmt;

/// An event of a live source; its text is one line for the user.
#[derive(Clone, Debug, PartialEq)]
pub enum CaptureEvent {
    /// No sound arrives; silence takes its place.
    Stalled,
    /// The device is gone or broken; the supervisor tries to open it again.
    Lost {
        /// The error of the sound interface.
        reason: String,
    },
    /// Sound arrives again after a stall.
    Back {
        /// Duration of the gap, seconds.
        away_s: f64,
    },
    /// The device delivers another sample rate than before.
    RateChanged {
        /// Sample rate before the change, hertz.
        from_hz: u32,
        /// Sample rate from now on, hertz.
        to_hz: u32,
    },
    /// Sound was lost because the program did not read it in time.
    Overrun {
        /// Duration of the lost sound, seconds.
        lost_s: f64,
    },
    /// Sound came too late to be danced to and was dropped.
    TooLate,
}

impl fmt::Display for CaptureEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CaptureEvent::Stalled => {
                f.write_str("no sound arrives; silence is heard until it is back")
            }
            CaptureEvent::Lost { reason } => {
                write!(f, "sound is lost ({reason}); it is opened again in the background")
            }
            CaptureEvent::Back { away_s } => write!(f, "sound is back after {away_s:.1} s"),
            CaptureEvent::RateChanged { from_hz, to_hz } => {
                write!(f, "sound comes at {to_hz} Hz now, not {from_hz}")
            }
            CaptureEvent::Overrun { lost_s } => {
                write!(f, "{:.0} ms of sound were lost: the program did not keep up", lost_s * 1e3)
            }
            CaptureEvent::TooLate => {
                f.write_str("sound came too late; what was too old was left out")
            }
        }
    }
}

/// Totals of a live source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CaptureStats {
    /// Number of times that sound was lost because it was not read in time.
    pub overruns: u64,
    /// Duration of the sound lost that way, seconds.
    pub lost_s: f64,
    /// Number of stalls: sound stayed away.
    pub stalls: u64,
    /// Duration of the silence in place of sound, seconds.
    pub silence_s: f64,
    /// Duration of the sound dropped because it came too late, seconds.
    pub dropped_s: f64,
    /// Number of times that the device was opened, the first time included.
    pub opened: u64,
}
