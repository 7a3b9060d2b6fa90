//! The motion sensor that the driver reads beside the servos: the same cycle, its
//! loss, a bus without it.

mod common;

use common::biped::{BENT, LEG, biped};
use common::can::{BITRATE, MotorKind, can_patient, can_robot};
use common::*;
use servodance_drivers::{
    Bus, BusConfig, ImuConfig, ImuKind, SafeBus, SafetyConfig, SerialBus, SerialImu, open_bus,
};
use servodance_sim::world::{SharedWorld, WorldOptions, WorldSeat};
use servodance_sim::{SimBus, SimImu, SimOptions, SimServoSpec};
use servodance_types::ImuState;

const JOINTS: usize = 2 * LEG;

fn opencr() -> ImuConfig {
    ImuConfig { mounting_deg: [0.0, 0.0, 180.0], ..ImuConfig::of_kind(ImuKind::Opencr) }
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

/// The biped beside a motion sensor on a serial port of its own, in a world
/// that is pushed; the largest differences of rate and of up after half a second.
fn read_beside_the_bus(kind: ImuKind) -> (f64, f64, f64) {
    let servos = robot(JOINTS as u8);
    let specs = specs(&servos).into_iter().zip(BENT);
    let specs: Vec<SimServoSpec> =
        specs.map(|(spec, initial_rad)| SimServoSpec { initial_rad, ..spec }).collect();
    let mechanics: Vec<_> = specs.iter().map(|spec| spec.mechanics().unwrap()).collect();
    let placed = (None, &BENT[..]);
    let world = SharedWorld::new(&biped(), &mechanics, WorldOptions::default(), HZ, placed);
    let world = world.unwrap();
    let seat = Some(WorldSeat::new(world.clone(), (0..JOINTS).collect()));
    let sim = SimBus::start(&specs, SimOptions { seat, ..SimOptions::lockstep(BAUD, HZ) }).unwrap();
    let config = BusConfig { reply_clock: sim.reply_clock(), ..patient() };
    let bus = SerialBus::open(sim.port_path(), &config, servos).unwrap();
    let imu = ImuConfig {
        port: Some("/dev/ttyUSB1".into()),
        mounting_deg: [0.0, 0.0, 90.0],
        ..ImuConfig::of_kind(kind)
    };
    let mut board = SimImu::start(&imu, Some(world.clone())).unwrap();
    let sensor = SerialImu::open(&imu, board.port_path(), HZ).unwrap();
    let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap().with_sensor(Some(sensor));
    let mut states = safe.arm(0.0).unwrap().states;
    let (mut rate_off, mut up_off, mut most_rad): (f64, f64, f64) = (0.0, 0.0, 0.0);
    let mut heard = Vec::new();
    let mut truths: Vec<ImuState> = Vec::new();
    for cycle in 0..250 {
        match cycle {
            60 => world.push([0.5, 0.2]),
            150 => board.silence(true),
            200 => board.silence(false),
            _ => {}
        }
        truths.push(world.imu());
        safe.command(f64::from(cycle) * PERIOD_S, &BENT);
        safe.tick(f64::from(cycle) * PERIOD_S, &mut states).unwrap();
        heard.push(safe.imu().is_some());
        if let (Some(read), 50..150) = (safe.imu(), cycle) {
            // A reading is one or two cycles old.
            let then = &truths[truths.len() - 3..];
            let off = |of: fn(&ImuState) -> [f64; 3]| {
                let apart = |[a, b]: [[f64; 3]; 2]| {
                    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
                };
                let most = then.iter().map(|truth| apart([of(&read), of(truth)]));
                most.fold(f64::INFINITY, f64::min)
            };
            rate_off = rate_off.max(off(|state| state.rate_rad_s));
            up_off = up_off.max(off(|state| state.up));
            most_rad = most_rad.max(read.up[2].min(1.0).acos());
        }
        sim.advance(PERIOD_S);
        board.advance(PERIOD_S);
    }
    assert!(heard[20..150].iter().all(|heard| *heard), "{kind:?}");
    assert!(heard[160..200].iter().all(|heard| !heard) && heard[220..].iter().all(|heard| *heard));
    let told = safe.transitions().iter().filter(|event| event.cause.contains("motion sensor"));
    assert_eq!(told.count(), 2, "{kind:?}");
    (rate_off, up_off, most_rad)
}

#[test]
fn sensors_on_a_port_of_their_own_are_read_lost_and_found_again() {
    // The BNO085 tells no rate: it is the turn from one packet to the next.
    for (kind, rate_rad_s) in
        [(ImuKind::Bno055, 0.01), (ImuKind::Witmotion, 0.01), (ImuKind::Bno085, 0.15)]
    {
        let (rate_off, up_off, most_rad) = read_beside_the_bus(kind);
        assert!(rate_off < rate_rad_s && up_off < 5e-3, "{kind:?}: {rate_off}, {up_off}");
        assert!(most_rad > 0.01, "{kind:?}: the push was not felt: {most_rad}");
    }
}

#[test]
fn a_sensor_among_can_motors_is_read_between_their_frames() {
    let motors = can_robot(MotorKind::CubeMars, 2);
    let imu = ImuConfig::of_kind(ImuKind::Witmotion);
    let specs: Vec<SimServoSpec> = motors.iter().map(SimServoSpec::from).collect();
    let options = SimOptions { imu: Some(imu.clone()), ..SimOptions::lockstep(BITRATE, HZ) };
    let sim = SimBus::start(&specs, options).unwrap();
    let config = BusConfig {
        reply_clock: sim.reply_clock(),
        imu: Some(imu),
        control_hz: Some(HZ),
        ..can_patient(MotorKind::CubeMars)
    };
    let bus = open_bus(&sim.port(), &config, motors).unwrap();
    let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap();
    let mut states = safe.arm(0.0).unwrap().states;
    let mut heard = Vec::new();
    for cycle in 0..100 {
        match cycle {
            40 => sim.silence_imu(true),
            70 => sim.silence_imu(false),
            _ => {}
        }
        safe.command(f64::from(cycle) * PERIOD_S, &[0.0; 2]);
        safe.tick(f64::from(cycle) * PERIOD_S, &mut states).unwrap();
        heard.push(safe.imu());
        sim.advance(PERIOD_S);
    }
    assert!(heard[5..40].iter().all(|read| read.is_some_and(|read| read.up == [0.0, 0.0, 1.0])));
    assert!(heard[55..70].iter().all(Option::is_none));
    assert!(heard[75..].iter().all(Option::is_some));
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
}
