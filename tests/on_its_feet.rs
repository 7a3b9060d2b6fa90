//! A robot on its feet in the simulated world: the firmware of simulated servos carries
//! it, its own motion sensor corrects it.

use servodance_audio::song::SongSpec;
use servodance_runtime::pipeline::model_args::EngineArgs;
use servodance_runtime::robot::Robot;
use servodance_runtime::session::dance::open_generator;
use servodance_runtime::session::fault_run::{FaultRun, FaultRunResult};
use servodance_runtime::telemetry::ViolationReport;
use servodance_runtime::world::WorldChoice;
use servodance_sim::parse_script;
use std::sync::atomic::AtomicBool;

fn dance(robot: &str, seconds: f64, faults: &str) -> FaultRunResult {
    let robot = Robot::load(robot).unwrap();
    let generator = open_generator(None, EngineArgs::default()).unwrap();
    let song = SongSpec::random(seconds, 5).and_then(|spec| spec.render()).unwrap();
    let joints: Vec<&str> = robot.servos.iter().map(|servo| servo.name.as_str()).collect();
    let run = FaultRun {
        world: WorldChoice::of_robot(&robot),
        faults: parse_script(faults, &joints).unwrap(),
        ..FaultRun::new(&robot, &generator, song)
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
