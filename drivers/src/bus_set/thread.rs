//! The thread of one bus: it carries out one task at a time and never blocks the set.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use servodance_types::{ImuState, JointState};

use crate::bus::layout::BusLayout;
use crate::bus::{Bus, BusStats};
use crate::error::{BusError, BusResult, ServoId};
use crate::servo::Servo;

/// How often a thread keeps its bus alive while the others are getting ready, ...
const KEEP_ALIVE: Duration = Duration::from_millis(15);
const GETTING_READY: Duration = Duration::from_secs(1);

#[derive(Default)]
pub(super) struct CycleBuffers {
    targets_rad: Vec<f64>,
    states: Vec<JointState>,
    sent: Vec<bool>,
}

struct CycleOutcome {
    buffers: CycleBuffers,
    result: BusResult<()>,
    stats: BusStats,
    imu: Option<ImuState>,
}

pub(super) type BusJob = Box<dyn FnOnce(&mut dyn Bus) + Send>;

pub(super) enum BusTask {
    Cycle(CycleBuffers),
    Call(BusJob),
    /// Torque is on: keep the bus alive until the next task.
    Engage(SyncSender<BusResult<Vec<JointState>>>),
}

pub(super) struct BusThread {
    pub layout: BusLayout,
    pub tasks: Option<SyncSender<BusTask>>,
    cycled: Receiver<CycleOutcome>,
    pub handle: Option<JoinHandle<()>>,
    /// `None` while the thread has them.
    pub buffers: Option<CycleBuffers>,
    pub stats: BusStats,
    pub imu: Option<ImuState>,
    /// Whose goals the last cycle sent.
    pub sent: Vec<bool>,
}

impl BusThread {
    pub fn start(bus: Box<dyn Bus>, layout: BusLayout) -> BusResult<Self> {
        let (tasks, given) = sync_channel(1);
        let (done, cycled) = sync_channel(1);
        let handle = std::thread::Builder::new()
            .name(format!("bus {}", layout.config.name))
            .spawn(move || work(bus, &given, &done))
            .map_err(|reason| {
                let reason = format!("no thread for this bus: {reason}");
                BusError::not_opened(&layout.config.name, reason)
            })?;
        Ok(Self {
            buffers: Some(CycleBuffers {
                targets_rad: vec![0.0; layout.servos.len()],
                states: vec![JointState::default(); layout.servos.len()],
                sent: vec![false; layout.servos.len()],
            }),
            sent: vec![false; layout.servos.len()],
            layout,
            tasks: Some(tasks),
            cycled,
            handle: Some(handle),
            stats: BusStats::default(),
            imu: None,
        })
    }

    /// Hands a task over unless the thread is stuck in the last one.
    pub fn give(&mut self, task: BusTask) -> bool {
        self.take_back();
        self.buffers.is_some()
            && self.tasks.as_ref().is_some_and(|tasks| tasks.try_send(task).is_ok())
    }

    pub fn take_back(&mut self) {
        if self.buffers.is_none()
            && let Ok(cycled) = self.cycled.try_recv()
        {
            (self.stats, self.imu) = (cycled.stats, cycled.imu);
            self.buffers = Some(cycled.buffers);
        }
    }

    pub fn begin_cycle(&mut self, targets_rad: &[f64]) -> BusResult<()> {
        self.take_back();
        self.sent.fill(false);
        let limit = self.layout.config.longest_cycle(self.layout.servos.len());
        let Some(mut buffers) = self.buffers.take() else {
            return Err(self.wedged("its last cycle", limit));
        };
        self.layout.gather(targets_rad, &mut buffers.targets_rad);
        let tasks = self.tasks.as_ref();
        match tasks.map(|tasks| tasks.try_send(BusTask::Cycle(buffers))) {
            Some(Ok(())) => Ok(()),
            _ => Err(self.wedged("its last task", limit)),
        }
    }

    pub fn end_cycle(&mut self, began: Instant, states: &mut [JointState]) -> BusResult<()> {
        let limit = self.layout.config.longest_cycle(self.layout.servos.len());
        let left = (began + limit).saturating_duration_since(Instant::now());
        let Ok(cycled) = self.cycled.recv_timeout(left) else {
            return Err(self.wedged("its cycle", limit));
        };
        (self.stats, self.imu) = (cycled.stats, cycled.imu);
        self.sent.copy_from_slice(&cycled.buffers.sent);
        if cycled.result.is_ok() {
            self.layout.scatter(&cycled.buffers.states, states);
        }
        self.buffers = Some(cycled.buffers);
        cycled.result
    }

    pub fn wedged(&self, doing: &'static str, limit: Duration) -> BusError {
        BusError::Wedged { servos: ids(&self.layout.servos), doing, limit_s: limit.as_secs_f64() }
    }
}

pub(super) fn ids(servos: &[Servo]) -> Vec<ServoId> {
    servos.iter().map(ServoId::of).collect()
}

/// The thread of one bus. The bus is dropped, torque off, when the set is.
fn work(mut bus: Box<dyn Bus>, tasks: &Receiver<BusTask>, done: &SyncSender<CycleOutcome>) {
    let mut next = tasks.recv().ok();
    while let Some(task) = next {
        next = match task {
            BusTask::Cycle(mut buffers) => {
                let result = bus.cycle(&buffers.targets_rad, &mut buffers.states);
                for (index, sent) in buffers.sent.iter_mut().enumerate() {
                    *sent = bus.sent_goal(index);
                }
                let stats = bus.stats();
                let imu = bus.imu();
                let cycled = CycleOutcome { buffers, result, stats, imu };
                if done.send(cycled).is_err() {
                    return;
                }
                tasks.recv().ok()
            }
            BusTask::Call(task) => {
                task(&mut *bus);
                tasks.recv().ok()
            }
            BusTask::Engage(answer) => {
                let engaged = bus.engage();
                let held = engaged.as_ref().ok().cloned();
                let _ = answer.send(engaged);
                match held {
                    Some(states) => keep_alive(&mut *bus, states, tasks),
                    None => tasks.recv().ok(),
                }
            }
        };
    }
}

/// Holds the joints where they stand until there is something else to do.
fn keep_alive(
    bus: &mut dyn Bus,
    mut states: Vec<JointState>,
    tasks: &Receiver<BusTask>,
) -> Option<BusTask> {
    let held: Vec<f64> = states.iter().map(|state| state.position_rad).collect();
    let began = Instant::now();
    while began.elapsed() < GETTING_READY {
        match tasks.recv_timeout(KEEP_ALIVE) {
            Ok(task) => return Some(task),
            Err(RecvTimeoutError::Disconnected) => return None,
            // The next cycle meets a failure again, and reports it.
            Err(RecvTimeoutError::Timeout) => drop(bus.cycle(&held, &mut states)),
        }
    }
    tasks.recv().ok()
}
