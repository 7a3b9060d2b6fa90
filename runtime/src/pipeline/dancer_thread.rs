//! A [`Dancer`] on a thread of its own. Steps are handed over in a queue: motion
//! ahead of time is kept, never skipped, because a dance is only smooth if whole.

use super::dance_step::{DanceChange, DanceStep, MusicSummary, Polled};
use super::dancer::Dancer;
use anyhow::anyhow;
use std::sync::mpsc::{Receiver, Sender, SyncSender, TryRecvError, channel, sync_channel};
use std::thread::JoinHandle;

/// Steps that the thread may be ahead of the robot: two seconds.
const QUEUE_STEPS: usize = 40;

/// The receiving end; the thread ends when it is dropped.
pub struct DancerThread {
    steps: Receiver<anyhow::Result<DanceStep>>,
    changes: Sender<DanceChange>,
    thread: JoinHandle<MusicSummary>,
}

impl DancerThread {
    pub fn start(mut dancer: Dancer) -> anyhow::Result<Self> {
        let (sender, steps) = sync_channel(QUEUE_STEPS);
        let (changes, wanted) = channel();
        let thread = std::thread::Builder::new().name("dancer".into()).spawn(move || {
            send_steps(&mut dancer, &sender, &wanted);
            dancer.summary()
        })?;
        Ok(Self { steps, changes, thread })
    }

    /// The next step, if it is there; an error is that of the thread.
    pub fn poll(&mut self) -> anyhow::Result<Polled> {
        match self.steps.try_recv() {
            Ok(step) => Ok(Polled::Step(Box::new(step?))),
            Err(TryRecvError::Empty) => Ok(Polled::Late),
            Err(TryRecvError::Disconnected) => Ok(Polled::Ended),
        }
    }

    pub fn change(&self, change: DanceChange) {
        // A thread that has ended has nothing to change.
        let _ = self.changes.send(change);
    }

    pub fn finish(self) -> anyhow::Result<MusicSummary> {
        // With no receiver the thread ends at its next step.
        drop(self.steps);
        self.thread.join().map_err(|_| {
            anyhow!("the thread that hears and invents broke down; the robot went to rest, torque is off")
        })
    }
}

fn send_steps(
    dancer: &mut Dancer,
    sender: &SyncSender<anyhow::Result<DanceStep>>,
    wanted: &Receiver<DanceChange>,
) {
    let mut next = || {
        for change in wanted.try_iter() {
            dancer.change(change)?;
        }
        dancer.next_step()
    };
    while let Some(step) = next().transpose() {
        let failed = step.is_err();
        if sender.send(step).is_err() || failed {
            return;
        }
    }
}
