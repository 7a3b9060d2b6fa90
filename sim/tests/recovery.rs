//! Servos and adapters that are lost and come back, and servos that are nearly
//! at their own limits: the safety layer around the driver, judged by the
//! simulated servos.

mod common;

use common::*;
use servodance_drivers::{
    Bus, BusConfig, BusKind, SafeBus, SafetyConfig, SafetyError, Servo, ServoLost, State, open_bus,
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
    _folder: tempfile::TempDir,
}

fn rig(kind: BusKind, change: impl FnOnce(&mut SafetyConfig)) -> Rig {
    let (model, baud) = match kind {
        BusKind::Feetech => ("STS3215", 1_000_000),
        _ => ("XM430-W350", BAUD),
    };
    let servos = robot_of(model, 5);
    let folder = tempfile::tempdir().unwrap();
    let options =
        SimOptions { path: Some(folder.path().join("port")), ..SimOptions::lockstep(baud, HZ) };
    let sim = SimBus::start(&specs(&servos), options).unwrap();
    let config = BusConfig {
        reply_clock: sim.reply_clock(),
        accept_no_watchdog: true,
        ..BusConfig::of_kind(kind, baud)
    };
    let mut safety = SafetyConfig::at_hz(HZ);
    change(&mut safety);
    let bus = open_bus(&sim.port(), &config, servos.clone()).unwrap();
    let mut safe = SafeBus::new(bus, safety).unwrap();
    safe.arm(0.0).unwrap();
    Rig {
        states: vec![JointState::default(); servos.len()],
        safe,
        sim,
        servos,
        now_s: 0.0,
        _folder: folder,
    }
}

impl Rig {
    /// Dances for a while.
    fn dance(&mut self, seconds: f64) -> Result<State, SafetyError> {
        let mut state = self.safe.state();
        for _ in 0..(seconds * HZ).round() as usize {
            let target = 0.5 * (1.0 - (3.0 * self.now_s).cos());
            self.safe.command(self.now_s, &vec![target; self.servos.len()]);
            state = self.safe.tick(self.now_s, &mut self.states)?;
            self.now_s += PERIOD_S;
            self.sim.advance(PERIOD_S);
        }
        Ok(state)
    }

    fn moves(&self, servo: usize) -> bool {
        let before = self.sim.servo(servo).unwrap();
        before.torque_enabled && before.velocity_rad_s.abs() > 0.05
    }

    fn causes(&self) -> Vec<String> {
        let transitions = self.safe.transitions().iter();
        transitions.map(|t| t.cause.clone()).collect()
    }

    fn told(&self, what: &str) -> bool {
        self.causes().iter().any(|cause| cause.contains(what))
    }

    fn clean(&self) {
        let broken = self.sim.violations().total();
        assert_eq!(broken, 0, "{:?}", self.sim.violation_notes());
    }
}

#[test]
fn the_others_dance_on_and_a_rebooted_servo_joins_in_again() {
    for kind in [BusKind::Dynamixel2, BusKind::Feetech] {
        let mut rig = rig(kind, |safety| safety.on_servo_lost = ServoLost::DanceOn);
        rig.dance(3.0).unwrap();
        assert!(rig.sim.set_servo_fault(2, ServoFault::Reboot));
        rig.dance(0.3).unwrap();
        assert!(!rig.sim.servo(2).unwrap().torque_enabled);
        assert!(rig.moves(1), "{kind:?}: the others dance on");
        rig.dance(5.0).unwrap();
        assert!(rig.moves(2), "{kind:?}: {:?}", rig.causes());
        assert!(rig.told("no answer from joint_3 (id 3)"), "{:?}", rig.causes());
        assert!(rig.told("joint_3 (id 3) is back after"), "{:?}", rig.causes());
        assert!(
            (rig.states[2].position_rad - rig.states[1].position_rad).abs() < 0.05,
            "{:?}",
            rig.states
        );
        rig.clean();
    }
}

#[test]
fn a_servo_that_shut_itself_down_is_rebooted_and_joins_in_again() {
    let mut rig = rig(BusKind::Dynamixel2, |safety| {
        safety.on_servo_lost = ServoLost::DanceOn;
    });
    rig.dance(3.0).unwrap();
    assert!(rig.sim.set_servo_fault(4, ServoFault::Overload));
    rig.dance(0.1).unwrap();
    assert!(!rig.sim.servo(4).unwrap().torque_enabled);
    rig.dance(5.0).unwrap();
    assert!(rig.moves(4), "{:?}", rig.causes());
    assert!(rig.told("hardware error: overload"), "{:?}", rig.causes());
    rig.clean();
}

#[test]
fn the_others_hold_until_a_lost_servo_is_back() {
    let mut rig = rig(BusKind::Dynamixel2, |safety| {
        safety.on_servo_lost = ServoLost::Hold;
    });
    rig.dance(3.0).unwrap();
    rig.sim.set_servo_fault(2, ServoFault::Dead);
    assert_eq!(rig.dance(2.0).unwrap(), State::Holding);
    assert!(!rig.moves(1));
    assert!(rig.sim.servo(1).unwrap().torque_enabled);
    rig.sim.set_servo_fault(2, ServoFault::Revive);
    assert_eq!(rig.dance(4.0).unwrap(), State::Running);
    assert!(rig.moves(1) && rig.moves(2), "{:?}", rig.causes());
    rig.clean();
}

#[test]
fn a_servo_that_does_not_come_back_ends_the_hold() {
    let mut rig = rig(BusKind::Dynamixel2, |safety| {
        safety.on_servo_lost = ServoLost::Hold;
        safety.rejoin_s = 1.0;
    });
    rig.dance(2.0).unwrap();
    rig.sim.set_servo_fault(2, ServoFault::Dead);
    let error = rig.dance(3.0).unwrap_err().to_string();
    assert!(error.contains("joint_3 (id 3) did not come back"), "{error}");
    let powered = (0..5).filter(|i| *i != 2 && rig.sim.servo(*i).unwrap().torque_enabled);
    assert_eq!(powered.count(), 0);
}

#[test]
fn losing_more_than_a_quarter_stops_whatever_the_policy() {
    let mut rig = rig(BusKind::Dynamixel2, |safety| {
        safety.on_servo_lost = ServoLost::DanceOn;
    });
    rig.dance(2.0).unwrap();
    rig.sim.set_servo_fault(1, ServoFault::Dead);
    rig.sim.set_servo_fault(2, ServoFault::Dead);
    let error = rig.dance(1.0).unwrap_err().to_string();
    assert!(error.contains("joint_2 (id 2), joint_3 (id 3)"), "{error}");
    assert!(!rig.sim.servo(0).unwrap().torque_enabled);
}

#[test]
fn an_adapter_that_comes_back_is_armed_again_only_if_allowed() {
    let mut rig = rig(BusKind::Dynamixel2, |safety| safety.rearm = true);
    rig.dance(3.0).unwrap();
    rig.sim.unplug();
    assert_eq!(rig.dance(1.0).unwrap(), State::Fault);
    let stopped = |rig: &Rig| (0..5).all(|i| rig.sim.servo(i).unwrap().watchdog_tripped);
    assert!(stopped(&rig), "the servos' own watchdogs stop them");
    rig.sim.replug().unwrap();
    assert_eq!(rig.dance(4.0).unwrap(), State::Running);
    assert!((0..5).all(|i| rig.moves(i)), "{:?}", rig.causes());
    assert!(rig.told("the adapter is back after"), "{:?}", rig.causes());
    rig.clean();

    let mut rig = self::rig(BusKind::Dynamixel2, |_| {});
    rig.dance(2.0).unwrap();
    rig.sim.unplug();
    let error = rig.dance(0.1).unwrap_err().to_string();
    assert!(error.starts_with("serial port"), "{error}");
    rig.sim.replug().unwrap();
    rig.sim.advance(0.5);
    assert!(rig.dance(1.0).is_err(), "not by itself");
    assert!((0..5).all(|i| !rig.moves(i)));
    rig.safe.arm(rig.now_s).unwrap();
    rig.dance(3.0).unwrap();
    assert!(rig.moves(0), "on purpose it may");
}

#[test]
fn an_adapter_that_stays_away_is_an_error_in_the_end() {
    let mut rig = rig(BusKind::Dynamixel2, |safety| {
        safety.rearm = true;
        safety.reconnect_s = 1.0;
    });
    rig.dance(2.0).unwrap();
    rig.sim.unplug();
    let error = rig.dance(3.0).unwrap_err().to_string();
    assert!(error.contains("cannot open"), "{error}");
    assert!(rig.dance(0.1).is_err());
}

#[test]
fn a_hot_servo_moves_less_and_is_stopped_before_it_goes_limp() {
    let mut rig = rig(BusKind::Dynamixel2, |_| {});
    let swing = |rig: &mut Rig, celsius: f64| {
        let (mut low, mut high) = (f64::MAX, f64::MIN);
        for k in 0..500 {
            // Heat as from outside: the winding would cool down by itself.
            rig.sim.set_servo_fault(2, ServoFault::Overheat(celsius));
            rig.dance(PERIOD_S)?;
            if k > 250 {
                let position = rig.sim.servo(2).unwrap().position_rad;
                (low, high) = (low.min(position), high.max(position));
            }
        }
        Ok::<f64, SafetyError>(high - low)
    };
    let full = swing(&mut rig, 40.0).unwrap();
    let less = swing(&mut rig, 72.0).unwrap();
    assert!(less < 0.75 * full, "{less} of {full} rad");
    assert!(rig.told("smaller motion: joint_3 (id 3): temperature is 72.0 C"));
    assert!(rig.safe.interventions().derated > 100);
    rig.clean();
    let error = swing(&mut rig, 78.0).unwrap_err().to_string();
    assert!(
        error.contains("joint_3 (id 3): temperature is 78.0 C, the limit is 77.0 C"),
        "{error}"
    );
    assert_eq!(rig.sim.servo(2).unwrap().hardware_error, 0, "not by itself");
    assert!(!rig.sim.servo(0).unwrap().torque_enabled);
}

#[test]
fn a_weak_supply_makes_every_motion_smaller() {
    let mut rig = rig(BusKind::Dynamixel2, |_| {});
    rig.dance(3.0).unwrap();
    assert_eq!(rig.safe.interventions().derated, 0);
    for servo in 0..5 {
        rig.sim.set_servo_fault(servo, ServoFault::Supply(9.7));
    }
    rig.dance(4.0).unwrap();
    assert!(rig.told("supply is 9.7 V, the limit is 9.5 V"), "{:?}", rig.causes());
    assert!(rig.safe.interventions().derated > 1000);
    rig.clean();
}
