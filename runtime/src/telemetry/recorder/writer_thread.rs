//! The thread that writes a recording. A slow or full disk never delays the
//! control loop: messages wait in a queue, are dropped and counted when the queue
//! is full, and a write error ends the recording alone.

use super::mcap_file::McapFile;
use super::topic::RecordingTopic;
use crate::process::failpoint;
use crate::process::realtime::OrdinaryAfterwards;
use anyhow::Context;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

/// Messages that may wait: about six seconds of a 20-joint robot at 100 Hz,
/// less than 8 MB.
const QUEUE: usize = 8192;

/// Called once if the recording fails, with the reason.
pub type OnRecordingError = Box<dyn Fn(&str) + Send>;

/// What to do when messages come faster than the disk takes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenBehind {
    /// Wait: time is simulated.
    Wait,
    /// Leave messages out and count them: motors do not wait.
    LeaveOut,
}

enum WriterMessage {
    Message(RecordingTopic, f64, Vec<u8>),
    Facts(BTreeMap<String, String>),
    /// The last one: without it no file appears.
    End,
}

/// The near end of the queue. Dropped without [`WriterThread::finish`], no file appears.
pub struct WriterThread {
    queue: Option<SyncSender<WriterMessage>>,
    thread: Option<JoinHandle<anyhow::Result<()>>>,
    when_behind: WhenBehind,
    left_out: u64,
}

impl WriterThread {
    /// Starts to write `path`; refuses what cannot be written.
    pub fn start(
        path: &Path,
        when_behind: WhenBehind,
        on_error: OnRecordingError,
    ) -> anyhow::Result<Self> {
        let file = McapFile::create(path)?;
        let (queue, messages) = sync_channel(QUEUE);
        let what = format!("cannot record to {}", path.display());
        let thread = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || {
                drop(OrdinaryAfterwards); // whoever started it may be urgent
                let written = write(file, &messages).context(what);
                if let Err(error) = &written {
                    on_error(&format!("{error:#}; all else goes on"));
                    while messages.recv().is_ok() {} // nobody waits for a place
                }
                written
            })
            .context("cannot start the thread that records")?;
        Ok(Self { queue: Some(queue), thread: Some(thread), when_behind, left_out: 0 })
    }

    pub fn message(&mut self, topic: RecordingTopic, time_s: f64, data: Vec<u8>) {
        let Some(queue) = &self.queue else { return };
        let message = WriterMessage::Message(topic, time_s, data);
        match self.when_behind {
            WhenBehind::Wait => {
                let _ = queue.send(message); // `finish` tells why the thread ended
            }
            WhenBehind::LeaveOut => {
                let full = matches!(queue.try_send(message), Err(TrySendError::Full(_)));
                self.left_out += u64::from(full);
            }
        }
    }

    /// Has facts about the run written, and how many messages were left out.
    pub fn facts(&mut self, mut facts: BTreeMap<String, String>) {
        facts.insert("messages_left_out".into(), self.left_out.to_string());
        if let Some(queue) = &self.queue {
            let _ = queue.send(WriterMessage::Facts(facts));
        }
    }

    /// Waits until all is written and the file has its name.
    pub fn finish(mut self) -> anyhow::Result<()> {
        if let Some(queue) = &self.queue {
            let _ = queue.send(WriterMessage::End);
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

impl Drop for WriterThread {
    /// Waits for the thread, so that an abandoned recording leaves no file behind.
    fn drop(&mut self) {
        let _ = self.hang_up();
    }
}

fn write(mut file: McapFile, messages: &Receiver<WriterMessage>) -> anyhow::Result<()> {
    for message in messages {
        failpoint::pass("recorder");
        match message {
            WriterMessage::Message(topic, time_s, data) => file.message(topic, time_s, &data)?,
            WriterMessage::Facts(facts) => file.facts(facts)?,
            WriterMessage::End => return file.finish(),
        }
    }
    Ok(())
}
