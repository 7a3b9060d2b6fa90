//! Errors of decoding, and the limits that they name.

/// The version of the format that is written, and the only one understood.
pub(crate) const VERSION: u8 = 2;
/// Longer messages are refused unread.
pub(crate) const MAX_BYTES: usize = 16 * 1024;

/// Why a message was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MessageError {
    /// Longer than any message is; its length in bytes.
    #[error("{0} bytes are more than the {MAX_BYTES} that a message may have")]
    Huge(usize),
    /// The first bytes are not those of a message.
    #[error("no message of a stage")]
    Foreign,
    /// The sender has another version of the format.
    #[error(
        "message format {0} is not known here, only {VERSION}: leader and followers need the same version of servodance"
    )]
    Version(u8),
    /// A kind that this version does not have.
    #[error("no message has kind {0}")]
    Kind(u8),
    /// Cut off, or with bytes behind its end.
    #[error("message of a wrong length")]
    Length,
    /// The named value is out of its range.
    #[error("{0} is out of its range")]
    Value(&'static str),
}
