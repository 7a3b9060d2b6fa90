//! Several buses in parallel, judged by the simulated servos of each.

mod common;

use common::*;
use servodance_drivers::{
    Bus, BusConfig, BusKind, BusLayout, SafeBus, SafetyConfig, SafetyError, Servo, layouts,
    open_buses,
};
use servodance_sim::{ServoFault, SimBus, SimOptions};
use servodance_types::JointState;

/// A Dynamixel and a Feetech bus whose joints alternate, ids repeating.
struct Rig {
    // Dropped before the servos, so that torque off reaches them.
    safe: SafeBus<Box<dyn Bus>>,
    sims: Vec<SimBus>,
    layouts: Vec<BusLayout>,
    servos: Vec<Servo>,
    states: Vec<JointState>,
    now_s: f64,
}

fn rig() -> Rig {
    let config = |name: &str, kind, baud| BusConfig {
        name: name.into(),
        retries: 1,
        accept_no_watchdog: true,
        ..BusConfig::of_kind(kind, baud)
    };
    let buses = vec![
        config("left", BusKind::Dynamixel2, BAUD),
        config("right", BusKind::Feetech, 1_000_000),
    ];
    let mut joints = Vec::new();
    for id in 1..=3 {
        for (bus, model) in [("left", "XM430-W350"), ("right", "STS3215")] {
            let mut joint = joint_of(model, id);
            joint.name = format!("{bus}_{id}");
            joint.bus = Some(bus.into());
            joints.push(joint);
        }
    }
    let (servos, mut layouts) = layouts(buses, &joints).unwrap();
    let sims: Vec<SimBus> = layouts
        .iter_mut()
        .map(|bus| {
            let options = SimOptions::lockstep(bus.config.baud, HZ);
            let sim = SimBus::start(&specs(&bus.servos), options).unwrap();
            bus.config.reply_clock = sim.reply_clock();
            sim
        })
        .collect();
    let ports: Vec<_> = sims.iter().map(SimBus::port).collect();
    let bus = open_buses(&ports, &layouts, &servos).unwrap();
    Rig {
        safe: SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap(),
        states: vec![JointState::default(); servos.len()],
        sims,
        layouts,
        servos,
        now_s: 0.0,
    }
}

impl Rig {
    fn dance(&mut self, periods: usize) -> Result<(), SafetyError> {
        for _ in 0..periods {
            let targets: Vec<f64> =
                (0..self.servos.len()).map(|joint| 0.1 * (joint + 1) as f64).collect();
            self.safe.command(self.now_s, &targets);
            self.safe.tick(self.now_s, &mut self.states)?;
            self.now_s += PERIOD_S;
            for sim in &self.sims {
                sim.advance(PERIOD_S);
            }
        }
        Ok(())
    }

    fn powered(&self) -> usize {
        let sims = self.sims.iter().zip(&self.layouts);
        sims.map(|(sim, bus)| {
            let servos = 0..bus.servos.len();
            servos.filter(|&servo| sim.servo(servo).unwrap().torque_enabled).count()
        })
        .sum()
    }
}

#[test]
fn states_come_back_in_joint_order_from_buses_of_two_kinds() {
    let mut rig = rig();
    rig.safe.arm(0.0).unwrap();
    assert_eq!(rig.powered(), 6);
    rig.dance(300).unwrap();
    for (joint, state) in rig.states.iter().enumerate() {
        let target = 0.1 * (joint + 1) as f64;
        assert!((state.position_rad - target).abs() < 0.02, "{joint}: {state:?}");
    }
    assert_eq!(rig.safe.stats().cycles, 300);
    for sim in &rig.sims {
        assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
    }
    rig.safe.disarm(rig.now_s, "done").unwrap();
    assert_eq!(rig.powered(), 0);
}

#[test]
fn no_bus_gets_torque_before_every_bus_has_passed_its_checks() {
    let mut rig = rig();
    assert!(rig.sims[1].set_servo_fault(2, ServoFault::Dead));
    let error = rig.safe.arm(0.0).unwrap_err().to_string();
    assert!(error.contains("no answer from right_3 (id 3)"), "{error}");
    assert_eq!(rig.powered(), 0);
    let told = rig.sims[0].servo(0).unwrap();
    assert!(!told.torque_enabled);
}

#[test]
fn a_servo_that_dies_on_one_bus_stops_all_and_is_named() {
    let mut rig = rig();
    rig.safe.arm(0.0).unwrap();
    rig.dance(50).unwrap();
    assert!(rig.sims[1].set_servo_fault(1, ServoFault::Dead));
    let error = rig.dance(50).unwrap_err().to_string();
    assert!(error.contains("no answer from right_2 (id 2)"), "{error}");
    assert_eq!(rig.powered(), 1, "only the one that hears nothing");
}

#[test]
fn an_adapter_pulled_out_of_one_bus_stops_all() {
    let mut rig = rig();
    rig.safe.arm(0.0).unwrap();
    rig.dance(50).unwrap();
    rig.sims[0].unplug();
    let error = rig.dance(50).unwrap_err().to_string();
    assert!(error.starts_with("serial port"), "{error}");
    assert!(error.contains("left_1 (id 1)"), "{error}");
    assert_eq!(rig.powered(), 3, "the left ones hear nothing more");
    assert!(!rig.sims[1].servo(0).unwrap().torque_enabled);
}

#[test]
fn dropping_the_set_turns_every_torque_off() {
    let mut rig = rig();
    rig.safe.arm(0.0).unwrap();
    assert_eq!(rig.powered(), 6);
    let Rig { safe, sims, .. } = rig;
    drop(safe);
    for servo in 0..3 {
        let powered = |sim: &SimBus| sim.servo(servo).unwrap().torque_enabled;
        assert!(!sims.iter().any(powered), "servo {servo}");
    }
}
