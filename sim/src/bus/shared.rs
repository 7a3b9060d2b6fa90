//! What the thread behind a simulated bus and the bus's owner share.

use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use crate::bus::options::SimClock;
use crate::bus::stepped_line::SteppedLine;
use crate::fault::wire::FaultyWire;

/// Precise waits sleep until so long before their end; the rest is spent
/// spinning, for the precision of a fast bus.
const SLEEP_SLACK: Duration = Duration::from_micros(70);

/// How often real time moves the servos on, whatever else the thread waits for.
pub(crate) const BEAT: Duration = Duration::from_millis(10);
/// Two beats and a half without a step: the machine kept the simulation from running.
const STALLED_S: f64 = 0.025;
/// So long after that the servos still catch up with goals that were read late.
const SETTLE_S: f64 = 0.25;

/// What passed over the simulated wire: sums that do not depend on how reads cut the stream.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs)] // the names say it
pub struct WireStats {
    pub bytes_in: u64,
    pub bytes_out: u64,
    pub packets_in: u64,
    /// Status packets (or pieces of a fast one) to the host.
    pub packets_out: u64,
    pub bad_packets: u64,
    /// Time that the line was busy: ten bits a byte, and return delays. Seconds.
    pub wire_s: f64,
}

impl std::ops::AddAssign for WireStats {
    fn add_assign(&mut self, other: Self) {
        self.bytes_in += other.bytes_in;
        self.bytes_out += other.bytes_out;
        self.packets_in += other.packets_in;
        self.packets_out += other.packets_out;
        self.bad_packets += other.bad_packets;
        self.wire_s += other.wire_s;
    }
}

/// What the thread and its owner share.
#[derive(Debug)]
pub(crate) struct BusShared {
    stepped: Mutex<SteppedLine>,
    wire: Mutex<WireStats>,
    faults: Mutex<FaultyWire>,
    pub stop: AtomicBool,
    pub bus_off: AtomicBool,
    pub busy: AtomicBool,
    /// A second handle on what the thread reads, while it does.
    watched: Mutex<Option<OwnedFd>>,
    pub clock: SimClock,
    pub began: Instant,
    /// Seconds a byte; 0 on CAN, where frames are counted bit by bit.
    pub byte_s: f64,
    /// Between the last byte of a reply and its arrival at the host.
    pub adapter_s: f64,
}

impl BusShared {
    pub fn new(
        stepped: SteppedLine,
        faults: FaultyWire,
        clock: SimClock,
        byte_s: f64,
        adapter_s: f64,
    ) -> Self {
        Self {
            stepped: Mutex::new(stepped),
            wire: Mutex::new(WireStats::default()),
            faults: Mutex::new(faults),
            stop: AtomicBool::new(false),
            bus_off: AtomicBool::new(false),
            busy: AtomicBool::new(false),
            watched: Mutex::new(None),
            clock,
            began: Instant::now(),
            byte_s,
            adapter_s,
        }
    }

    /// The line, brought up to the present in real time.
    pub fn stepped(&self) -> MutexGuard<'_, SteppedLine> {
        let mut stepped = self.stepped_as_it_is();
        if self.clock == SimClock::Realtime {
            let now_s = self.began.elapsed().as_secs_f64();
            // A bus that is unplugged has no thread that could be late.
            let beats = !self.stop.load(Ordering::Acquire);
            if beats && now_s - stepped.time_s() > STALLED_S {
                stepped.excuse_motion(now_s + SETTLE_S);
            }
            stepped.advance_to(now_s);
        }
        stepped
    }

    /// A sign that the simulation runs, at least once a [`BEAT`].
    pub fn beat(&self) {
        if self.clock == SimClock::Realtime {
            drop(self.stepped());
        }
    }

    /// Sleeps for so long while the servos move on.
    pub fn sleep_for(&self, seconds: f64) {
        let due = Instant::now() + Duration::from_secs_f64(seconds);
        self.sleep_to(due);
    }

    fn sleep_to(&self, due: Instant) {
        loop {
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            std::thread::sleep(left.min(BEAT));
            if left > BEAT {
                self.beat();
            }
        }
    }

    pub fn stepped_as_it_is(&self) -> MutexGuard<'_, SteppedLine> {
        self.stepped.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn wire(&self) -> MutexGuard<'_, WireStats> {
        self.wire.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn watched(&self) -> MutexGuard<'_, Option<OwnedFd>> {
        self.watched.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// From now on this is what the thread reads from. `busy` is set meanwhile.
    pub fn watch(&self, fd: OwnedFd) {
        *self.watched() = Some(fd);
    }

    pub fn faults(&self) -> MutexGuard<'_, FaultyWire> {
        self.faults.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// For how long `time_s` is over; never in simulated time.
    pub fn late_s(&self, time_s: f64) -> f64 {
        match self.clock {
            SimClock::Realtime => (self.began.elapsed().as_secs_f64() - time_s).max(0.0),
            SimClock::Lockstep => 0.0,
        }
    }

    /// Waits for a time since the start, in real time, as long as a sleep takes.
    pub fn sleep_until(&self, time_s: f64) {
        self.sleep_early(time_s, Duration::ZERO);
    }

    /// The same to the microsecond: the processor is kept for the last of it.
    pub fn wait_until(&self, time_s: f64) {
        let due = self.sleep_early(time_s, SLEEP_SLACK);
        while due.is_some_and(|due| Instant::now() < due) {
            std::hint::spin_loop();
        }
    }

    /// Sleeps until `slack` before a time since the start; the time, if there
    /// is anything to wait for.
    fn sleep_early(&self, time_s: f64, slack: Duration) -> Option<Instant> {
        if self.clock == SimClock::Lockstep {
            return None;
        }
        let due = self.began + Duration::from_secs_f64(time_s);
        self.sleep_to(due.checked_sub(slack).unwrap_or(due));
        Some(due)
    }
}

impl servodance_drivers::FarEnd for BusShared {
    fn is_idle(&self) -> bool {
        let watched = self.watched();
        // In this order: what has been read is carried out while `busy` is set.
        let unread = watched.as_ref().is_some_and(has_unread);
        !unread && !self.busy.load(Ordering::SeqCst)
    }

    fn time_s(&self) -> f64 {
        self.stepped().time_s()
    }
}

/// Whether there is something to read; that the other end is closed is not.
fn has_unread(fd: &OwnedFd) -> bool {
    let mut fds = [PollFd::new(fd.as_fd(), PollFlags::POLLIN)];
    let polled = poll(&mut fds, PollTimeout::ZERO);
    let found = fds[0].revents().unwrap_or(PollFlags::empty());
    polled.is_ok() && found.contains(PollFlags::POLLIN)
}

/// The thread reads no more, even if it panicked: nothing is waited for.
pub(crate) struct Gone(pub Arc<BusShared>);

impl Drop for Gone {
    fn drop(&mut self) {
        *self.0.watched() = None;
        self.0.busy.store(false, Ordering::SeqCst);
    }
}
