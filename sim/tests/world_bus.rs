//! Servos on a simulated bus that carry a robot's body.

mod common;

use common::biped::{BENT, KNEES, LEG, biped};
use common::*;
use servodance_drivers::{BusConfig, SafeBus, SafetyConfig, SerialBus, Servo};
use servodance_sim::world::{RootSupport, SharedWorld, WorldOptions, WorldSeat};
use servodance_sim::{ServoFault, SimBus, SimOptions, SimServoSpec, happen, parse_script};
use servodance_types::JointState;

const JOINTS: usize = 2 * LEG;

/// The biped's servos as one robot that stands bent in a world, on buses that have these joints.
struct Rig {
    world: SharedWorld,
    buses: Vec<Leg>,
    cycle: u64,
}

/// One bus with the layer above it and the servos below it.
struct Leg {
    // Dropped before the servos, so that torque off reaches them.
    safe: SafeBus<SerialBus>,
    sim: SimBus,
    joints: Vec<usize>,
    states: Vec<JointState>,
}

fn standing_specs(servos: &[Servo]) -> Vec<SimServoSpec> {
    let specs = specs(servos).into_iter().zip(BENT);
    specs.map(|(spec, initial_rad)| SimServoSpec { initial_rad, ..spec }).collect()
}

fn rig(support: RootSupport, joints: &[std::ops::Range<usize>]) -> Rig {
    let servos = robot(JOINTS as u8);
    let specs = standing_specs(&servos);
    let mechanics: Vec<_> = specs.iter().map(|spec| spec.mechanics().unwrap()).collect();
    let options = WorldOptions { support, ..WorldOptions::default() };
    let world = SharedWorld::new(&biped(), &mechanics, options, HZ, (None, &BENT)).unwrap();
    let leg = |range: &std::ops::Range<usize>| {
        let joints: Vec<usize> = range.clone().collect();
        let options = SimOptions {
            seat: Some(WorldSeat::new(world.clone(), joints.clone())),
            ..SimOptions::lockstep(BAUD, HZ)
        };
        let sim = SimBus::start(&specs[range.clone()], options).unwrap();
        let config = BusConfig { reply_clock: sim.reply_clock(), ..patient() };
        let bus = SerialBus::open(sim.port_path(), &config, servos[range.clone()].to_vec());
        let mut safe = SafeBus::new(bus.unwrap(), SafetyConfig::at_hz(HZ)).unwrap();
        let states = safe.arm(0.0).unwrap().states;
        Leg { safe, sim, joints, states }
    };
    let buses: Vec<Leg> = joints.iter().map(leg).collect();
    Rig { world, buses, cycle: 0 }
}

impl Rig {
    /// Holds the bent pose, moved by `add` radians in the knees, for so many seconds.
    fn hold(&mut self, seconds: f64, add: f64) {
        for _ in 0..(seconds * HZ).round() as u64 {
            let now_s = self.cycle as f64 * PERIOD_S;
            for leg in &mut self.buses {
                let targets = leg
                    .joints
                    .iter()
                    .map(|&joint| BENT[joint] + if KNEES.contains(&joint) { add } else { 0.0 });
                let targets: Vec<f64> = targets.collect();
                leg.safe.command(now_s, &targets);
                leg.safe.tick(now_s, &mut leg.states).unwrap();
            }
            let slices = (PERIOD_S / self.world.step_s()).round() as u64;
            for _ in 0..slices {
                for leg in &self.buses {
                    leg.sim.advance(PERIOD_S / slices as f64);
                }
            }
            self.cycle += 1;
        }
    }

    /// True position and current of a joint.
    fn joint(&self, joint: usize) -> (f64, f64) {
        for leg in &self.buses {
            if let Some(place) = leg.joints.iter().position(|own| *own == joint) {
                let state = leg.sim.servo(place).unwrap();
                return (state.position_rad, state.current_a);
            }
        }
        panic!("no joint {joint}");
    }
}

fn one_bus() -> [std::ops::Range<usize>; 1] {
    std::array::from_fn(|_| 0..JOINTS)
}

#[test]
fn servos_hold_a_robot_up_and_the_knees_pay_for_it() {
    let mut rig = rig(RootSupport::Free, &one_bus());
    rig.hold(3.0, 0.0);
    let figures = rig.world.figures();
    assert!(!figures.fell && figures.load_share.iter().all(|share| *share > 0.95), "{figures:?}");
    assert!(figures.tilt_rms_rad < 0.05, "{figures:?}");
    for knee in KNEES {
        let (position, current_a) = rig.joint(knee);
        assert!((position - BENT[knee]).abs() < 0.1, "{position}");
        // It sags, and pushes against that: towards straight.
        assert!(position > BENT[knee] && current_a < -0.05, "{position} {current_a}");
    }
    // What the bus says is what the world does.
    for (&joint, said) in rig.buses[0].joints.iter().zip(&rig.buses[0].states) {
        let (position, _) = rig.joint(joint);
        assert!((said.position_rad - position).abs() < 2e-3, "joint {joint}");
    }
}

#[test]
fn two_buses_share_one_world_and_a_run_can_be_repeated() {
    let legs = [0..LEG, LEG..JOINTS];
    let run = || {
        let mut rig = rig(RootSupport::Free, &legs);
        rig.hold(1.0, 0.0);
        rig.hold(1.0, 0.1);
        let positions: Vec<u64> = (0..JOINTS).map(|joint| rig.joint(joint).0.to_bits()).collect();
        assert!(!rig.world.figures().fell);
        assert!((rig.world.figures().seconds - 2.0).abs() < 0.02, "{:?}", rig.world.figures());
        (positions, rig.world.root())
    };
    assert_eq!(run(), run());
}

#[test]
fn a_push_by_script_topples_and_true_motion_is_not_blamed() {
    let mut rig = rig(RootSupport::Free, &one_bus());
    rig.hold(1.0, 0.0);
    let cue = &parse_script("1s push 1 0 6", &[]).unwrap()[0];
    let before = rig.buses[0].sim.motion_violations();
    let sims = std::slice::from_mut(&mut rig.buses[0].sim);
    happen(&cue.what, sims, &[Vec::new()]).unwrap();
    rig.hold(0.05, 0.0);
    assert_eq!(rig.buses[0].sim.motion_violations(), before);
    rig.hold(2.0, 0.0);
    assert!(rig.world.fell());
    assert!(rig.world.imu().up[2] < 0.7, "{:?}", rig.world.imu());
    let fallen = rig.world.figures();
    rig.hold(0.5, 0.0);
    assert_eq!(rig.world.figures(), fallen, "what comes after the fall is not counted");
}

#[test]
fn a_hand_holds_the_robot_until_every_servo_has_torque() {
    let servos = robot(JOINTS as u8);
    let specs = standing_specs(&servos);
    let mechanics: Vec<_> = specs.iter().map(|spec| spec.mechanics().unwrap()).collect();
    let world = SharedWorld::new(&biped(), &mechanics, WorldOptions::default(), HZ, (None, &BENT));
    let world = world.unwrap();
    let seat = Some(WorldSeat::new(world.clone(), (0..JOINTS).collect()));
    let sim = SimBus::start(&specs, SimOptions { seat, ..SimOptions::lockstep(BAUD, HZ) }).unwrap();
    let root = world.root();
    sim.advance(1.0);
    assert_eq!(world.root(), root);
    let imu = world.imu();
    assert!((imu.force_m_s2[2] - 9.81).abs() < 1e-9 && imu.up == [0.0, 0.0, 1.0], "{imu:?}");
    // By hand a limp joint goes where it is put.
    assert!(sim.set_servo_fault(KNEES[0], ServoFault::Moved(0.2)));
    sim.advance(0.1);
    assert!((sim.servo(KNEES[0]).unwrap().position_rad - 0.2).abs() < 1e-9);
}

#[test]
fn a_jammed_joint_stays_where_it_is() {
    let mut rig = rig(RootSupport::Held, &one_bus());
    rig.hold(0.5, 0.0);
    let before = rig.joint(KNEES[0]).0;
    assert!(rig.buses[0].sim.set_servo_fault(KNEES[0], ServoFault::Jam));
    rig.hold(0.8, 0.15);
    assert!((rig.joint(KNEES[0]).0 - before).abs() < 1e-3);
    assert!((rig.joint(KNEES[1]).0 - before).abs() > 0.05);
}
