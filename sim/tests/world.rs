//! A robot's body in the simulated world: dropped, standing, pushed, toppled; the
//! same bits twice.

mod common;

use common::biped::{BENT, KNEES, LEG, biped};
use servodance_sim::world::{JointDrive, JointMechanics, Push, RootSupport, World, WorldOptions};
use servodance_types::Placement;

const MECHANICS: JointMechanics =
    JointMechanics { armature_kg_m2: 0.01, friction_nm: 0.03, play_rad: 0.0 };

fn world(options: WorldOptions) -> World {
    let mut world = World::new(&biped(), &[MECHANICS; 2 * LEG], options).unwrap();
    world.place(None, &BENT);
    world
}

/// Servos that hold the bent pose for so many seconds.
fn hold(world: &mut World, seconds: f64) {
    for _ in 0..(seconds / world.dt_s()).round() as usize {
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

fn upright(world: &World) -> f64 {
    world.root().rotation[2][2]
}

#[test]
fn a_dropped_robot_lands_on_its_feet_and_each_carries_half() {
    let mut world = world(WorldOptions::default());
    let Placement { rotation, at_m: [x, y, z] } = world.root();
    world.place(Some(&Placement { rotation, at_m: [x, y, z + 0.03] }), &BENT);
    world.step(&[JointDrive::default(); 2 * LEG]);
    assert_eq!(world.foot_force_n(), [0.0; 2], "in the air");
    hold(&mut world, 3.0);
    let half_n = world.mass_kg() * 9.81 / 2.0;
    for force_n in world.foot_force_n() {
        assert!((force_n / half_n - 1.0).abs() < 0.05, "{force_n} N of {half_n}");
    }
    assert!(upright(&world) > 0.99 && !world.lies(), "{}", upright(&world));
    assert!((world.root().at_m[2] - z).abs() < 0.02, "{} of {z}", world.root().at_m[2]);
}

/// As descriptions exported from drawings have it.
#[test]
fn a_root_link_whose_origin_is_below_the_floor_has_not_fallen() {
    let below_m = world(WorldOptions::default()).root().at_m[2] + 0.05;
    let mut links = biped();
    links[0].com_m[2] += below_m;
    links[0].touch.iter_mut().for_each(|point| point.at_m[2] += below_m);
    for link in links.iter_mut().filter(|link| link.parent == Some(0)) {
        link.origin.at_m[2] += below_m;
    }
    let mut world = World::new(&links, &[MECHANICS; 2 * LEG], WorldOptions::default()).unwrap();
    world.place(None, &BENT);
    hold(&mut world, 1.0);
    assert!(world.root().at_m[2] < 0.0 && !world.has_fallen());
    for _ in 0..1000 {
        world.step(&[JointDrive::default(); 2 * LEG]);
    }
    assert!(world.has_fallen(), "{:?}", world.centre_of_mass());
}

#[test]
fn a_light_push_is_stood_and_a_hard_one_topples() {
    let after = |force_n: f64| {
        let mut world = world(WorldOptions::default());
        hold(&mut world, 1.0);
        push(&mut world, [force_n, 0.0, 0.0]);
        hold(&mut world, 3.0);
        (upright(&world), world.lies())
    };
    let (stood, lies) = after(6.0);
    assert!(stood > 0.99 && !lies, "{stood}");
    let (fell, lies) = after(100.0);
    assert!(fell < 0.6 && lies, "{fell}");
}

#[test]
fn in_a_hand_the_feet_carry_nothing_and_set_down_the_robot_stands() {
    let mut world = world(WorldOptions::default());
    hold(&mut world, 1.0);
    let [_, _, z] = world.root().at_m;
    world.carry(Some(0.2));
    hold(&mut world, 0.5);
    world.carry(Some(0.0));
    hold(&mut world, 0.5);
    assert!((world.root().at_m[2] - z - 0.1).abs() < 1e-3, "{:?}", world.root());
    assert_eq!(world.foot_force_n(), [0.0; 2]);
    let weight_n = world.mass_kg() * 9.81;
    world.carry(Some(-0.05));
    while world.foot_force_n().iter().sum::<f64>() < 0.5 * weight_n {
        hold(&mut world, 2e-3);
    }
    world.carry(None);
    hold(&mut world, 2.0);
    assert!(upright(&world) > 0.99 && !world.lies(), "{}", upright(&world));
    let carried_n: f64 = world.foot_force_n().iter().sum();
    assert!((carried_n / weight_n - 1.0).abs() < 0.02, "{carried_n} N of {weight_n}");
}

#[test]
fn without_torque_the_knees_give_way() {
    let mut world = world(WorldOptions::default());
    let height_m = world.root().at_m[2];
    for _ in 0..1000 {
        world.step(&[JointDrive::default(); 2 * LEG]);
    }
    assert!(world.root().at_m[2] < 0.7 * height_m, "{}", world.root().at_m[2]);
}

#[test]
fn on_a_stand_the_root_stays_and_the_legs_swing() {
    let mut world = world(WorldOptions { support: RootSupport::Held, ..WorldOptions::default() });
    let Placement { rotation, at_m: [x, y, z] } = world.root();
    let root = Placement { rotation, at_m: [x, y, z + 1.0] };
    world.place(Some(&root), &BENT);
    for _ in 0..2000 {
        world.step(&[JointDrive::default(); 2 * LEG]);
    }
    assert_eq!(world.root(), root);
    assert!(KNEES.iter().all(|&knee| (world.joint(knee).0 - BENT[knee]).abs() > 0.1));
    assert_eq!(world.foot_force_n(), [0.0; 2]);
}

#[test]
fn half_a_degree_of_play_lets_the_robot_stand_and_no_joint_leaves_it() {
    let play_rad = 0.5_f64.to_radians();
    let mechanics = JointMechanics { play_rad, ..MECHANICS };
    let mut loose = World::new(&biped(), &[mechanics; 2 * LEG], WorldOptions::default()).unwrap();
    loose.place(None, &BENT);
    let mut tight = world(WorldOptions::default());
    hold(&mut loose, 3.0);
    hold(&mut tight, 3.0);
    assert!(upright(&loose) > 0.99 && !loose.lies(), "{}", upright(&loose));
    let apart = |joint| (loose.joint(joint).0 - tight.joint(joint).0).abs();
    let farthest = (0..2 * LEG).map(apart).fold(0.0, f64::max);
    assert!(farthest > 1e-4 && farthest < 3.0 * play_rad, "{farthest} rad");
}
