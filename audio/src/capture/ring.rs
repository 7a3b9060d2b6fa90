//! The lock-free ring between the capture callback and the
//! [`LiveStream`](super::LiveStream).
//!
//! [`RingWriter::write`] copies samples and one time stamp, and returns: no
//! lock, no allocation, no system call. When the ring is full the newest sound
//! is lost and counted.

use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// Sound that the ring holds, seconds.
const RING_S: usize = 2;
/// Blocks that may wait unread: two seconds of half-millisecond blocks.
const STAMPS: usize = 4096;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RingFormat {
    pub sample_rate_hz: u32,
    pub channels: u16,
}

/// The number of frames captured up to a moment.
#[derive(Clone, Copy, Debug)]
struct BlockStamp {
    frames: u64,
    captured: Instant,
}

#[derive(Debug, Default)]
struct RingState {
    lost_frames: AtomicU64,
    ended: AtomicBool,
}

pub(crate) struct RingWriter {
    samples: Producer<f32>,
    stamps: Producer<BlockStamp>,
    shared: Arc<RingState>,
    channels: usize,
    frames: u64,
}

pub(crate) struct RingReader {
    format: RingFormat,
    samples: Consumer<f32>,
    stamps: Consumer<BlockStamp>,
    shared: Arc<RingState>,
    frames: u64,
}

pub(crate) fn ring(format: RingFormat) -> (RingWriter, RingReader) {
    let channels = usize::from(format.channels.max(1));
    let capacity = RING_S * format.sample_rate_hz as usize * channels;
    let (sample_in, sample_out) = RingBuffer::new(capacity);
    let (stamp_in, stamp_out) = RingBuffer::new(STAMPS);
    let shared = Arc::new(RingState::default());
    let writer = RingWriter {
        samples: sample_in,
        stamps: stamp_in,
        shared: Arc::clone(&shared),
        channels,
        frames: 0,
    };
    let reader = RingReader { format, samples: sample_out, stamps: stamp_out, shared, frames: 0 };
    (writer, reader)
}

impl RingWriter {
    /// Copies a block of whole frames whose newest was captured at `captured`.
    pub(crate) fn write(&mut self, samples: impl ExactSizeIterator<Item = f32>, captured: Instant) {
        let frames = samples.len() / self.channels;
        let room = self.samples.slots() / self.channels;
        let fits = if self.stamps.slots() > 0 { frames.min(room) } else { 0 };
        if fits < frames {
            let lost = (frames - fits) as u64;
            self.shared.lost_frames.fetch_add(lost, Ordering::Relaxed);
        }
        let Ok(chunk) = self.samples.write_chunk_uninit(fits * self.channels) else {
            return;
        };
        chunk.fill_from_iter(samples);
        if fits > 0 {
            self.frames += fits as u64;
            let frames = self.frames;
            // There is room: only this end adds stamps.
            let _ = self.stamps.push(BlockStamp { frames, captured });
        }
    }

    /// Frames that fit now; for a writer that can wait.
    pub(crate) fn room(&self) -> usize {
        match self.stamps.slots() {
            0 => 0,
            _ => self.samples.slots() / self.channels,
        }
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.samples.is_abandoned()
    }
}

impl Drop for RingWriter {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Release);
    }
}

impl RingReader {
    pub(crate) fn format(&self) -> RingFormat {
        self.format
    }

    /// Frames lost because the ring was full.
    pub(crate) fn lost_frames(&self) -> u64 {
        self.shared.lost_frames.load(Ordering::Relaxed)
    }

    /// Whether all is read and the writer is gone.
    pub(crate) fn is_over(&self) -> bool {
        self.shared.ended.load(Ordering::Acquire) && self.samples.is_empty()
    }

    /// Appends one captured block, channels averaged, to `mono`. Returns when
    /// its newest sample was captured, or `None` if there is no block.
    pub(crate) fn read(&mut self, mono: &mut Vec<f32>) -> Option<Instant> {
        let stamp = self.stamps.pop().ok()?;
        let frames = stamp.frames.saturating_sub(self.frames) as usize;
        let channels = usize::from(self.format.channels.max(1));
        let chunk = self.samples.read_chunk(frames * channels).ok()?;
        let share = 1.0 / channels as f32;
        let mut sum = 0.0;
        for (i, sample) in chunk.into_iter().enumerate() {
            sum += sample;
            if (i + 1).is_multiple_of(channels) {
                mono.push(sum * share);
                sum = 0.0;
            }
        }
        self.frames = stamp.frames;
        Some(stamp.captured)
    }
}
