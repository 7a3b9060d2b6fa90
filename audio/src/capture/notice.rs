//! What happens to live sound that a user should know.

use std::fmt;

/// Something that happened to the sound; one line of text.
#[derive(Clone, Debug, PartialEq)]
pub enum Notice {
    /// No sound for a while; silence is heard in its place.
    Stalled,
    /// The device is gone or broken; it is opened again in the background.
    Lost {
        /// What the system says.
        reason: String,
    },
    /// Sound is back.
    Back {
        /// How long it was away, seconds.
        away_s: f64,
    },
    /// Sound comes at another rate than before.
    RateChanged {
        /// Samples a second before.
        from_hz: u32,
        /// Samples a second now.
        to_hz: u32,
    },
    /// Sound was lost because nobody took it in time.
    Overrun {
        /// Seconds lost.
        lost_s: f64,
    },
    /// Sound came too late to be danced to and was left out.
    TooLate,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Notice::Stalled => f.write_str("no sound arrives; silence is heard until it is back"),
            Notice::Lost { reason } => write!(
                f,
                "sound is lost ({reason}); it is opened again in the background"
            ),
            Notice::Back { away_s } => write!(f, "sound is back after {away_s:.1} s"),
            Notice::RateChanged { from_hz, to_hz } => {
                write!(f, "sound comes at {to_hz} Hz now, not {from_hz}")
            }
            Notice::Overrun { lost_s } => write!(
                f,
                "{:.0} ms of sound were lost: the program did not keep up",
                lost_s * 1e3
            ),
            Notice::TooLate => f.write_str("sound came too late; what was too old was left out"),
        }
    }
}

/// Totals of a live source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CaptureStats {
    /// How often sound was lost because nobody took it in time.
    pub overruns: u64,
    /// Sound lost that way, seconds.
    pub lost_s: f64,
    /// How often sound stayed away.
    pub stalls: u64,
    /// Silence heard in its place, seconds.
    pub silence_s: f64,
    /// Sound left out because it came too late, seconds.
    pub dropped_s: f64,
    /// How often the device was opened, the first time included.
    pub opened: u64,
}
