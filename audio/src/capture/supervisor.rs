//! Supervises a device on a thread of its own: opens the device, waits until it
//! fails or is reported stalled, closes it and opens it again.
//!
//! Opening and closing a device may hang in its driver. No other thread waits
//! for this one for that reason, and the old ring stays usable meanwhile.

use super::ring::RingReader;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

/// Between two attempts to open a device.
const RETRY: Duration = Duration::from_secs(1);

pub(crate) trait DeviceOpener: Send + 'static {
    /// The open device; captures until it is dropped.
    type Open;

    /// Opens the device. A stream that breaks later is reported to `failure`.
    /// Errors: one line: why it cannot be opened now.
    fn open(&mut self, failure: FailureReporter) -> Result<(RingReader, Self::Open), String>;
}

pub(crate) enum SupervisorEvent {
    /// The device is open; its sound comes through this ring from now on.
    Opened(RingReader),
    Failed(String),
}

enum SupervisorCommand {
    Quit,
    Reopen,
    Failed { stream: u64, reason: String },
}

#[derive(Clone)]
pub(crate) struct FailureReporter {
    stream: u64,
    commands: Sender<SupervisorCommand>,
}

impl FailureReporter {
    pub(crate) fn report(&self, reason: String) {
        let stream = self.stream;
        // Without a receiver the program ends.
        let _ = self.commands.send(SupervisorCommand::Failed { stream, reason });
    }
}

/// The handle of the thread, which ends when the handle is dropped.
pub(crate) struct DeviceSupervisor {
    commands: Option<Sender<SupervisorCommand>>,
    events: Receiver<SupervisorEvent>,
}

impl DeviceSupervisor {
    /// Starts the thread, which opens the device at once.
    pub(crate) fn start(opener: impl DeviceOpener) -> std::io::Result<Self> {
        let (commands, inbox) = channel();
        let (outbox, events) = channel();
        let sender = commands.clone();
        std::thread::Builder::new()
            .name("capture keeper".into())
            .spawn(move || supervise(opener, &sender, &inbox, &outbox))?;
        Ok(Self { commands: Some(commands), events })
    }

    /// An input that comes through one ring and is never opened again.
    pub(crate) fn of_one_ring(ring: RingReader) -> Self {
        let (outbox, events) = channel();
        let _ = outbox.send(SupervisorEvent::Opened(ring));
        Self { commands: None, events }
    }

    /// The next event that has not been read yet.
    pub(crate) fn next_event(&self) -> Option<SupervisorEvent> {
        self.events.try_recv().ok()
    }

    #[cfg(feature = "mic")]
    pub(crate) fn first_event(&self, patience: Duration) -> Option<SupervisorEvent> {
        self.events.recv_timeout(patience).ok()
    }

    pub(crate) fn reopen(&self) {
        if let Some(commands) = &self.commands {
            let _ = commands.send(SupervisorCommand::Reopen);
        }
    }
}

impl Drop for DeviceSupervisor {
    fn drop(&mut self) {
        if let Some(commands) = &self.commands {
            let _ = commands.send(SupervisorCommand::Quit);
        }
    }
}

fn supervise(
    mut opener: impl DeviceOpener,
    commands: &Sender<SupervisorCommand>,
    inbox: &Receiver<SupervisorCommand>,
    outbox: &Sender<SupervisorEvent>,
) {
    for stream in 0.. {
        let commands = commands.clone();
        match opener.open(FailureReporter { stream, commands }) {
            Ok((reader, open)) => {
                let _ = outbox.send(SupervisorEvent::Opened(reader));
                let command = next_command(stream, inbox, None);
                drop(open); // may hang in the driver
                match command {
                    Some(SupervisorCommand::Quit) => return,
                    Some(SupervisorCommand::Failed { reason, .. }) => {
                        let _ = outbox.send(SupervisorEvent::Failed(reason));
                    }
                    // Stalled: by now it may be well again.
                    Some(SupervisorCommand::Reopen) | None => continue,
                }
            }
            Err(reason) => {
                let _ = outbox.send(SupervisorEvent::Failed(reason));
            }
        }
        // Commands for the stream that is closed are ignored.
        while let Some(command) = next_command(stream + 1, inbox, Some(RETRY)) {
            if matches!(command, SupervisorCommand::Quit) {
                return;
            }
        }
    }
}

/// The next command that concerns this stream, within `patience` if given.
fn next_command(
    stream: u64,
    inbox: &Receiver<SupervisorCommand>,
    patience: Option<Duration>,
) -> Option<SupervisorCommand> {
    loop {
        let command = match patience {
            Some(patience) => inbox.recv_timeout(patience).ok()?,
            None => inbox.recv().unwrap_or(SupervisorCommand::Quit),
        };
        match &command {
            SupervisorCommand::Failed { stream: failed, .. } if *failed != stream => {}
            _ => return Some(command),
        }
    }
}
