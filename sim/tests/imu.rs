//! The motion sensor that the driver reads beside the servos: the same cycle, its
//! loss, a bus without it.

mod common;

use common::biped::{BENT, LEG, biped};
use common::*;
use servodance_drivers::{
    Bus, BusConfig, ImuConfig, ImuKind, SafeBus, SafetyConfig, SerialBus, open_bus,
};
use servodance_sim::world::{SharedWorld, WorldOptions, WorldSeat};
use servodance_sim::{SimBus, SimOptions, SimServoSpec};

const JOINTS: usize = 2 * LEG;

fn opencr() -> ImuConfig {
    ImuConfig { kind: ImuKind::Opencr, id: 200, bus: None, mounting_deg: [0.0, 0.0, 180.0] }
}

fn configured(sim: &SimBus) -> BusConfig {
    let (imu, control_hz) = (Some(opencr()), Some(HZ));
    BusConfig { reply_clock: sim.reply_clock(), imu, control_hz, ..patient() }
}

#[test]
fn a_lean_is_read_with_the_servos() {
    let servos = robot(JOINTS as u8);
    let specs = specs(&servos).into_iter().zip(BENT);
    let specs: Vec<SimServoSpec> =
        specs.map(|(spec, initial_rad)| SimServoSpec { initial_rad, ..spec }).collect();
    let mechanics: Vec<_> = specs.iter().map(|spec| spec.mechanics().unwrap()).collect();
    let placed = (None, &BENT[..]);
    let options = WorldOptions::default();
    let world = SharedWorld::new(&biped(), &mechanics, options, HZ, placed).unwrap();
    let options = SimOptions {
        seat: Some(WorldSeat::new(world.clone(), (0..JOINTS).collect())),
        imu: Some(opencr()),
        ..SimOptions::lockstep(BAUD, HZ)
    };
    let sim = SimBus::start(&specs, options).unwrap();
    let bus = SerialBus::open(sim.port_path(), &configured(&sim), servos).unwrap();
    let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap();
    let report = safe.arm(0.0).unwrap();
    assert!(!report.notes.iter().any(|note| note.contains("motion sensor")), "{:?}", report.notes);
    let mut states = report.states;
    let mut most_rad: f64 = 0.0;
    for cycle in 0..150 {
        if cycle == 60 {
            world.push([0.5, 0.2]);
        }
        safe.command(f64::from(cycle) * PERIOD_S, &BENT);
        let truth = world.imu();
        safe.tick(f64::from(cycle) * PERIOD_S, &mut states).unwrap();
        let read = safe.imu().unwrap();
        for axis in 0..3 {
            let off = (read.rate_rad_s[axis] - truth.rate_rad_s[axis]).abs();
            assert!(off < 2e-3, "{read:?}, {truth:?}");
            assert!((read.up[axis] - truth.up[axis]).abs() < 2e-3, "{read:?}, {truth:?}");
        }
        most_rad = most_rad.max(read.up[2].min(1.0).acos());
        sim.advance(PERIOD_S);
    }
    assert!(most_rad > 0.01, "the push was not felt: {most_rad}");
}

#[test]
fn a_silent_sensor_is_lost_after_100_ms_and_told_once() {
    let servos = robot(3);
    let options = SimOptions { imu: Some(opencr()), ..SimOptions::lockstep(BAUD, HZ) };
    let sim = SimBus::start(&specs(&servos), options).unwrap();
    let bus = SerialBus::open(sim.port_path(), &configured(&sim), servos).unwrap();
    let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap();
    let mut states = safe.arm(0.0).unwrap().states;
    let mut heard = Vec::new();
    for cycle in 0..200 {
        match cycle {
            20 => sim.silence_imu(true),
            100 => sim.silence_imu(false),
            _ => {}
        }
        safe.command(f64::from(cycle) * PERIOD_S, &[0.0; 3]);
        safe.tick(f64::from(cycle) * PERIOD_S, &mut states).unwrap();
        heard.push(safe.imu().is_some());
        sim.advance(PERIOD_S);
    }
    assert!(heard[..29].iter().all(|heard| *heard), "a lost answer or two change nothing");
    assert!(heard[30..100].iter().all(|heard| !heard));
    assert!(heard[155..].iter().all(|heard| *heard), "asked again twice a second");
    let told = safe.transitions().iter().filter(|event| event.cause.contains("motion sensor"));
    assert_eq!(told.count(), 2);
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
}

#[test]
fn a_bus_without_the_board_says_so_before_torque() {
    let servos = robot(2);
    let sim = lockstep(&servos);
    let mut bus = open_bus(&sim.port(), &configured(&sim), servos).unwrap();
    let notes = bus.arm().unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("id 200) does not answer")), "{notes:?}");
    assert_eq!(bus.imu(), None);
}
