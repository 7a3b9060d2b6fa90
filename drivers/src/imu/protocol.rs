//! What a kind of board on a serial port of its own adds to [`super::SerialImu`].

use servodance_types::ImuState;

/// The bytes of one kind of board.
pub trait ImuProtocol: Send {
    /// What to send in this cycle, if anything.
    fn ask(&mut self, out: &mut Vec<u8>);

    /// Takes a byte; what the board measured, in its own axes, with the last byte of it.
    fn hear(&mut self, byte: u8) -> Option<ImuState>;

    /// The port is another one, or was away.
    fn restart(&mut self);
}
