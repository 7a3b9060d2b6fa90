//! A WebSocket to rosbridge that never blocks once it is open.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket};

use super::address::Ros2Address;
use crate::error::{BusError, BusResult};

const OPENING: Duration = Duration::from_secs(3);
/// The longest message that is taken, and the most that may wait to be sent: a second of
/// commands.
const LONGEST: usize = 1 << 20;
const MOST_WAITING: usize = 1 << 20;

pub(super) struct Socket {
    socket: WebSocket<TcpStream>,
    port: String,
}

impl Socket {
    pub fn open(address: &Ros2Address) -> BusResult<Self> {
        let port = format!("ros2:{address}");
        let refused = |reason: &dyn std::fmt::Display| {
            BusError::not_opened(&port, format!("{reason} (is rosbridge_server running there?)"))
        };
        let mut places = address.server.to_socket_addrs().map_err(|error| refused(&error))?;
        let place = places.next().ok_or_else(|| refused(&"the host has no address"))?;
        let stream =
            TcpStream::connect_timeout(&place, OPENING).map_err(|error| refused(&error))?;
        let set_up = |stream: &TcpStream| {
            stream.set_nodelay(true)?;
            stream.set_read_timeout(Some(OPENING))?;
            stream.set_write_timeout(Some(OPENING))
        };
        set_up(&stream).map_err(|error| refused(&error))?;
        let config = WebSocketConfig::default()
            .max_message_size(Some(LONGEST))
            .max_frame_size(Some(LONGEST))
            .write_buffer_size(0)
            .max_write_buffer_size(MOST_WAITING);
        let url = format!("ws://{}/", address.server);
        let (socket, _) = tungstenite::client::client_with_config(url, stream, Some(config))
            .map_err(|error| refused(&error))?;
        socket.get_ref().set_nonblocking(true).map_err(|error| refused(&error))?;
        Ok(Self { socket, port })
    }

    /// Sends a message, or keeps it until the socket takes more.
    pub fn send(&mut self, text: String) -> BusResult<()> {
        match self.socket.send(Message::text(text)) {
            Err(error) if !would_block(&error) => Err(self.failed("sending", error)),
            _ => Ok(()),
        }
    }

    /// The next text that has come; `None` where there is none now.
    pub fn receive(&mut self) -> BusResult<Option<String>> {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => return Ok(Some(text.as_str().to_owned())),
                Ok(_) => {}
                Err(error) if would_block(&error) => return Ok(None),
                Err(error) => return Err(self.failed("receiving", error)),
            }
        }
    }

    fn failed(&self, doing: &'static str, error: Error) -> BusError {
        let reason = match error {
            Error::Io(error) => error,
            other => io::Error::other(other.to_string()),
        };
        BusError::Bridge { port: self.port.clone(), doing, reason }
    }
}

fn would_block(error: &Error) -> bool {
    matches!(error, Error::Io(error) if error.kind() == io::ErrorKind::WouldBlock)
}
