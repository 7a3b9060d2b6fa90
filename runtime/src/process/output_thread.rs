//! Output by a thread of its own: a terminal that takes no text (Ctrl-S, a reader that stopped
//! reading) must not hold up whoever has something to say, least of all a control loop.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

/// Events that wait at most; later ones are lost.
const WAITING: usize = 1000;
/// How long [`OutputThread::flush`] waits for a terminal.
const PATIENCE: Duration = Duration::from_secs(2);

enum Message<E> {
    Event(E),
    /// All before this has been handled.
    Mark(SyncSender<()>),
}

/// Handles events in order, on a thread that ends when this is dropped.
pub struct OutputThread<E> {
    messages: SyncSender<Message<E>>,
}

impl<E: Send + 'static> OutputThread<E> {
    /// Where no thread can be had events are lost.
    pub fn start(mut handle: impl FnMut(E) + Send + 'static) -> Self {
        let (messages, waiting) = sync_channel(WAITING);
        let thread = std::thread::Builder::new().name("output".into());
        // Without a thread the receiver is gone, and sending tells so.
        let _ = thread.spawn(move || {
            for message in waiting {
                match message {
                    Message::Event(event) => handle(event),
                    Message::Mark(reached) => drop(reached.try_send(())),
                }
            }
        });
        Self { messages }
    }

    /// Never waits: an event that finds no room is lost.
    pub fn send(&self, event: E) {
        drop(self.messages.try_send(Message::Event(event)));
    }
}

impl<E> OutputThread<E> {
    /// Waits until all that was sent is out, or the terminal has taken nothing for two seconds.
    pub fn flush(&self) {
        let (reached, reaches) = sync_channel(1);
        if self.messages.try_send(Message::Mark(reached)).is_ok() {
            let _ = reaches.recv_timeout(PATIENCE); // longer than that nobody waits
        }
    }
}

impl<E> Drop for OutputThread<E> {
    fn drop(&mut self) {
        self.flush();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn events_are_handled_in_order_and_all_are_out_after_a_flush() {
        let (sender, seen) = channel();
        let output = OutputThread::start(move |event| sender.send(event).unwrap());
        (0..500).for_each(|event| output.send(event));
        output.flush();
        assert_eq!(seen.try_iter().collect::<Vec<_>>(), (0..500).collect::<Vec<_>>());
    }

    #[test]
    fn who_speaks_to_a_terminal_that_takes_nothing_does_not_wait() {
        let (open, opened) = channel::<()>();
        let output = OutputThread::start(move |_: usize| _ = opened.recv());
        // More than ever fits: this ends although the first one is not out yet.
        (0..3 * WAITING).for_each(|event| output.send(event));
        drop(open);
    }
}
