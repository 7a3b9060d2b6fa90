//! Keeps a device open: opens it, waits until it fails or is found stalled,
//! closes it and opens it again, on a thread of its own.
//!
//! Opening and closing a device may hang in its driver. Nobody waits for this
//! thread for that reason, and the old link stays usable meanwhile.

use super::link::LinkReader;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

/// Between two attempts to open a device.
const RETRY: Duration = Duration::from_secs(1);

/// Opens a device, any number of times.
pub(crate) trait Opener: Send + 'static {
    /// Captures until it is dropped.
    type Stream;

    /// Opens the device. `failure` is told when the stream breaks later.
    ///
    /// # Errors
    /// One line: why it cannot be opened now.
    fn open(&mut self, failure: Failure) -> Result<(LinkReader, Self::Stream), String>;
}

/// What the listener is told.
pub(crate) enum LinkEvent {
    /// The device is open; its sound comes through this link from now on.
    Opened(LinkReader),
    /// The device cannot be opened, or broke.
    Failed(String),
}

/// What the keeper is told.
enum Order {
    Quit,
    Reopen,
    Failed { stream: u64, reason: String },
}

/// Tells the keeper that a stream broke.
#[derive(Clone)]
pub(crate) struct Failure {
    stream: u64,
    orders: Sender<Order>,
}

impl Failure {
    /// The stream broke.
    pub(crate) fn tell(&self, reason: String) {
        let stream = self.stream;
        // Nobody left to tell: the program ends.
        let _ = self.orders.send(Order::Failed { stream, reason });
    }
}

/// The listener's end. Dropped, it lets the keeper go.
pub(crate) struct Keeper {
    orders: Option<Sender<Order>>,
    events: Receiver<LinkEvent>,
}

impl Keeper {
    /// Starts to keep a device open.
    pub(crate) fn start(opener: impl Opener) -> std::io::Result<Self> {
        let (orders, inbox) = channel();
        let (outbox, events) = channel();
        let sender = orders.clone();
        std::thread::Builder::new()
            .name("capture keeper".into())
            .spawn(move || keep(opener, &sender, &inbox, &outbox))?;
        Ok(Self {
            orders: Some(orders),
            events,
        })
    }

    /// A source that comes through one link and is never opened again.
    pub(crate) fn of_one_link(link: LinkReader) -> Self {
        let (outbox, events) = channel();
        let _ = outbox.send(LinkEvent::Opened(link));
        Self {
            orders: None,
            events,
        }
    }

    /// What happened since it was asked last.
    pub(crate) fn next_event(&self) -> Option<LinkEvent> {
        self.events.try_recv().ok()
    }

    #[cfg(feature = "mic")]
    /// Waits for the first event.
    pub(crate) fn first_event(&self, patience: Duration) -> Option<LinkEvent> {
        self.events.recv_timeout(patience).ok()
    }

    /// Closes the device and opens it again.
    pub(crate) fn reopen(&self) {
        if let Some(orders) = &self.orders {
            let _ = orders.send(Order::Reopen);
        }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        if let Some(orders) = &self.orders {
            let _ = orders.send(Order::Quit);
        }
    }
}

fn keep(
    mut opener: impl Opener,
    orders: &Sender<Order>,
    inbox: &Receiver<Order>,
    outbox: &Sender<LinkEvent>,
) {
    for stream in 0.. {
        let orders = orders.clone();
        match opener.open(Failure { stream, orders }) {
            Ok((reader, open)) => {
                let _ = outbox.send(LinkEvent::Opened(reader));
                let order = next_order(stream, inbox, None);
                drop(open); // may hang in the driver
                match order {
                    Some(Order::Quit) => return,
                    Some(Order::Failed { reason, .. }) => {
                        let _ = outbox.send(LinkEvent::Failed(reason));
                    }
                    // Stalled: by now it may be well again.
                    Some(Order::Reopen) | None => continue,
                }
            }
            Err(reason) => {
                let _ = outbox.send(LinkEvent::Failed(reason));
            }
        }
        // Orders meant for the stream that is closed are over.
        while let Some(order) = next_order(stream + 1, inbox, Some(RETRY)) {
            if matches!(order, Order::Quit) {
                return;
            }
        }
    }
}

/// The next order that concerns this stream, within `patience` if there is any.
fn next_order(stream: u64, inbox: &Receiver<Order>, patience: Option<Duration>) -> Option<Order> {
    loop {
        let order = match patience {
            Some(patience) => inbox.recv_timeout(patience).ok()?,
            None => inbox.recv().unwrap_or(Order::Quit),
        };
        match &order {
            Order::Failed { stream: failed, .. } if *failed != stream => {}
            _ => return Some(order),
        }
    }
}
