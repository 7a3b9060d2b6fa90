//! Simulated servos behind a Unix socket: the same to the byte as behind a
//! pseudo-terminal, for the drivers and for any program that knows sockets.

mod common;

use common::can::{MotorKind, can_patient, can_robot};
use common::*;
use servodance_drivers::can::CanBus;
use servodance_drivers::{Bus, BusConfig, BusError, Servo, encode};
use servodance_sim::{SimBus, SimLink, SimOptions, WireStats};
use servodance_types::JointState;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;

const JOINTS: u8 = 4;

fn start(servos: &[Servo], options: SimOptions, link: SimLink) -> SimBus {
    SimBus::start(&specs(servos), SimOptions { link, ..options }).unwrap()
}

/// A hundred cycles: where the servos are, and what passed over the wire.
fn hundred_cycles(sim: &SimBus, bus: &mut dyn Bus) -> (Vec<JointState>, WireStats) {
    let mut states = bus.arm().unwrap().states;
    for k in 0..100 {
        let target = 0.2 * (0.06 * f64::from(k)).sin();
        bus.cycle(&[target; JOINTS as usize], &mut states).unwrap();
        sim.advance(PERIOD_S);
    }
    bus.disarm().unwrap();
    sim.advance(PERIOD_S);
    (states, sim.wire_stats())
}

#[test]
fn servos_answer_as_behind_a_terminal() {
    let servos = robot(JOINTS);
    let run = |link| {
        let sim = start(&servos, SimOptions::lockstep(BAUD, HZ), link);
        let config = BusConfig { reply_clock: sim.reply_clock(), ..patient() };
        let mut bus = driver(&sim, &config, &servos);
        let seen = hundred_cycles(&sim, &mut bus);
        assert!(!any_torque(&sim, &servos));
        seen
    };
    let (states, wire) = run(SimLink::Unix);
    assert!(states[0].position_rad.abs() > 0.01, "{states:?}");
    assert_eq!((states, wire), run(SimLink::Terminal));
}

#[test]
fn motors_behind_a_serial_adapter_answer_as_behind_a_terminal() {
    let servos = can_robot(MotorKind::Damiao, JOINTS);
    let run = |link| {
        let sim = start(&servos, SimOptions::lockstep(1_000_000, HZ), link);
        let config = BusConfig { reply_clock: sim.reply_clock(), ..can_patient(MotorKind::Damiao) };
        let mut bus = CanBus::open(&sim.port().to_string(), &config, servos.clone()).unwrap();
        hundred_cycles(&sim, &mut bus)
    };
    assert_eq!(run(SimLink::Unix), run(SimLink::Terminal));
}

#[test]
fn pulled_out_it_fails_and_put_back_it_is_at_its_place() {
    let servos = robot(JOINTS);
    let folder = tempfile::tempdir().unwrap();
    let options =
        SimOptions { path: Some(folder.path().join("port")), ..SimOptions::realtime(BAUD, HZ) };
    let mut sim = start(&servos, options, SimLink::Unix);
    let mut bus = driver(&sim, &patient(), &servos);
    let mut states = bus.arm().unwrap().states;
    sim.unplug();
    let targets = [0.0; JOINTS as usize];
    let failed = bus.cycle(&targets, &mut states).unwrap_err();
    assert!(matches!(failed, BusError::Port { .. }), "{failed}");
    assert!(bus.reopen().is_err());
    sim.replug().unwrap();
    bus.reopen().unwrap();
    bus.disarm().unwrap();
    assert!(!any_torque(&sim, &servos));
}

/// A ping and its answer as in the vendor's manual, sent by no driver of ours, in
/// two pieces; a second program meanwhile is hung up on.
#[test]
fn any_program_speaks_to_the_servos() {
    let folder = tempfile::tempdir().unwrap();
    let options =
        SimOptions { path: Some(folder.path().join("port")), ..SimOptions::realtime(BAUD, HZ) };
    let sim = start(&robot(1), options, SimLink::Unix);
    let mut port = UnixStream::connect(sim.port_path()).unwrap();
    let mut ping = Vec::new();
    encode(&mut ping, 1, 0x01, &[]);
    for piece in ping.chunks(4) {
        port.write_all(piece).unwrap();
    }
    let mut answer = [0; 14];
    port.read_exact(&mut answer).unwrap();
    // Header, id 1, length 7, status, no error, model 1020.
    let expected = [0xFF, 0xFF, 0xFD, 0, 1, 7, 0, 0x55, 0, 0xFC, 0x03];
    assert_eq!(answer[..11], expected);
    let mut second = UnixStream::connect(sim.port_path()).unwrap();
    assert_eq!(second.read(&mut answer).unwrap(), 0);
}
