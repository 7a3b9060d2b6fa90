//! The alarm of a bus that is dropped with torque on and cannot turn it off: there
//! is nobody left to return an error to.
//!
//! On standard error, unless the program has a better place. Simulated servos
//! have no power that somebody could cut: they raise no alarm.

use std::sync::OnceLock;

use crate::bus::reply_clock::ReplyClock;

/// Takes the line of an alarm.
pub type TorqueAlarm = fn(&str);

static ALARM: OnceLock<TorqueAlarm> = OnceLock::new();

/// Has alarms handed to `alarm` from now on. Only the first call counts.
pub fn set_torque_alarm(alarm: TorqueAlarm) {
    let _ = ALARM.set(alarm);
}

pub(crate) fn raise(clock: &ReplyClock, text: &str) {
    if *clock != ReplyClock::Wall {
        return;
    }
    match ALARM.get() {
        Some(alarm) => alarm(text),
        None => eprintln!("{text}"),
    }
}
