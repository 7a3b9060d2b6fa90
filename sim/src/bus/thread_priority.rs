//! Priority of the thread that simulates servos in real time: they have no processor
//! of their own.

use servodance_drivers::sleep_precisely;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Above the control loop that waits for the servos, below what the kernel does itself (50).
const PRIORITY: u8 = 45;

/// Lets the calling thread run before ordinary work, as far as the system allows
/// it: a real servo does not answer late because the host is busy.
pub fn raise_priority() {
    sleep_precisely();
    if let Ok(value) = ThreadPriorityValue::try_from(PRIORITY) {
        // Where it is refused, replies are late when the machine is busy.
        let _ = set_thread_priority_and_policy(
            thread_native_id(),
            ThreadPriority::Crossplatform(value),
            ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo),
        );
    }
}
