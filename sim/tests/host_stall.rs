//! A host that is kept from running: the servos' own watchdogs stop them, and the safety
//! layer knows it in its first cycle afterwards, in simulated time, for every family.

mod common;

use common::can::{KINDS, MotorKind, can_patient, can_robot};
use common::*;
use servodance_drivers::{
    Bus, BusConfig, BusKind, SafeBus, SafetyConfig, SafetyError, Servo, State, open_bus,
};
use servodance_sim::{ServoFault, SimBus, SimOptions};
use servodance_types::JointState;

struct Rig {
    // Dropped before the servos, so that torque off reaches them.
    safe: SafeBus<Box<dyn Bus>>,
    sim: SimBus,
    servos: Vec<Servo>,
    states: Vec<JointState>,
    now_s: f64,
}

const JOINTS: u8 = 5;

fn rig_of(config: BusConfig, servos: Vec<Servo>, safety: SafetyConfig) -> Rig {
    let options = SimOptions::lockstep(config.baud, HZ);
    let sim = SimBus::start(&specs(&servos), options).unwrap();
    let config = BusConfig { reply_clock: sim.reply_clock(), ..config };
    let bus = open_bus(&sim.port(), &config, servos.clone()).unwrap();
    let mut safe = SafeBus::new(bus, safety).unwrap();
    safe.arm(0.0).unwrap();
    Rig { states: vec![JointState::default(); servos.len()], safe, sim, servos, now_s: 0.0 }
}

fn rig(resume_s: f64) -> Rig {
    let safety = SafetyConfig { resume_s, ..SafetyConfig::at_hz(HZ) };
    rig_of(patient(), robot(JOINTS), safety)
}

impl Rig {
    fn cycle(&mut self) -> Result<State, SafetyError> {
        let target = 0.5 * (1.0 - (3.0 * self.now_s).cos());
        self.safe.command(self.now_s, &vec![target; self.servos.len()]);
        let state = self.safe.tick(self.now_s, &mut self.states);
        self.now_s += PERIOD_S;
        self.sim.advance(PERIOD_S);
        state
    }

    fn dance(&mut self, seconds: f64) -> Result<State, SafetyError> {
        let cycles = (seconds * HZ).round() as usize;
        (0..cycles).try_fold(self.safe.state(), |_, _| self.cycle())
    }

    /// The servos' time goes on; the host does nothing, and its cycle count stands still.
    fn stall(&self, seconds: f64) {
        self.sim.advance(seconds);
    }

    fn told(&self, what: &str) -> bool {
        self.safe.transitions().iter().any(|event| event.cause.contains(what))
    }

    fn tripped(&self) -> usize {
        (0..self.servos.len()).filter(|&i| self.sim.servo(i).unwrap().watchdog_tripped).count()
    }

    fn least_followed(&self) -> f64 {
        self.safe.followed().into_iter().fold(1.0, f64::min)
    }
}

#[test]
fn a_stall_is_known_in_the_first_cycle_and_the_servos_follow_again() {
    let mut rig = rig(1.0);
    rig.dance(3.0).unwrap();
    rig.stall(0.5);
    assert_eq!(rig.tripped(), usize::from(JOINTS));
    rig.cycle().unwrap();
    assert!(
        rig.told("stopped by their own watchdog (nothing was sent for 0.5"),
        "{:?}",
        rig.safe.transitions()
    );
    assert_eq!(rig.tripped(), 0);
    assert_eq!(rig.dance(6.0).unwrap(), State::Running);
    let apart = (rig.states[0].position_rad - rig.sim.servo(1).unwrap().position_rad).abs();
    assert!(apart < 0.05, "{apart}");
    assert!((0..5).all(|i| rig.sim.servo(i).unwrap().torque_enabled));
    assert!(rig.least_followed() > 0.99, "{:?}", rig.safe.followed());
    assert_eq!(rig.sim.violations().total(), 0, "{:?}", rig.sim.violation_notes());
    // The watchdogs are armed again.
    rig.stall(0.5);
    assert_eq!(rig.tripped(), usize::from(JOINTS));
}

#[test]
fn a_longer_stall_ends_in_torque_off_and_an_error() {
    for (resume_s, stall_s) in [(1.0, 5.0), (0.0, 0.5)] {
        let mut rig = rig(resume_s);
        rig.dance(3.0).unwrap();
        rig.stall(stall_s);
        let error = rig.cycle().unwrap_err().to_string();
        assert!(error.contains("stopped by their own watchdog"), "{error}");
        assert!(error.ends_with("torque is off"), "{error}");
        assert!(!any_torque(&rig.sim, &rig.servos));
    }
}

#[test]
fn a_host_that_stalls_again_and_again_is_not_trusted() {
    let mut rig = rig(1.0);
    let stalled = (0..6).try_for_each(|_| {
        rig.dance(1.0)?;
        rig.stall(0.3);
        rig.cycle().map(drop)
    });
    let error = stalled.unwrap_err().to_string();
    assert!(error.contains("stopped by their own watchdog"), "{error}");
    assert!(rig.now_s > 3.0, "three times are ridden out");
    assert!(!any_torque(&rig.sim, &rig.servos));
}

#[test]
fn one_servo_that_stopped_unseen_is_found_by_standing_still() {
    let mut rig = rig(1.0);
    rig.dance(2.6).unwrap(); // in full swing
    assert!(rig.sim.set_servo_fault(2, ServoFault::Trip));
    let stopped_s = rig.now_s;
    while !rig.told("joint_3 (id 3) stopped by their own watchdog") {
        rig.cycle().unwrap();
        assert!(rig.now_s - stopped_s < 0.5, "{:?}", rig.safe.transitions());
    }
    assert!(rig.now_s - stopped_s < 0.2, "after {} s", rig.now_s - stopped_s);
    rig.dance(4.0).unwrap();
    let apart = (rig.states[2].position_rad - rig.states[1].position_rad).abs();
    assert!(apart < 0.05, "{apart}");
    assert_eq!(rig.sim.violations().total(), 0, "{:?}", rig.sim.violation_notes());
}

#[test]
fn every_family_with_a_watchdog_knows_of_a_stall_within_five_cycles() {
    let tells = |kind: &MotorKind| kind.has_watchdog() && *kind != MotorKind::Myactuator;
    for kind in KINDS.into_iter().filter(tells) {
        for stall_s in [0.5, 5.0] {
            let servos = can_robot(kind, 3);
            let mut rig = rig_of(can_patient(kind), servos, SafetyConfig::at_hz(HZ));
            rig.dance(3.0).unwrap();
            rig.stall(stall_s);
            let stalled = rig.dance(0.05);
            let error = stalled.map(|state| format!("{kind:?}: nothing noticed, {state:?}"));
            let error = error.unwrap_err().to_string();
            assert!(error.contains("joint_"), "{kind:?}: {error}");
            assert!(!any_torque(&rig.sim, &rig.servos), "{kind:?}: {error}");
        }
    }
}

#[test]
fn motors_that_would_go_on_as_if_nothing_had_been_are_taken_on_again_or_stopped() {
    for (stall_s, goes_on) in [(0.5, true), (5.0, false)] {
        let servos = can_robot(MotorKind::Myactuator, 3);
        let mut rig = rig_of(can_patient(MotorKind::Myactuator), servos, SafetyConfig::at_hz(HZ));
        rig.dance(3.0).unwrap();
        rig.stall(stall_s);
        assert_eq!(rig.tripped(), 3);
        let went_on = rig.dance(3.0);
        assert!(rig.told("stopped by their own watchdog (nothing was sent for"));
        assert_eq!(went_on.is_ok(), goes_on, "{went_on:?}");
        assert_eq!(any_torque(&rig.sim, &rig.servos), goes_on);
        assert_eq!(rig.sim.violations().total(), 0, "{:?}", rig.sim.violation_notes());
    }
}

#[test]
fn those_without_a_watchdog_hold_their_last_goal_and_go_on_from_there() {
    let can = [MotorKind::CubeMars, MotorKind::RobstrideMit];
    let can = can.map(|kind| (can_patient(kind), can_robot(kind, 3)));
    let serial = [
        (patient_of(BusKind::Feetech, 1_000_000), robot_of("STS3215", 3)),
        (patient_of(BusKind::Dynamixel1, 1_000_000), robot_of("MX-28(1.0)", 3)),
    ];
    for (config, servos) in can.into_iter().chain(serial) {
        for stall_s in [0.5, 5.0] {
            let mut rig = rig_of(config.clone(), servos.clone(), SafetyConfig::at_hz(HZ));
            rig.dance(3.0).unwrap();
            rig.stall(stall_s);
            assert_eq!(rig.dance(2.0).unwrap(), State::Running, "{:?}", config.kind);
            let notes = rig.sim.violation_notes();
            assert_eq!(rig.sim.violations().total(), 0, "{:?}: {notes:?}", config.kind);
            assert!(any_torque(&rig.sim, &rig.servos));
        }
    }
}
