//! A robot on its feet in the simulated world: the firmware of simulated servos carries
//! it, its own motion sensor corrects it.

use servodance_audio::song::{Song, SongSpec};
use servodance_drivers::{ImuConfig, ImuKind};
use servodance_retarget::Stance;
use servodance_runtime::control::bus_choice::BusChoice;
use servodance_runtime::control::getup::GetUp;
use servodance_runtime::pipeline::model_args::EngineArgs;
use servodance_runtime::process::speed::Speed;
use servodance_runtime::robot::{Lying, Robot};
use servodance_runtime::session::dance::open_generator;
use servodance_runtime::session::fault_run::{FaultRun, FaultRunResult};
use servodance_runtime::telemetry::ViolationReport;
use servodance_runtime::world::WorldChoice;
use servodance_sim::parse_script;
use std::sync::atomic::AtomicBool;

fn dance(robot: &str, seconds: f64, faults: &str) -> FaultRunResult {
    dance_of(&Robot::load(robot).unwrap(), seconds, faults)
}

fn dance_of(robot: &Robot, seconds: f64, faults: &str) -> FaultRunResult {
    let generator = open_generator(None, EngineArgs::default()).unwrap();
    let song = SongSpec::random(seconds, 5).and_then(|spec| spec.render()).unwrap();
    let joints: Vec<&str> = robot.servos.iter().map(|servo| servo.name.as_str()).collect();
    let run = FaultRun {
        world: WorldChoice::of_robot(robot),
        faults: parse_script(faults, &joints).unwrap(),
        ..FaultRun::new(robot, &generator, song)
    };
    run.run(&AtomicBool::new(false), |_| ()).unwrap()
}

#[test]
fn built_in_humanoids_dance_without_a_fall() {
    for robot in ["op3", "lite22"] {
        let danced = dance(robot, 20.0, "");
        let body = danced.body.as_ref().expect("a body");
        assert_eq!((&danced.stopped_by, danced.fall_s, body.fell), (&None, None, false), "{robot}");
        assert_eq!(danced.violations, ViolationReport::default(), "{robot}");
        assert!(body.tilt_rms_deg < 8.0 && body.work_j > 1.0, "{robot}: {body:?}");
    }
}

/// Seeds with which `microduck` fell, one after the other, while its head and torso moved as
/// much as they now do not.
#[test]
fn robots_that_stand_dance_the_built_in_song_with_other_seeds_too() {
    let generator = open_generator(None, EngineArgs::default()).unwrap();
    let song = Song::demo();
    let seeds = [2, 14, 7, 9];
    for (name, count) in [("microduck", 4), ("op3", 2), ("lite22", 2), ("g1", 1)] {
        let robot = Robot::load(name).unwrap();
        for &seed in &seeds[..count] {
            let world = WorldChoice::of_robot(&robot);
            let run = FaultRun { world, seed, ..FaultRun::new(&robot, &generator, song.clone()) };
            let danced = run.run(&AtomicBool::new(false), |_| ()).unwrap();
            let body = danced.body.as_ref().expect("a body");
            let stood = (&danced.stopped_by, danced.fall_s, body.fell);
            assert_eq!(stood, (&None, None, false), "{name}, seed {seed}");
            assert_eq!(danced.violations, ViolationReport::default(), "{name}, seed {seed}");
        }
    }
}

#[test]
fn a_fall_is_announced_and_ends_in_torque_off() {
    let fell = dance("op3", 15.0, "8s push 1 0 9");
    let body = fell.body.as_ref().expect("a body");
    let told_s = body.fall_announced_s.expect("announced");
    assert!((8.0..8.5).contains(&told_s), "{body:?}");
    assert!(body.tilt_rms_deg > 3.0 && body.fell_s.is_none_or(|at_s| at_s > told_s), "{body:?}");
    assert!(fell.robot_s < 10.0, "{} s", fell.robot_s);
    assert_eq!((fell.unsafe_joints.len(), fell.violations), (0, ViolationReport::default()));
}

#[test]
fn without_its_sensor_the_robot_dances_on_with_less() {
    let work_j = |faults| {
        let danced = dance("op3", 15.0, faults);
        assert_eq!((&danced.stopped_by, danced.fall_s), (&None, None), "{faults}");
        danced.body.expect("a body").work_j
    };
    let (seeing, blind) = (work_j(""), work_j("2s imu dead"));
    assert!(blind < 0.9 * seeing, "{blind} J of {seeing}");
}

#[test]
fn in_somebodys_hands_the_balance_rests_until_the_robot_stands_again() {
    let danced = dance("op3", 20.0, "8s pick-up 0.15\n12s set-down");
    assert_eq!((&danced.stopped_by, danced.fall_s), (&None, None));
    assert_eq!(danced.violations, ViolationReport::default());
    let told = |what: &str| -> Vec<f64> {
        let events = danced.events.iter().filter(|event| event.cause.contains(what));
        events.map(|event| event.time_s).collect()
    };
    let (held_s, stands_s) = (told("its balance rests"), told("its balance comes back"));
    assert_eq!((held_s.len(), stands_s.len()), (1, 1), "{held_s:?} {stands_s:?}");
    assert!((8.0..9.0).contains(&held_s[0]), "{held_s:?}");
    assert!((14.0..17.0).contains(&stands_s[0]), "{stands_s:?}");
}

#[test]
fn a_sensor_of_another_kind_balances_too_and_its_loss_is_told() {
    for kind in [ImuKind::Bno055, ImuKind::Bno085, ImuKind::Witmotion] {
        let mut robot = Robot::load("op3").unwrap();
        let port = Some("/dev/ttyUSB1".into());
        robot.imu = Some(ImuConfig { port, ..ImuConfig::of_kind(kind) });
        robot.buses[0].config.imu = None;
        let danced = dance_of(&robot, 12.0, "8s imu dead");
        assert_eq!((&danced.stopped_by, danced.fall_s), (&None, None), "{kind:?}");
        assert_eq!(danced.violations, ViolationReport::default(), "{kind:?}");
        let told = danced.events.iter().filter(|event| event.cause.contains("motion sensor"));
        let told_s: Vec<f64> = told.map(|event| event.time_s).collect();
        assert!(matches!(told_s[..], [at_s] if (8.0..8.3).contains(&at_s)), "{kind:?}: {told_s:?}");
    }
}

#[test]
fn a_robot_that_steps_stays_on_its_feet() {
    let mut robot = Robot::load("op3").unwrap();
    robot.retarget.stance = Stance::Stepping;
    let danced = dance_of(&robot, 20.0, "");
    let body = danced.body.as_ref().expect("a body");
    assert_eq!((&danced.stopped_by, danced.fall_s, body.fell), (&None, None, false));
    assert_eq!(danced.violations, ViolationReport::default());
    // Each foot was in the air for a while.
    assert!(body.load_share.iter().all(|share| *share < 0.995), "{body:?}");
}

fn getting_up(robot: &str, lying: Lying) -> Result<String, String> {
    let robot = Robot::load(robot).unwrap();
    let buses = vec![BusChoice::Sim; robot.buses.len()];
    let getup = GetUp { robot: &robot, buses: &buses, lying: Some(lying), stands_s: 1.0 };
    let told = getup.run(Speed::Max, &AtomicBool::new(false));
    told.map_err(|error| format!("{error:#}"))
}

#[test]
fn a_robot_gets_up_where_its_file_has_a_way() {
    let told = getting_up("op3", Lying::Back).unwrap();
    assert!(told.starts_with("op3 got up from its back in"), "{told}");
    let refused = getting_up("lite22", Lying::Front).unwrap_err();
    assert!(refused.contains("no way up from its front") && !refused.contains('\n'), "{refused}");
}
