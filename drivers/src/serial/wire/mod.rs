//! Bytes on a serial bus: framing, decoding, the port and its deadlines.

pub(crate) mod decoder;
pub(crate) mod framing;
pub(crate) mod open_error;
pub(crate) mod port;
pub(crate) mod protocol1;
pub(crate) mod protocol2;
pub(crate) mod stale_replies;
pub(crate) mod stream;
pub(crate) mod system_ports;
