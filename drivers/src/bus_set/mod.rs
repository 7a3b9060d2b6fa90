//! Several buses side by side, as one.
//!
//! Each bus has a thread of its own, so that a cycle takes as long as its
//! slowest bus and not the sum. States and targets are in the robot's joint
//! order; no buffer is allocated in a cycle.
//!
//! One bus that fails makes the cycle fail, with its servos named: the safety
//! layer then turns torque off on all of them. A bus that does not come back
//! within its deadline ([`crate::BusConfig::longest_cycle`]) is left alone and reported as
//! wedged; its servos are stopped by their own watchdogs.
//!
//! No bus gets torque before every bus has passed its checks. A bus that is
//! ready before the others is kept alive by its thread, for a second at most.

mod thread;

use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use servodance_types::{ImuState, JointState};

use crate::bus::error_counters::ErrorCounters;
use crate::bus::layout::BusLayout;
use crate::bus::open::open_bus;
use crate::bus::port::Port;
use crate::bus::{Bus, BusStats, Health, Notes};
use crate::error::{BusError, BusResult};
use crate::ros2::Ros2Bus;
use crate::serial::ServoDeviation;
use crate::servo::{Servo, check_cycle};

use self::thread::{BusTask, BusThread, ids};

const LONG_TASK: Duration = Duration::from_secs(20);

/// Opens every bus of a robot, whose servos in joint order are `all`. Nothing is sent.
pub fn open_buses(ports: &[Port], layouts: &[BusLayout], all: &[Servo]) -> BusResult<Box<dyn Bus>> {
    // One controller has all joints, whatever wires it has itself.
    if let [Port::Ros2(address), rest @ ..] = ports
        && rest.iter().all(|port| *port == ports[0])
    {
        return Ok(Box::new(Ros2Bus::open(address, all.to_vec())?));
    }
    let mut buses = Vec::with_capacity(layouts.len());
    for (port, layout) in ports.iter().zip(layouts) {
        buses.push(open_bus(port, &layout.config, layout.servos.clone())?);
    }
    match (layouts, buses.len()) {
        ([_], 1) => Ok(buses.remove(0)),
        _ => Ok(Box::new(BusSet::new(buses, layouts, all)?)),
    }
}

/// Several buses as one bus.
pub struct BusSet {
    threads: Vec<BusThread>,
    servos: Vec<Servo>,
    armed: bool,
    cycles: u64,
    errors: ErrorCounters,
}

impl BusSet {
    /// Takes over `buses`, each with its layout; `all` are the servos in joint order.
    pub fn new(buses: Vec<Box<dyn Bus>>, layouts: &[BusLayout], all: &[Servo]) -> BusResult<Self> {
        let mut errors = ErrorCounters::new(all.len());
        for (bus, layout) in buses.iter().zip(layouts) {
            errors.adopt(&layout.joints, &bus.error_counters());
        }
        let threads = buses.into_iter().zip(layouts);
        Ok(Self {
            threads: threads
                .map(|(bus, layout)| BusThread::start(bus, layout.clone()))
                .collect::<Result<_, _>>()?,
            servos: all.to_vec(),
            armed: false,
            cycles: 0,
            errors,
        })
    }

    /// Gives every thread the task that `task` makes of a channel for its answer. A thread that
    /// does not take it, or takes too long, is wedged.
    fn ask_all<T>(
        &mut self,
        doing: &'static str,
        task: impl Fn(SyncSender<BusResult<T>>) -> BusTask,
    ) -> Vec<BusResult<T>> {
        let asked = self.threads.iter_mut().map(|thread| {
            let (answer, answered) = sync_channel(1);
            thread.give(task(answer)).then_some(answered)
        });
        let asked: Vec<_> = asked.collect();
        let until = Instant::now() + LONG_TASK;
        let answers = self.threads.iter().zip(asked).map(|(thread, asked)| {
            let left = until.saturating_duration_since(Instant::now());
            asked
                .and_then(|answer| answer.recv_timeout(left).ok())
                .unwrap_or_else(|| Err(thread.wedged(doing, LONG_TASK)))
        });
        answers.collect()
    }

    /// Calls `task` on every bus at once; the answers in the order of buses.
    fn on_all<T: Send + 'static>(
        &mut self,
        doing: &'static str,
        task: impl Fn(&mut dyn Bus) -> BusResult<T> + Clone + Send + 'static,
    ) -> Vec<BusResult<T>> {
        self.ask_all(doing, |answer| {
            let task = task.clone();
            BusTask::Call(Box::new(move |bus| {
                // The receiver is gone if it took too long.
                let _ = answer.send(task(bus));
            }))
        })
    }

    /// Calls `task` on the bus of one joint, with the joint's place there.
    fn on_one<T: Send + 'static>(
        &mut self,
        index: usize,
        doing: &'static str,
        task: impl FnOnce(&mut dyn Bus, usize) -> T + Send + 'static,
    ) -> BusResult<T> {
        let place =
            |thread: &BusThread| thread.layout.joints.iter().position(|&joint| joint == index);
        for thread in &mut self.threads {
            let Some(own) = place(thread) else { continue };
            let (answer, answered) = sync_channel(1);
            let given = thread.give(BusTask::Call(Box::new(move |bus| {
                // The receiver is gone if it took too long.
                let _ = answer.send(task(bus, own));
            })));
            let answer = given.then(|| answered.recv_timeout(LONG_TASK));
            return match answer {
                Some(Ok(answer)) => Ok(answer),
                _ => Err(thread.wedged(doing, LONG_TASK)),
            };
        }
        Err(BusError::NotArmed)
    }
}

impl Bus for BusSet {
    fn servos(&self) -> &[Servo] {
        &self.servos
    }

    fn observe(&mut self) -> BusResult<Vec<JointState>> {
        let mut states = vec![JointState::default(); self.servos.len()];
        let observed = self.on_all("reading its states", |bus| bus.observe());
        for (thread, own) in self.threads.iter().zip(observed) {
            thread.layout.scatter(&own?, &mut states);
        }
        Ok(states)
    }

    fn prepare(&mut self) -> BusResult<Notes> {
        let mut notes = Vec::new();
        for prepared in self.on_all("its checks", |bus| bus.prepare()) {
            notes.extend(prepared?);
        }
        Ok(notes)
    }

    fn set_up(&mut self) -> BusResult<Notes> {
        let mut notes = Vec::new();
        for own in self.on_all("setting its servos up", |bus| bus.set_up()) {
            notes.extend(own?);
        }
        Ok(notes)
    }

    fn deviations(&mut self) -> BusResult<Vec<ServoDeviation>> {
        let mut all = Vec::new();
        let found = self.on_all("reading its settings", |bus| bus.deviations());
        for (thread, own) in self.threads.iter().zip(found) {
            let joints = &thread.layout.joints;
            all.extend(
                own?.into_iter()
                    .map(|found| ServoDeviation { index: joints[found.index], ..found }),
            );
        }
        Ok(all)
    }

    fn refused(&mut self) -> BusResult<Vec<BusError>> {
        let mut all = Vec::new();
        for own in self.on_all("reading its limits", |bus| bus.refused()) {
            all.extend(own?);
        }
        Ok(all)
    }

    fn homing_offset(&mut self, index: usize) -> BusResult<Option<i32>> {
        self.on_one(index, "reading a homing offset", |bus, own| bus.homing_offset(own))?
    }

    fn engage(&mut self) -> BusResult<Vec<JointState>> {
        self.armed = true;
        let mut states = vec![JointState::default(); self.servos.len()];
        let mut failed = None;
        let answers = self.ask_all("turning torque on", BusTask::Engage);
        for (thread, answer) in self.threads.iter().zip(answers) {
            match answer {
                Ok(own) => thread.layout.scatter(&own, &mut states),
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

    fn cycle(&mut self, targets_rad: &[f64], states: &mut [JointState]) -> BusResult<()> {
        if !self.armed {
            return Err(BusError::NotArmed);
        }
        check_cycle(&self.servos, targets_rad, states.len())?;
        let began = Instant::now();
        let mut failed = None;
        for thread in &mut self.threads {
            if let Err(error) = thread.begin_cycle(targets_rad) {
                failed = failed.or(Some(error));
            }
        }
        for thread in &mut self.threads {
            // CycleBuffers still here: the thread did not begin.
            if thread.buffers.is_none()
                && let Err(error) = thread.end_cycle(began, states)
            {
                failed = failed.or(Some(error));
            }
        }
        self.cycles += 1;
        failed.map_or(Ok(()), Err)
    }

    fn disarm(&mut self) -> BusResult<()> {
        let mut doubtful = Vec::new();
        let mut reasons = Vec::new();
        let ended = self.on_all("turning torque off", |bus| bus.disarm());
        for (thread, ended) in self.threads.iter().zip(ended) {
            match ended {
                Ok(()) => {}
                Err(BusError::TorqueUnverified { servos, reason }) => {
                    doubtful.extend(servos);
                    reasons.push(reason);
                }
                Err(error) => {
                    doubtful.extend(ids(&thread.layout.servos));
                    reasons.push(error.to_string());
                }
            }
        }
        if doubtful.is_empty() {
            self.armed = false;
            return Ok(());
        }
        Err(BusError::TorqueUnverified { servos: doubtful, reason: reasons.join("; ") })
    }

    fn sent_goal(&self, index: usize) -> bool {
        let sent = |thread: &BusThread| {
            let own = thread.layout.joints.iter().position(|&joint| joint == index)?;
            thread.sent.get(own).copied()
        };
        self.threads.iter().find_map(sent).unwrap_or(false)
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn error_counters(&self) -> ErrorCounters {
        self.errors.clone()
    }

    fn imu(&self) -> Option<ImuState> {
        self.threads.iter().find_map(|thread| thread.imu)
    }

    fn examine(&mut self, index: usize) -> BusResult<Health> {
        self.on_one(index, "a servo's state", |bus, own| bus.examine(own))?
    }

    fn set_aside(&mut self, index: usize) -> bool {
        let aside = self.on_one(index, "leaving out a servo", |bus, own| bus.set_aside(own));
        aside.unwrap_or(false)
    }

    fn rejoin(&mut self, index: usize) -> BusResult<Option<JointState>> {
        self.on_one(index, "taking a servo back", |bus, own| bus.rejoin(own))?
    }

    fn resume(&mut self, index: usize) -> BusResult<JointState> {
        self.on_one(index, "taking a servo on again", |bus, own| bus.resume(own))?
    }

    fn reopen(&mut self) -> BusResult<()> {
        let reopened = self.on_all("opening its port", |bus| bus.reopen());
        reopened.into_iter().collect()
    }

    fn stats(&self) -> BusStats {
        let mut sum = BusStats::default();
        for thread in &self.threads {
            sum += thread.stats;
        }
        BusStats { cycles: self.cycles, ..sum }
    }
}

impl Drop for BusSet {
    fn drop(&mut self) {
        for thread in &mut self.threads {
            thread.take_back();
            thread.tasks = None; // the thread drops its bus, torque off, and ends
        }
        for thread in &mut self.threads {
            // A wedged thread cannot be waited for.
            if let Some(handle) = thread.handle.take().filter(|_| thread.buffers.is_some()) {
                // A panic there has already been printed.
                let _ = handle.join();
            }
        }
    }
}
