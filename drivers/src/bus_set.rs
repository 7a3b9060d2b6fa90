//! Several buses side by side, as one.
//!
//! Each bus has a thread of its own, so that a cycle takes as long as its
//! slowest bus and not the sum. States and targets are in the robot's joint
//! order; no buffer is allocated in a cycle.
//!
//! One bus that fails makes the cycle fail, with its servos named: the safety
//! layer then turns torque off on all of them. A bus that does not come back
//! within its deadline ([`crate::BusConfig::longest_cycle`]) is left alone and told as
//! wedged; its servos are stopped by their own watchdogs.
//!
//! No bus gets torque before every bus has passed its checks. A bus that is
//! ready before the others is kept alive by its thread, for a second at most.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use servodance_types::JointState;

use crate::bus::layout::BusLayout;
use crate::bus::open::open_bus;
use crate::bus::port::Port;
use crate::bus::{Bus, BusStats, Health};
use crate::error::{BusError, ServoId};
use crate::servo::{Servo, check_cycle};

/// Checking and setting up a whole bus, and turning torque off with retries.
const LONG_TASK: Duration = Duration::from_secs(20);
/// How often a thread keeps its bus alive while the others are getting ready, ...
const KEEP_ALIVE: Duration = Duration::from_millis(15);
/// ... and for how long.
const GETTING_READY: Duration = Duration::from_secs(1);

/// Opens every bus of a robot; nothing is sent yet. `all` are its servos in
/// joint order.
pub fn open_buses(
    ports: &[Port],
    layouts: &[BusLayout],
    all: &[Servo],
) -> Result<Box<dyn Bus>, BusError> {
    let mut buses = Vec::with_capacity(layouts.len());
    for (port, layout) in ports.iter().zip(layouts) {
        buses.push(open_bus(port, &layout.config, layout.servos.clone())?);
    }
    match (layouts, buses.len()) {
        ([_], 1) => Ok(buses.remove(0)),
        _ => Ok(Box::new(BusSet::new(buses, layouts, all)?)),
    }
}

/// One bus's part of a cycle; it travels to the thread and back.
#[derive(Default)]
struct Buffers {
    targets_rad: Vec<f64>,
    states: Vec<JointState>,
}

/// What came of it.
struct Cycled {
    buffers: Buffers,
    result: Result<(), BusError>,
    stats: BusStats,
}

/// What is to be done with a bus, once.
type Errand = Box<dyn FnOnce(&mut dyn Bus) + Send>;

enum Task {
    Cycle(Buffers),
    Other(Errand),
    /// Torque is on: keep the bus alive until the next task.
    Engage(SyncSender<Result<Vec<JointState>, BusError>>),
}

/// One bus, its thread, and what is under way.
struct Lane {
    layout: BusLayout,
    tasks: Option<SyncSender<Task>>,
    cycled: Receiver<Cycled>,
    thread: Option<JoinHandle<()>>,
    /// `None` while the thread has them.
    buffers: Option<Buffers>,
    stats: BusStats,
}

/// Several buses as one.
pub struct BusSet {
    lanes: Vec<Lane>,
    servos: Vec<Servo>,
    armed: bool,
    cycles: u64,
}

impl BusSet {
    /// Takes over `buses`, each with its layout; `all` are the servos in joint order.
    pub fn new(
        buses: Vec<Box<dyn Bus>>,
        layouts: &[BusLayout],
        all: &[Servo],
    ) -> Result<Self, BusError> {
        let lanes = buses.into_iter().zip(layouts);
        Ok(Self {
            lanes: lanes
                .map(|(bus, layout)| Lane::start(bus, layout.clone()))
                .collect::<Result<_, _>>()?,
            servos: all.to_vec(),
            armed: false,
            cycles: 0,
        })
    }

    /// The same task for every bus at once; the answers in the order of buses.
    fn on_all<T: Send + 'static>(
        &mut self,
        doing: &'static str,
        task: impl Fn(&mut dyn Bus) -> Result<T, BusError> + Clone + Send + 'static,
    ) -> Vec<Result<T, BusError>> {
        let asked: Vec<_> = self
            .lanes
            .iter_mut()
            .map(|lane| {
                let (answer, answered) = sync_channel(1);
                let task = task.clone();
                let sent = lane.give(Task::Other(Box::new(move |bus| {
                    // Nobody waits any more if it took too long.
                    let _ = answer.send(task(bus));
                })));
                sent.then_some(answered)
            })
            .collect();
        self.answers(asked, doing)
    }

    /// A task for the bus of one joint, which is told the joint's place there.
    fn on_one<T: Send + 'static>(
        &mut self,
        index: usize,
        doing: &'static str,
        task: impl FnOnce(&mut dyn Bus, usize) -> T + Send + 'static,
    ) -> Result<T, BusError> {
        let place = |lane: &Lane| lane.layout.joints.iter().position(|&joint| joint == index);
        for lane in &mut self.lanes {
            let Some(own) = place(lane) else { continue };
            let (answer, answered) = sync_channel(1);
            let given = lane.give(Task::Other(Box::new(move |bus| {
                // Nobody waits any more if it took too long.
                let _ = answer.send(task(bus, own));
            })));
            let answer = given.then(|| answered.recv_timeout(LONG_TASK));
            return match answer {
                Some(Ok(answer)) => Ok(answer),
                _ => Err(lane.wedged(doing, LONG_TASK)),
            };
        }
        Err(BusError::NotArmed)
    }

    /// Waits for what `asked` promise; a lane that did not take its task, or
    /// takes too long, is wedged.
    fn answers<T>(
        &mut self,
        asked: Vec<Option<Receiver<Result<T, BusError>>>>,
        doing: &'static str,
    ) -> Vec<Result<T, BusError>> {
        let until = Instant::now() + LONG_TASK;
        self.lanes
            .iter()
            .zip(asked)
            .map(|(lane, asked)| {
                let left = until.saturating_duration_since(Instant::now());
                asked
                    .and_then(|answer| answer.recv_timeout(left).ok())
                    .unwrap_or_else(|| Err(lane.wedged(doing, LONG_TASK)))
            })
            .collect()
    }
}

impl Lane {
    fn start(bus: Box<dyn Bus>, layout: BusLayout) -> Result<Self, BusError> {
        let (tasks, given) = sync_channel(1);
        let (done, cycled) = sync_channel(1);
        let thread = std::thread::Builder::new()
            .name(format!("bus {}", layout.config.name))
            .spawn(move || work(bus, &given, &done))
            .map_err(|reason| BusError::Open {
                port: layout.config.name.clone(),
                reason: format!("no thread for this bus: {reason}"),
                choices: String::new(),
            })?;
        Ok(Self {
            buffers: Some(Buffers {
                targets_rad: vec![0.0; layout.servos.len()],
                states: vec![JointState::default(); layout.servos.len()],
            }),
            layout,
            tasks: Some(tasks),
            cycled,
            thread: Some(thread),
            stats: BusStats::default(),
        })
    }

    /// Hands a task over unless the thread is stuck in the last one.
    fn give(&mut self, task: Task) -> bool {
        self.take_back();
        self.buffers.is_some()
            && self
                .tasks
                .as_ref()
                .is_some_and(|tasks| tasks.try_send(task).is_ok())
    }

    /// Takes the buffers of an overdue cycle back, if it has come to an end.
    fn take_back(&mut self) {
        if self.buffers.is_none()
            && let Ok(cycled) = self.cycled.try_recv()
        {
            self.stats = cycled.stats;
            self.buffers = Some(cycled.buffers);
        }
    }

    fn begin_cycle(&mut self, targets_rad: &[f64]) -> Result<(), BusError> {
        self.take_back();
        let limit = self.layout.config.longest_cycle(self.layout.servos.len());
        let Some(mut buffers) = self.buffers.take() else {
            return Err(self.wedged("its last cycle", limit));
        };
        self.layout.gather(targets_rad, &mut buffers.targets_rad);
        let tasks = self.tasks.as_ref();
        match tasks.map(|tasks| tasks.try_send(Task::Cycle(buffers))) {
            Some(Ok(())) => Ok(()),
            _ => Err(self.wedged("its last task", limit)),
        }
    }

    fn end_cycle(&mut self, began: Instant, states: &mut [JointState]) -> Result<(), BusError> {
        let limit = self.layout.config.longest_cycle(self.layout.servos.len());
        let left = (began + limit).saturating_duration_since(Instant::now());
        let Ok(cycled) = self.cycled.recv_timeout(left) else {
            return Err(self.wedged("its cycle", limit));
        };
        self.stats = cycled.stats;
        if cycled.result.is_ok() {
            self.layout.scatter(&cycled.buffers.states, states);
        }
        self.buffers = Some(cycled.buffers);
        cycled.result
    }

    fn wedged(&self, doing: &'static str, limit: Duration) -> BusError {
        BusError::Wedged {
            servos: ids(&self.layout.servos),
            doing,
            limit_s: limit.as_secs_f64(),
        }
    }
}

fn ids(servos: &[Servo]) -> Vec<ServoId> {
    servos.iter().map(ServoId::of).collect()
}

/// The thread of one bus. The bus is dropped, torque off, when the set is.
fn work(mut bus: Box<dyn Bus>, tasks: &Receiver<Task>, done: &SyncSender<Cycled>) {
    let mut next = tasks.recv().ok();
    while let Some(task) = next {
        next = match task {
            Task::Cycle(mut buffers) => {
                let result = bus.cycle(&buffers.targets_rad, &mut buffers.states);
                let stats = bus.stats();
                let cycled = Cycled {
                    buffers,
                    result,
                    stats,
                };
                if done.send(cycled).is_err() {
                    return;
                }
                tasks.recv().ok()
            }
            Task::Other(task) => {
                task(&mut *bus);
                tasks.recv().ok()
            }
            Task::Engage(answer) => {
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
    tasks: &Receiver<Task>,
) -> Option<Task> {
    let held: Vec<f64> = states.iter().map(|state| state.position_rad).collect();
    let began = Instant::now();
    while began.elapsed() < GETTING_READY {
        match tasks.recv_timeout(KEEP_ALIVE) {
            Ok(task) => return Some(task),
            Err(RecvTimeoutError::Disconnected) => return None,
            // A failure will be met again, and told, by the next cycle.
            Err(RecvTimeoutError::Timeout) => drop(bus.cycle(&held, &mut states)),
        }
    }
    tasks.recv().ok()
}

impl Bus for BusSet {
    fn servos(&self) -> &[Servo] {
        &self.servos
    }

    fn observe(&mut self) -> Result<Vec<JointState>, BusError> {
        let mut states = vec![JointState::default(); self.servos.len()];
        let observed = self.on_all("reading its states", |bus| bus.observe());
        for (lane, own) in self.lanes.iter().zip(observed) {
            lane.layout.scatter(&own?, &mut states);
        }
        Ok(states)
    }

    fn prepare(&mut self) -> Result<Vec<String>, BusError> {
        let mut notes = Vec::new();
        for prepared in self.on_all("its checks", |bus| bus.prepare()) {
            notes.extend(prepared?);
        }
        Ok(notes)
    }

    fn engage(&mut self) -> Result<Vec<JointState>, BusError> {
        self.armed = true;
        let asked: Vec<_> = self
            .lanes
            .iter_mut()
            .map(|lane| {
                let (answer, answered) = sync_channel(1);
                lane.give(Task::Engage(answer)).then_some(answered)
            })
            .collect();
        let mut states = vec![JointState::default(); self.servos.len()];
        let mut failed = None;
        let answers = self.answers(asked, "turning torque on");
        for (lane, answer) in self.lanes.iter().zip(answers) {
            match answer {
                Ok(own) => lane.layout.scatter(&own, &mut states),
                Err(error) => failed = failed.or(Some(error)),
            }
        }
        match failed {
            None => Ok(states),
            Some(error) => {
                // The first error is the one to report; drop tries again.
                let _ = self.disarm();
                Err(error)
            }
        }
    }

    fn cycle(&mut self, targets_rad: &[f64], states: &mut [JointState]) -> Result<(), BusError> {
        if !self.armed {
            return Err(BusError::NotArmed);
        }
        check_cycle(&self.servos, targets_rad, states.len())?;
        let began = Instant::now();
        let mut failed = None;
        for lane in &mut self.lanes {
            if let Err(error) = lane.begin_cycle(targets_rad) {
                failed = failed.or(Some(error));
            }
        }
        for lane in &mut self.lanes {
            // Buffers still here: the lane did not begin.
            if lane.buffers.is_none()
                && let Err(error) = lane.end_cycle(began, states)
            {
                failed = failed.or(Some(error));
            }
        }
        self.cycles += 1;
        failed.map_or(Ok(()), Err)
    }

    fn disarm(&mut self) -> Result<(), BusError> {
        let mut doubtful = Vec::new();
        let mut reasons = Vec::new();
        let ended = self.on_all("turning torque off", |bus| bus.disarm());
        for (lane, ended) in self.lanes.iter().zip(ended) {
            match ended {
                Ok(()) => {}
                Err(BusError::TorqueUnverified { servos, reason }) => {
                    doubtful.extend(servos);
                    reasons.push(reason);
                }
                Err(error) => {
                    doubtful.extend(ids(&lane.layout.servos));
                    reasons.push(error.to_string());
                }
            }
        }
        if doubtful.is_empty() {
            self.armed = false;
            return Ok(());
        }
        Err(BusError::TorqueUnverified {
            servos: doubtful,
            reason: reasons.join("; "),
        })
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn examine(&mut self, index: usize) -> Result<Health, BusError> {
        self.on_one(index, "a servo's state", |bus, own| bus.examine(own))?
    }

    fn set_aside(&mut self, index: usize) -> bool {
        let aside = self.on_one(index, "leaving out a servo", |bus, own| bus.set_aside(own));
        aside.unwrap_or(false)
    }

    fn rejoin(&mut self, index: usize) -> Result<Option<JointState>, BusError> {
        self.on_one(index, "taking a servo back", |bus, own| bus.rejoin(own))?
    }

    fn reopen(&mut self) -> Result<(), BusError> {
        let reopened = self.on_all("opening its port", |bus| bus.reopen());
        reopened.into_iter().collect()
    }

    fn stats(&self) -> BusStats {
        let mut sum = BusStats::default();
        for lane in &self.lanes {
            sum += lane.stats;
        }
        BusStats {
            cycles: self.cycles,
            ..sum
        }
    }
}

impl Drop for BusSet {
    fn drop(&mut self) {
        for lane in &mut self.lanes {
            lane.take_back();
            lane.tasks = None; // the thread drops its bus, torque off, and ends
        }
        for lane in &mut self.lanes {
            // A wedged thread cannot be waited for.
            if let Some(thread) = lane.thread.take().filter(|_| lane.buffers.is_some()) {
                // A panic there has already been printed.
                let _ = thread.join();
            }
        }
    }
}
