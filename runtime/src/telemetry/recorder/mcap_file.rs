//! The MCAP file of a recording, written by one thread.

use super::topic::RecordingTopic;
use crate::telemetry::pending_file::PendingFile;
use mcap::records::{MessageHeader, Metadata};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// A recording under construction; without [`McapFile::finish`] no file appears.
pub struct McapFile {
    pending: PendingFile,
    writer: mcap::Writer<BufWriter<File>>,
    /// Identifier and newest sequence number of each topic so far.
    channels: BTreeMap<String, (u16, u32)>,
}

impl McapFile {
    pub fn create(path: &Path) -> anyhow::Result<Self> {
        let pending = PendingFile::create(path)?;
        let writer = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("servodance ", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Zstd))
            .create(pending.writer()?)?;
        Ok(Self { pending, writer, channels: BTreeMap::new() })
    }

    pub fn message(
        &mut self,
        topic: RecordingTopic,
        time_s: f64,
        data: &[u8],
    ) -> anyhow::Result<()> {
        let (channel_id, sequence) = self.channel(topic)?;
        let log_time = (time_s.max(0.0) * 1e9).round() as u64;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        self.writer.write_to_known_channel(&header, data)?;
        Ok(())
    }

    pub fn facts(&mut self, facts: BTreeMap<String, String>) -> anyhow::Result<()> {
        self.writer.write_metadata(&Metadata { name: "dance".into(), metadata: facts })?;
        Ok(())
    }

    pub fn finish(mut self) -> anyhow::Result<()> {
        self.writer.finish()?;
        self.writer.into_inner().flush()?;
        self.pending.finish()
    }

    fn channel(&mut self, topic: RecordingTopic) -> anyhow::Result<(u16, u32)> {
        let (name, message_type) = topic.describe();
        if let Some((id, sequence)) = self.channels.get_mut(&*name) {
            *sequence += 1;
            return Ok((*id, *sequence));
        }
        let definition = message_type.definition();
        let schema = self.writer.add_schema(message_type.name, "ros2msg", definition.as_bytes())?;
        let id = self.writer.add_channel(schema, &name, "cdr", &BTreeMap::new())?;
        self.channels.insert(name.into_owned(), (id, 0));
        Ok((id, 0))
    }
}
