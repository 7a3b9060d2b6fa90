//! `robot new`: from a description alone to a robot that dances.

use crate::program::Program;
use crate::random_robot;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use servodance_retarget::{DraftOptions, Stance};
use servodance_runtime::offline::motion_tracking::track_motion;
use servodance_runtime::robot::{BUILT_IN, Robot};
use servodance_runtime::robot::{check, new_robot};
use servodance_runtime::telemetry::ViolationReport;
use servodance_training::choreography::trial_dance;
use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};
use std::path::{Path, PathBuf};

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Follows some seconds of dance; limits must hold.
fn danced(
    robot: &Robot,
    seconds: f64,
) -> servodance_runtime::offline::motion_tracking::TrackedMotion {
    let beats: Vec<DanceBeat> = (0..(seconds * 2.0) as usize)
        .map(|beat| DanceBeat { time_s: beat as f64 * 0.5, downbeat: beat % 4 == 0 })
        .collect();
    let clip = choreograph(&beats, seconds, DanceStyle::Hype, 3);
    let followed = track_motion(robot, &clip.frames(), |_, _| Ok(())).unwrap();
    assert_eq!(followed.violations, ViolationReport::default(), "{}", robot.name);
    followed
}

#[test]
fn built_in_descriptions_give_the_robots_that_people_wrote() {
    let folder = tempfile::tempdir().unwrap();
    for built_in in BUILT_IN {
        let written = Robot::load(built_in.name).unwrap();
        let urdf = write(folder.path(), "my.urdf", &written.urdf_xml);
        let out = folder.path().join("my.toml");
        new_robot(&urdf, &out, true, DraftOptions::default(), &trial_dance(), &[]).unwrap();
        let new = Robot::load(&out.display().to_string()).unwrap();
        assert_eq!(new.retarget.stance, written.retarget.stance, "{}", built_in.name);
        let (ours, theirs) = (&new.retarget.body, &written.retarget.body);
        for (part, guess, wanted) in [
            ("left_elbow", &ours.left_elbow, &theirs.left_elbow),
            ("right_elbow", &ours.right_elbow, &theirs.right_elbow),
            ("left_knee", &ours.left_knee, &theirs.left_knee),
            ("right_sole", &ours.right_sole, &theirs.right_sole),
            ("head", &ours.head, &theirs.head),
        ] {
            assert_eq!(guess, wanted, "{}: {part}", built_in.name);
        }
        assert_eq!(new.servos.len(), written.servos.len());
        assert!(check(&out.display().to_string()).usable);
        let followed = danced(&new, 10.0);
        assert_eq!(followed.interventions, 0, "{}", built_in.name);
    }
}

#[test]
fn the_new_file_dances_and_is_not_overwritten() {
    let program = Program::new();
    program.click_track("clicks.wav", 6.0, 120.0);
    std::fs::write(program.path("my.xml"), crate::robot_mutations::MJCF).unwrap();
    let new = ["robot", "new", "my.xml", "--out", "my.toml"];
    let said = program.succeed(&new).stdout;
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(said.starts_with("my.toml\nmy.urdf\n"), "{said}");
    for part in ["left_elbow: left_forearm", "head: head", "tail_ball", "no left leg"] {
        assert!(said.contains(part), "no {part:?} in {said}");
    }
    program.refused(&new, &["my.toml", "--force"]);
    program.succeed(&["dance", "clicks.wav", "--robot", "my.toml", "--no-picture", "--quiet"]);
    program.refused(&["robot", "new", "nowhere.urdf", "--out", "a.toml"], &["nowhere.urdf"]);
    program.refused(&["robot", "new", "my.xml", "--out", "a.txt"], &[".toml"]);
}

#[test]
fn jerk_limits_of_the_description_are_taken_over() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../configs/neck.urdf").replacen("<limit ", "<limit jerk=\"50\" ", 1);
    let urdf = write(folder.path(), "my.urdf", &text);
    let out = folder.path().join("my.toml");
    new_robot(&urdf, &out, true, DraftOptions::default(), &trial_dance(), &[]).unwrap();
    let robot = Robot::load(&out.display().to_string()).unwrap();
    let given: Vec<f64> = robot.retarget.jerk_deg_s3.values().copied().collect();
    assert_eq!(given.len(), 1);
    assert!((given[0].to_radians() - 50.0).abs() < 1e-2, "{given:?}");
    danced(&robot, 5.0);
}

#[test]
fn a_built_in_robot_is_copied_with_its_description() {
    let program = Program::new();
    let copy = ["robots", "neck", "--out", "my.toml"];
    program.succeed(&copy);
    assert_eq!(program.files(), ["my.toml", "neck.urdf"].map(|file| program.path(file)));
    program.succeed(&["robot", "check", "my.toml", "--no-world"]);
    program.refused(&copy, &["my.toml is there already"]);
    program.refused(&["robots", "nek", "--out", "nek.toml"], &["nek", "neck", "op3"]);
}

#[test]
fn random_robots_are_checked_drafted_and_danced_without_a_broken_limit() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("my.toml");
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (mut made, mut refused) = (0, 0);
    for round in 0..40 {
        let text = random_robot::urdf(&mut rng, 12, round % 2 == 0);
        let urdf = write(folder.path(), "my.urdf", &text);
        let usable = check(&urdf.display().to_string()).usable;
        match new_robot(&urdf, &out, true, DraftOptions::default(), &trial_dance(), &[]) {
            Ok(_) => {
                assert!(usable, "round {round}: {text}");
                let robot = Robot::load(&out.display().to_string()).unwrap();
                danced(&robot, 5.0);
                made += 1;
            }
            Err(error) => {
                let message = format!("{error:#}");
                // Told by the trial alone.
                let narrow = message.contains("no joint can have a servo")
                    || message.contains("nothing moves");
                assert!(!usable || narrow, "round {round}: {message}\n{text}");
                refused += 1;
            }
        }
    }
    assert!(made > 20, "{made} made, {refused} refused");
}

#[test]
fn a_robot_that_looks_along_another_axis_is_seen_to() {
    let folder = tempfile::tempdir().unwrap();
    // The upper body turned by -90 degrees about z: it looks along -y.
    let text = include_str!("../configs/torso13.urdf");
    let first = text.find("<joint name=\"abs_z\"").unwrap();
    let (head, tail) = text.split_at(first);
    let turned = tail.replacen("<origin xyz=\"", "<origin rpy=\"0 0 -1.5707963\" xyz=\"", 1);
    let urdf = write(folder.path(), "my.urdf", &format!("{head}{turned}"));
    let out = folder.path().join("my.toml");
    new_robot(&urdf, &out, false, DraftOptions::default(), &trial_dance(), &[]).unwrap();
    let robot = Robot::load(&out.display().to_string()).unwrap();
    assert_eq!((robot.retarget.forward.as_str(), robot.retarget.up.as_str()), ("-y", "z"));
    assert_eq!(robot.retarget.stance, Stance::Hung);
    danced(&robot, 5.0);
}
