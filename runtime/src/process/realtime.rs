//! Real-time priority for the threads that must not wait: the operating system
//! runs them before all ordinary work (SCHED_FIFO on Linux).
//!
//! Threads inherit the priority of the thread that starts them, so whoever
//! starts threads raises itself first. No root is needed where the system
//! grants `rtprio`; where it does not, everything works, less punctually.

use servodance_drivers::sleep_precisely;
use std::fs::{File, OpenOptions};
use std::io::Write;
use thread_priority::{
    NormalThreadSchedulePolicy, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

/// What a thread is for; the later in this list, the more urgent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ThreadRole {
    /// Features and motion, 20 times a second.
    Model,
    /// Takes sound from the device.
    Capture,
    /// Commands to the servos, every control cycle.
    Control,
}

impl ThreadRole {
    /// Above ordinary work, below what the kernel does itself (50).
    const fn priority(self) -> u8 {
        match self {
            ThreadRole::Model => 20,
            ThreadRole::Capture => 30,
            ThreadRole::Control => 40,
        }
    }
}

#[derive(Debug, thiserror::Error)]
#[error(
    "real-time priority is not allowed here, so frames may come late on a busy machine; \
     to allow it, give the user rtprio 40 in /etc/security/limits.conf"
)]
/// The system does not allow it.
pub struct NotAllowed;

/// Gives the calling thread, and those that it starts from now on, the
/// priority of `role`. Their sleeps end on time, whatever the system allows.
pub fn raise(role: ThreadRole) -> Result<(), NotAllowed> {
    sleep_precisely();
    let value = ThreadPriorityValue::try_from(role.priority()).map_err(|_| NotAllowed)?;
    set_thread_priority_and_policy(
        thread_native_id(),
        ThreadPriority::Crossplatform(value),
        ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo),
    )
    .map_err(|_| NotAllowed)
}

/// Lets all other threads of the machine go before the calling one (niceness
/// on Linux). Where the system refuses, nothing changes.
pub fn yield_to_others() {
    if let Ok(low) = ThreadPriorityValue::try_from(10) {
        let _ = set_thread_priority_and_policy(
            thread_native_id(),
            ThreadPriority::Crossplatform(low),
            ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Other),
        );
    }
}

/// Gives the thread that drops it back to ordinary work.
pub struct OrdinaryAfterwards;

impl Drop for OrdinaryAfterwards {
    fn drop(&mut self) {
        // The middle of the range is niceness 0. A thread that was never
        // raised is ordinary already.
        if let Ok(middle) = ThreadPriorityValue::try_from(49) {
            let _ = set_thread_priority_and_policy(
                thread_native_id(),
                ThreadPriority::Crossplatform(middle),
                ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Other),
            );
        }
    }
}

/// While it lives the processors do not sleep when they have nothing to do: a
/// thread that waits for a reply goes on some 50 us sooner. That costs power and
/// heat, so it is for measuring and not for a dance, whose cycles are 8 to 10 ms.
pub struct Awake {
    /// The system takes the request back when this is closed.
    _request: File,
}

impl Awake {
    /// Asks the system (Linux: `/dev/cpu_dma_latency`); `None` where it has no
    /// such thing or does not allow it.
    pub fn keep() -> Option<Self> {
        const AT_ONCE_US: i32 = 0;
        let device = OpenOptions::new().write(true).open("/dev/cpu_dma_latency");
        let mut request = device.ok()?;
        request.write_all(&AT_ONCE_US.to_ne_bytes()).ok()?;
        Some(Self { _request: request })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raised_thread_is_ordinary_again_afterwards() {
        let policy = || thread_priority::thread_schedule_policy().expect("a policy");
        let before = policy();
        {
            let _afterwards = OrdinaryAfterwards;
            let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
            match raise(ThreadRole::Control) {
                Ok(()) => assert_eq!(policy(), fifo),
                Err(NotAllowed) => assert_eq!(policy(), before),
            }
        }
        assert_eq!(policy(), before);
    }
}
