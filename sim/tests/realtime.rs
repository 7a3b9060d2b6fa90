//! The driver against simulated servos in real time: wire time imposed, the
//! machine's own clock. Nothing here asserts on how long anything took.

mod common;

use common::*;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use servodance_drivers::{SafeBus, SafetyConfig};
use servodance_sim::{SimBus, SimOptions};
use servodance_types::JointState;
use std::fs::File;
use std::os::fd::AsFd;
use std::time::Instant;

#[test]
fn a_short_dance_in_real_time_ends_with_torque_off() {
    let servos = robot(20);
    let sim = SimBus::start(&specs(&servos), SimOptions::realtime(BAUD, HZ)).unwrap();
    let config = SafetyConfig {
        // A machine that stalls is not what is tested.
        stale_after_s: 5.0,
        following_error_s: 5.0,
        ramp_s: 0.3,
        ..SafetyConfig::at_hz(HZ)
    };
    let mut bus_config = patient();
    bus_config.watchdog_ms = 2540;
    let mut safe = SafeBus::new(driver(&sim, &bus_config, &servos), config).unwrap();
    let clock = Instant::now();
    safe.arm(clock.elapsed().as_secs_f64()).unwrap();
    let mut states = vec![JointState::default(); 20];
    for k in 0..100 {
        let target = 0.3 * (1.0 - (0.04 * f64::from(k)).cos());
        safe.command(clock.elapsed().as_secs_f64(), &[target; 20]);
        safe.tick(clock.elapsed().as_secs_f64(), &mut states).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(9));
    }
    assert!(states[0].position_rad > 0.1, "{states:?}");
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
    safe.disarm(clock.elapsed().as_secs_f64(), "end").unwrap();
    assert!(!any_torque(&sim, &servos));
    // The wire carries a cycle of 436 bytes at most 459 times a second.
    let wire = sim.wire_stats();
    assert!(wire.wire_s <= sim.time_s(), "{wire:?} in {} s", sim.time_s());
    assert!(wire.bytes_in + wire.bytes_out > 100 * 436);
}

#[test]
fn dropping_a_running_bus_ends_its_thread() {
    let servos = robot(2);
    for _ in 0..20 {
        let sim = SimBus::start(&specs(&servos), SimOptions::realtime(BAUD, HZ)).unwrap();
        let port = File::open(sim.port_path()).unwrap();
        assert!(!hung_up(&port));
        drop(sim);
        assert!(hung_up(&port));
    }
}

/// Whether the other end of a pseudo-terminal is gone. Its name would not tell:
/// whoever asks for a terminal next gets the same one.
fn hung_up(port: &File) -> bool {
    let mut watched = [PollFd::new(port.as_fd(), PollFlags::POLLIN)];
    poll(&mut watched, PollTimeout::ZERO).unwrap();
    let seen = watched[0].revents().unwrap();
    seen.contains(PollFlags::POLLHUP)
}
