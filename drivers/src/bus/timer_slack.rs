//! Sleeps that end when they should.

/// Lets sleeps of the calling thread, and of those that it starts from now on, end on time: Linux
/// lets those of ordinary threads end 50 us late, to gather wake-ups, which is a twentieth of a
/// cycle of a fast bus. Everybody may do that; elsewhere it does nothing.
pub fn sleep_precisely() {
    #[cfg(target_os = "linux")]
    {
        // Where the system refuses, sleeps are as long as before.
        let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
    }
}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    #[test]
    fn the_slack_of_a_thread_and_of_its_own_is_gone() {
        let slack = || rustix::thread::current_timer_slack().unwrap();
        let thread = std::thread::spawn(move || {
            super::sleep_precisely();
            let child = std::thread::spawn(slack).join().unwrap();
            (slack(), child)
        });
        assert_eq!(thread.join().unwrap(), (1, 1));
    }
}
