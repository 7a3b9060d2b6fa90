//! Where the control loop gets its motion from.

use super::dance_step::{DanceChange, MusicSummary, Polled};
use super::dancer::Dancer;
use super::dancer_thread::DancerThread;
use super::stage_source::StageSource;

pub enum MotionSource {
    /// Computed when asked for: simulated time waits for it.
    Inline(Box<Dancer>),
    /// Computed ahead on another thread: the wall clock does not wait.
    Thread(DancerThread),
    /// Sent by the leader of a stage, with the time to show it.
    Stage(Box<StageSource>),
}

impl MotionSource {
    pub fn poll(&mut self) -> anyhow::Result<Polled> {
        match self {
            MotionSource::Inline(dancer) => Ok(match dancer.next_step()? {
                Some(step) => Polled::Step(Box::new(step)),
                None => Polled::Ended,
            }),
            MotionSource::Thread(thread) => thread.poll(),
            MotionSource::Stage(stage) => Ok(stage.poll()),
        }
    }

    /// Changes the steps to come; a thread is up to two seconds ahead.
    pub fn change(&mut self, change: DanceChange) -> anyhow::Result<()> {
        match self {
            MotionSource::Inline(dancer) => dancer.change(change)?,
            MotionSource::Thread(thread) => thread.change(change),
            // Only the leader can change what is led.
            MotionSource::Stage(_) => {}
        }
        Ok(())
    }

    /// Ends the source: what is known of the music by then.
    pub fn finish(self) -> anyhow::Result<MusicSummary> {
        match self {
            MotionSource::Inline(dancer) => Ok(dancer.summary()),
            MotionSource::Thread(thread) => thread.finish(),
            MotionSource::Stage(_) => Ok(MusicSummary::default()),
        }
    }
}
