//! The world's bits: the same twice, and the same on every processor. On another one:
//! docs/measurements/physics.md.

mod common;

use common::biped::{BENT, LEG, biped};
use servodance_sim::world::{JointDrive, JointMechanics, Push, World, WorldOptions};
use servodance_types::Placement;

/// State after each of three seconds: dropped and stood, pushed, toppled.
const KNOWN: [u64; 3] = [0xDAB1_51B5_C20E_A527, 0xFB29_4179_DCF7_38AD, 0x6937_5BBB_8A28_5576];

/// FNV-1a of the state's bits.
fn fingerprint(world: &World) -> u64 {
    let joints = (0..2 * LEG).flat_map(|joint| <[f64; 2]>::from(world.joint(joint)));
    let root = world.root();
    let numbers = joints.chain(root.at_m).chain(root.rotation.into_iter().flatten());
    numbers
        .flat_map(|number| number.to_bits().to_le_bytes())
        .fold(0xCBF2_9CE4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
        })
}

/// A second in which servos hold the bent pose.
fn hold(world: &mut World) {
    for _ in 0..(1.0 / world.dt_s()).round() as usize {
        let drives: Vec<JointDrive> = (0..2 * LEG)
            .map(|joint| {
                let torque_nm = (20.0 * (BENT[joint] - world.joint(joint).0)).clamp(-4.1, 4.1);
                JointDrive { torque_nm, damping_nm_s: 0.85 }
            })
            .collect();
        world.step(&drives);
    }
}

fn push(world: &mut World, force_n: [f64; 3]) {
    let until_s = world.time_s() + 0.05;
    world.push(Push { force_n, until_s });
}

/// Dropped by 30 mm, with play in the gears; pushed lightly; pushed over.
fn run() -> [u64; 3] {
    let mechanics = JointMechanics { armature_kg_m2: 0.01, friction_nm: 0.03, play_rad: 0.004 };
    let mut world = World::new(&biped(), &[mechanics; 2 * LEG], WorldOptions::default()).unwrap();
    world.place(None, &BENT);
    let Placement { rotation, at_m: [x, y, z] } = world.root();
    world.place(Some(&Placement { rotation, at_m: [x, y, z + 0.03] }), &BENT);
    hold(&mut world);
    let stood = fingerprint(&world);
    push(&mut world, [5.0, 3.0, 0.0]);
    hold(&mut world);
    assert!(!world.has_fallen());
    let pushed = fingerprint(&world);
    push(&mut world, [100.0, 40.0, 0.0]);
    hold(&mut world);
    assert!(world.has_fallen() && world.lies());
    [stood, pushed, fingerprint(&world)]
}

#[test]
fn the_same_bits_twice_and_on_every_processor() {
    let bits = run();
    assert_eq!(bits, run());
    assert_eq!(bits, KNOWN, "{bits:#x?}");
}
