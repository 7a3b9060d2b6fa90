//! The driver on CAN interfaces of a real kernel. Ignored in an ordinary test
//! run: `tests/vm/run.sh` boots a machine that has them. On a machine of one's
//! own: `ip link add vcan0 type vcan`, then these tests as root with
//! `--ignored --test-threads=1` and `SERVODANCE_CAN=vcan0`.

#![cfg(target_os = "linux")]

mod common;

use std::process::Command;
use std::time::{Duration, Instant};

use common::can::*;
use common::*;
use servodance_drivers::can::transport::socket::SocketLink;
use servodance_drivers::can::{CanBus, CanEvent, CanFault, CanFrame, CanLink, Sent};
use servodance_drivers::{Bus, BusConfig, SafeBus, SafetyConfig, SafetyError, Servo};
use servodance_sim::{SimBus, SimLink, SimOptions};
use servodance_types::JointState;
use socketcan::{CanErrorFrame, CanSocket, Socket, errors};

/// The interface to use up and down, but never to the outside world.
fn interface() -> String {
    std::env::var("SERVODANCE_CAN").expect("SERVODANCE_CAN names a virtual CAN interface")
}

fn system(command: &str) {
    let words: Vec<&str> = command.split_whitespace().collect();
    let status = Command::new(words[0]).args(&words[1..]).status();
    assert!(status.expect("the command runs").success(), "{command}");
}

/// A slow wire with room for ten frames, as interfaces have: a frame of 16 bytes
/// in the queue takes a millisecond, so that even an emulated machine fills it.
/// Gone when dropped.
struct Wire(String);

impl Wire {
    fn at(interface: &str) -> Self {
        system(&format!("tc qdisc add dev {interface} root tbf rate 128kbit burst 32 limit 160"));
        Self(interface.into())
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        system(&format!("tc qdisc del dev {} root", self.0));
    }
}

/// An interface taken down; up again when dropped, for the tests that follow.
struct Down(String);

impl Down {
    fn take(interface: String) -> Self {
        system(&format!("ip link set {interface} down"));
        Self(interface)
    }
}

impl Drop for Down {
    fn drop(&mut self) {
        system(&format!("ip link set {} up", self.0));
    }
}

fn link() -> SocketLink {
    SocketLink::open(&interface()).expect("the interface opens")
}

fn soon() -> Instant {
    Instant::now() + Duration::from_secs(2)
}

#[test]
#[ignore = "needs a CAN interface"]
fn frames_of_both_id_sizes_pass_between_two_sockets() {
    let (mut host, mut motor) = (link(), link());
    for k in 0..200u32 {
        let frame = match k % 3 {
            0 => CanFrame::standard(k, &k.to_be_bytes()),
            1 => CanFrame::extended(0x1C00_0000 | k, &[k as u8; 8]),
            _ => CanFrame::remote(k, 8),
        };
        assert_eq!(host.send(&frame).unwrap(), Sent::Taken);
        assert_eq!(motor.receive(soon()).unwrap(), CanEvent::Frame(frame));
    }
    let long = CanFrame::flexible(0x8001, &[7; 42], 0x50);
    assert!(host.carries_flexible());
    assert_eq!(host.send(&long).unwrap(), Sent::Taken);
    assert_eq!(motor.receive(soon()).unwrap(), CanEvent::Frame(long));
    // Nobody hears himself, and a deadline in the past does not wait.
    assert_eq!(host.receive(Instant::now()).unwrap(), CanEvent::Nothing);
    motor.send(&CanFrame::standard(1, &[1])).unwrap();
    assert!(matches!(host.receive(soon()).unwrap(), CanEvent::Frame(_)));
    assert_eq!(host.receive(Instant::now()).unwrap(), CanEvent::Nothing);
}

#[test]
#[ignore = "needs a CAN interface"]
fn a_full_queue_is_told_and_empties_again() {
    let wire = Wire::at(&interface());
    let (mut host, mut motor) = (link(), link());
    let frame = |k: u8| CanFrame::standard(k.into(), &[k; 8]);
    let mut full = 0;
    for k in 0..100 {
        while host.send(&frame(k)).unwrap() == Sent::Full {
            full += 1;
            std::thread::sleep(Duration::from_micros(111));
        }
    }
    assert!(full > 0, "the queue of ten frames took a hundred at once");
    for k in 0..100 {
        assert_eq!(motor.receive(soon()).unwrap(), CanEvent::Frame(frame(k)));
    }
    drop(wire);
}

#[test]
#[ignore = "needs a CAN interface"]
fn error_frames_of_the_controller_are_faults() {
    let mut host = link();
    // A virtual controller has no errors of its own: hand it some.
    let controller = CanSocket::open(&interface()).expect("a socket");
    for (bits, flags, fault) in [
        (errors::CAN_ERR_CRTL, 0x08, CanFault::Warning),
        (errors::CAN_ERR_CRTL, 0x20, CanFault::Passive),
        (errors::CAN_ERR_ACK, 0, CanFault::Error),
        (errors::CAN_ERR_CRTL, 0x01, CanFault::Overrun),
        (errors::CAN_ERR_BUSOFF, 0, CanFault::BusOff),
    ] {
        let frame = CanErrorFrame::new_error(bits, &[0, flags, 0, 0, 0, 0, 0, 0]).unwrap();
        controller.write_frame(&frame).unwrap();
        assert_eq!(host.receive(soon()).unwrap(), CanEvent::Fault(fault));
    }
}

#[test]
#[ignore = "needs a CAN interface"]
fn an_interface_taken_down_is_an_error_until_it_is_back() {
    let interface = interface();
    let (mut host, mut motor) = (link(), link());
    let frame = CanFrame::standard(1, &[1]);
    let down = Down::take(interface.clone());
    let error = host.send(&frame).unwrap_err().to_string();
    assert!(error.contains("interface is down"), "{error}");
    let error = motor.receive(soon()).unwrap_err().to_string();
    assert!(error.contains("interface is down"), "{error}");
    let refused = SocketLink::open(&interface).unwrap_err().to_string();
    assert!(refused.contains("`sudo ip link set"), "{refused}");
    drop(down);
    host.send(&frame).unwrap();
    assert_eq!(motor.receive(soon()).unwrap(), CanEvent::Frame(frame));
}

#[test]
#[ignore = "needs a CAN interface"]
fn a_missing_interface_is_refused_with_those_there_are() {
    let error = SocketLink::open("can7").unwrap_err().to_string();
    let here = format!("CAN interfaces here: {} (up)", interface());
    assert!(error.contains(&here) && error.contains("ip link set"), "{error}");
}

/// A robot of twenty motors at `SERVODANCE_CAN`, in real time: the machine may
/// stall, so replies may be late and nothing is asserted about time.
fn twenty(kind: MotorKind) -> (Vec<Servo>, SimBus, BusConfig) {
    let servos = can_robot(kind, 20);
    let options =
        SimOptions { link: SimLink::Interface(interface()), ..SimOptions::realtime(BITRATE, HZ) };
    let sim = SimBus::start(&specs(&servos), options).expect("simulated motors");
    // An emulated machine stalls for longer than a live watchdog allows.
    let config = BusConfig { watchdog_ms: 2000, ..can_patient(kind) };
    (servos, sim, config)
}

/// Dances `cycles` cycles at the pace of the clock; the largest error of a joint.
fn dance(safe: &mut SafeBus<CanBus>, cycles: usize) -> Result<f64, SafetyError> {
    let mut states = vec![JointState::default(); 20];
    let began = Instant::now();
    let mut worst_rad = 0.0f64;
    safe.arm(0.0)?;
    for k in 0..cycles {
        let now_s = began.elapsed().as_secs_f64();
        let target_rad = 0.2 * (1.0 - (3.0 * now_s).cos());
        safe.command(now_s, &[target_rad; 20]);
        safe.tick(now_s, &mut states)?;
        let sent = safe.sent_rad().iter().zip(&states);
        let errors = sent.map(|(sent, state)| (sent - state.position_rad).abs());
        worst_rad = errors.fold(worst_rad, f64::max);
        let next_s = (k + 1) as f64 * PERIOD_S;
        let left_s = next_s - began.elapsed().as_secs_f64();
        std::thread::sleep(Duration::from_secs_f64(left_s.max(0.0)));
    }
    Ok(worst_rad)
}

fn dances_without_loss(kind: MotorKind) {
    let (servos, sim, config) = twenty(kind);
    let port = sim.port().to_string();
    let bus = CanBus::open(&port, &config, servos.clone()).unwrap();
    let calm = SafetyConfig {
        stale_after_s: 5.0,
        following_error_s: 5.0,
        ramp_s: 0.3,
        ..SafetyConfig::at_hz(HZ)
    };
    let mut safe = SafeBus::new(bus, calm).unwrap();
    let worst_rad = dance(&mut safe, 300).unwrap_or_else(|error| panic!("{kind:?}: {error}"));
    assert!(worst_rad < 0.2, "{kind:?}: off by {worst_rad} rad");
    safe.disarm(1e3, "end").unwrap();
    assert!(!any_torque(&sim, &servos), "{kind:?}");
    let stats = safe.stats();
    // A tick that comes too soon after a stall does nothing: not all of them cycle.
    assert!(stats.cycles >= 150, "{kind:?}: {stats:?}");
    assert_eq!((stats.timeouts, stats.retries), (0, 0), "{kind:?}: {stats:?}");
    // Not acceleration: commands that a stall has bunched jerk a motor.
    let broken = sim.motion_violations();
    let notes = sim.violation_notes();
    assert_eq!((broken.position, broken.velocity), (0, 0), "{notes:?}");
    println!("{kind:?}: 20 motors, {} frames, none lost", stats.packets);
}

#[test]
#[ignore = "needs a CAN interface"]
fn twenty_mit_motors_dance_without_losing_a_frame() {
    dances_without_loss(MotorKind::Damiao);
}

#[test]
#[ignore = "needs a CAN interface"]
fn twenty_robstride_motors_dance_without_losing_a_frame() {
    dances_without_loss(MotorKind::Robstride);
}

#[test]
#[ignore = "needs a CAN interface"]
fn twenty_moteus_motors_dance_over_can_fd_without_losing_a_frame() {
    dances_without_loss(MotorKind::Moteus);
}

#[test]
#[ignore = "needs a CAN interface"]
fn a_short_queue_is_paced_and_nothing_is_lost() {
    let (servos, sim, config) = twenty(MotorKind::Damiao);
    let wire = Wire::at(&interface());
    let port = sim.port().to_string();
    let mut bus = CanBus::open(&port, &config, servos.clone()).unwrap();
    let mut states = bus.arm().unwrap().states;
    let held: Vec<f64> = states.iter().map(|state| state.position_rad).collect();
    for _ in 0..30 {
        bus.cycle(&held, &mut states).unwrap();
    }
    // Twenty commands at once against a queue of ten.
    assert!(bus.queue_full() > 0);
    bus.disarm().unwrap();
    assert!(!any_torque(&sim, &servos));
    println!("queue full {} times, {:?}", bus.queue_full(), bus.stats());
    drop(wire);
}

#[test]
#[ignore = "needs a CAN interface"]
fn an_interface_that_goes_down_stops_every_motor_by_its_watchdog() {
    let (servos, sim, config) = twenty(MotorKind::Damiao);
    let config = BusConfig { reply_timeout_ms: 100.0, ..config };
    let mut bus = CanBus::open(&sim.port().to_string(), &config, servos.clone()).unwrap();
    let mut states = bus.arm().unwrap().states;
    let held: Vec<f64> = states.iter().map(|state| state.position_rad).collect();
    bus.cycle(&held, &mut states).unwrap();
    assert!(any_torque(&sim, &servos));
    let down = Down::take(interface());
    let error = bus.cycle(&held, &mut states).unwrap_err().to_string();
    assert!(error.contains("interface is down"), "{error}");
    // Nobody can turn torque off now, and that is said with every joint's name.
    let error = bus.disarm().unwrap_err().to_string();
    assert!(error.contains("torque may still be ON") && error.contains("and 16 more"), "{error}");
    wait_for("the watchdogs", || !any_torque(&sim, &servos));
    drop(down);
    let mut states = bus.arm().expect("motors that are there again").states;
    bus.cycle(&held, &mut states).unwrap();
    bus.disarm().unwrap();
}

#[test]
#[ignore = "needs a CAN interface"]
fn bus_off_ends_the_dance_and_the_watchdogs_stop_the_motors() {
    let (servos, sim, config) = twenty(MotorKind::Robstride);
    let mut bus = CanBus::open(&sim.port().to_string(), &config, servos.clone()).unwrap();
    let mut states = bus.arm().unwrap().states;
    let held: Vec<f64> = states.iter().map(|state| state.position_rad).collect();
    bus.cycle(&held, &mut states).unwrap();
    let controller = CanSocket::open(&interface()).expect("a socket");
    let off = CanErrorFrame::new_error(errors::CAN_ERR_BUSOFF, &[0; 8]).unwrap();
    controller.write_frame(&off).unwrap();
    let error = bus.cycle(&held, &mut states).unwrap_err().to_string();
    assert!(error.contains("bus-off") && error.contains("can:"), "{error}");
    drop(bus);
    wait_for("torque off", || !any_torque(&sim, &servos));
}

fn wait_for(what: &str, done: impl Fn() -> bool) {
    let began = Instant::now();
    while !done() {
        assert!(began.elapsed() < Duration::from_secs(30), "waited for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
