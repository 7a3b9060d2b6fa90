//! The thread that writes a recording. A disk that is slow, or full, must not
//! hold up whoever moves motors: messages wait in a queue, are left out and
//! counted where it is full, and an error ends the recording alone.

use super::Topic;
use super::book::Book;
use crate::drill;
use crate::realtime::OrdinaryAfterwards;
use anyhow::Context;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

/// Messages that may wait: about six seconds of a 20-joint robot at 100 Hz,
/// less than 8 MB.
const QUEUE: usize = 8192;

/// Is told, once, that the recording has failed.
pub type OnTrouble = Box<dyn Fn(&str) + Send>;

/// What to do when messages come faster than the disk takes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenBehind {
    /// Wait: time is simulated.
    Wait,
    /// Leave messages out and count them: motors do not wait.
    LeaveOut,
}

enum Entry {
    Message(Topic, f64, Vec<u8>),
    Facts(BTreeMap<String, String>),
    /// The last one: without it no file appears.
    End,
}

/// The near end of the queue. Dropped without [`Clerk::finish`], no file appears.
pub struct Clerk {
    queue: Option<SyncSender<Entry>>,
    thread: Option<JoinHandle<anyhow::Result<()>>>,
    when_behind: WhenBehind,
    left_out: u64,
}

impl Clerk {
    /// Starts to write `path`; refuses what cannot be written.
    pub fn start(
        path: &Path,
        when_behind: WhenBehind,
        on_trouble: OnTrouble,
    ) -> anyhow::Result<Self> {
        let book = Book::create(path)?;
        let (queue, entries) = sync_channel(QUEUE);
        let what = format!("cannot record to {}", path.display());
        let thread = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || {
                drop(OrdinaryAfterwards); // whoever started it may be urgent
                let written = write(book, &entries).context(what);
                if let Err(error) = &written {
                    on_trouble(&format!("{error:#}; all else goes on"));
                    while entries.recv().is_ok() {} // nobody waits for a place
                }
                written
            })
            .context("cannot start the thread that records")?;
        Ok(Self {
            queue: Some(queue),
            thread: Some(thread),
            when_behind,
            left_out: 0,
        })
    }

    /// Has one message written.
    pub fn message(&mut self, topic: Topic, time_s: f64, data: Vec<u8>) {
        let Some(queue) = &self.queue else { return };
        let entry = Entry::Message(topic, time_s, data);
        match self.when_behind {
            WhenBehind::Wait => {
                let _ = queue.send(entry); // `finish` tells why the thread ended
            }
            WhenBehind::LeaveOut => {
                let full = matches!(queue.try_send(entry), Err(TrySendError::Full(_)));
                self.left_out += u64::from(full);
            }
        }
    }

    /// Has facts about the run written, and how many messages were left out.
    pub fn facts(&mut self, mut facts: BTreeMap<String, String>) {
        facts.insert("messages_left_out".into(), self.left_out.to_string());
        if let Some(queue) = &self.queue {
            let _ = queue.send(Entry::Facts(facts));
        }
    }

    /// Waits until all is written and the file has its name.
    pub fn finish(mut self) -> anyhow::Result<()> {
        if let Some(queue) = &self.queue {
            let _ = queue.send(Entry::End);
        }
        self.hang_up()
    }

    fn hang_up(&mut self) -> anyhow::Result<()> {
        self.queue = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            Some(Err(_)) => anyhow::bail!("the thread that records broke down"),
            None => Ok(()),
        }
    }
}

impl Drop for Clerk {
    /// An abandoned recording leaves nothing behind, which takes the thread a
    /// moment.
    fn drop(&mut self) {
        let _ = self.hang_up();
    }
}

fn write(mut book: Book, entries: &Receiver<Entry>) -> anyhow::Result<()> {
    for entry in entries {
        drill::pass("recorder");
        match entry {
            Entry::Message(topic, time_s, data) => book.message(topic, time_s, &data)?,
            Entry::Facts(facts) => book.facts(facts)?,
            Entry::End => return book.finish(),
        }
    }
    Ok(())
}
