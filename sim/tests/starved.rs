//! In simulated time a reply is lost if the simulation lost it, and never
//! because the machine was busy: the simulated servos are kept from answering
//! for longer than any reply timeout, and a reply that was dropped is known to
//! be lost although the timeout is a minute.

mod common;

use common::can::{MotorKind, can_patient, can_robot};
use common::*;
use servodance_drivers::can::CanBus;
use servodance_drivers::{Bus, BusConfig, BusError, ReplyClock, Servo};
use servodance_sim::{SimBus, SimOptions, WireFault};
use servodance_types::JointState;

const JOINTS: u8 = 3;
/// Longer than the reply timeout.
const STARVED: WireFault = WireFault::Late(0.02);

/// A bus of servos in lockstep that waits `reply_timeout_ms` for a reply, by
/// the clock of the simulation or by the wall's.
fn serial(reply_timeout_ms: f64, by_the_wall: bool) -> (Vec<Servo>, SimBus, Box<dyn Bus>) {
    let servos = robot(JOINTS);
    let sim = lockstep(&servos);
    let config = config_of(patient(), &sim, reply_timeout_ms, by_the_wall);
    let bus = driver(&sim, &config, &servos);
    (servos, sim, Box::new(bus))
}

/// The same of motors on CAN.
fn can(reply_timeout_ms: f64, by_the_wall: bool) -> (Vec<Servo>, SimBus, Box<dyn Bus>) {
    let servos = can_robot(MotorKind::Damiao, JOINTS);
    let sim = SimBus::start(&specs(&servos), SimOptions::lockstep(1_000_000, HZ)).unwrap();
    let config = can_patient(MotorKind::Damiao);
    let config = config_of(config, &sim, reply_timeout_ms, by_the_wall);
    let bus = CanBus::open(&sim.port().to_string(), &config, servos.clone()).unwrap();
    (servos, sim, Box::new(bus))
}

fn config_of(
    config: BusConfig,
    sim: &SimBus,
    reply_timeout_ms: f64,
    by_the_wall: bool,
) -> BusConfig {
    BusConfig {
        reply_timeout_ms,
        reply_clock: match by_the_wall {
            true => ReplyClock::Wall,
            false => sim.reply_clock(),
        },
        retries: 0,
        ..config
    }
}

/// Ten cycles while every reply is kept back.
fn starved(sim: &SimBus, bus: &mut dyn Bus) -> Result<(), BusError> {
    let mut states = vec![JointState::default(); JOINTS.into()];
    let targets = vec![0.0; JOINTS.into()];
    sim.set_wire_fault(Some((STARVED, 1.0)));
    for _ in 0..10 {
        bus.cycle(&targets, &mut states)?;
        sim.advance(PERIOD_S);
    }
    assert!(sim.wire_fault_hits() >= 10, "{}", sim.wire_fault_hits());
    sim.set_wire_fault(None);
    Ok(())
}

#[test]
fn replies_that_a_busy_machine_keeps_back_are_not_lost() {
    for make in [serial, can] {
        let (_, sim, mut bus) = make(1.0, false);
        bus.arm().unwrap();
        starved(&sim, &mut *bus).unwrap();
        assert_eq!(bus.stats().timeouts, 0);
        bus.disarm().unwrap();
    }
}

/// So that the test above can fail.
#[test]
fn by_the_clock_on_the_wall_they_are() {
    let (_, sim, mut bus) = serial(1000.0, true);
    bus.arm().unwrap();
    drop(bus);
    let servos = robot(JOINTS);
    let config = config_of(patient(), &sim, 1.0, true);
    let mut hasty = driver(&sim, &config, &servos);
    sim.set_wire_fault(Some((STARVED, 1.0)));
    let error = hasty.observe().unwrap_err();
    assert!(matches!(error, BusError::Silent { .. }), "{error}");
}

#[test]
fn a_reply_that_was_dropped_is_known_to_be_lost_at_once() {
    for make in [serial, can] {
        let (servos, sim, mut bus) = make(60_000.0, false);
        bus.arm().unwrap();
        sim.set_wire_fault(Some((WireFault::Drop, 1.0)));
        let mut states = vec![JointState::default(); JOINTS.into()];
        // A serial bus rides a tenth of a second out.
        let mut errors = (0..40).filter_map(|_| {
            let error = bus.cycle(&[0.0; JOINTS as usize], &mut states).err();
            sim.advance(PERIOD_S);
            error
        });
        let error = errors.next();
        assert!(matches!(error, Some(BusError::Silent { .. })), "{error:?}");
        drop(errors);
        sim.set_wire_fault(None);
        bus.disarm().unwrap();
        assert!(!any_torque(&sim, &servos));
    }
}
