//! What a bus says when it is dropped with torque on and cannot turn it off:
//! there is nobody left to return an error to.
//!
//! On standard error, unless the program has a better place. Simulated servos
//! have no power that somebody could cut: nothing is said of them.

use std::sync::OnceLock;

use crate::reply_clock::ReplyClock;

/// Is told a line.
pub type Listener = fn(&str);

static LISTENER: OnceLock<Listener> = OnceLock::new();

/// Has last words told to `listener` from now on. Only the first counts.
pub fn hear_last_words(listener: Listener) {
    let _ = LISTENER.set(listener);
}

/// Says them.
pub(crate) fn say(clock: &ReplyClock, text: &str) {
    if *clock != ReplyClock::Wall {
        return;
    }
    match LISTENER.get() {
        Some(listener) => listener(text),
        None => eprintln!("{text}"),
    }
}
