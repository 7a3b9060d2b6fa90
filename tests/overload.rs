//! A generator that is too slow for the machine, in real time: things are left
//! out in their order, and the servos hear every command in time.

use crate::program::Program;
use crate::torque_off::alone;
use serde_json::Value;

#[test]
fn a_slow_generator_costs_picture_viewers_and_guidance_not_control() {
    let _alone = alone();
    let program = Program::new();
    let robot = program.unhurried_robot("neck");
    let arguments = ["dance", "--robot", &robot, "--speed", "realtime"];
    let files = ["--report", "out.json", "--picture", "out.png"];
    // A guided step goes through the model twice: 50 ms are too long, 25 are not.
    let output = program
        .command(&[&arguments[..], &files].concat())
        .env("SERVODANCE_FAILPOINT", "slow:model@25")
        .output()
        .expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let at = |text: &str| said.find(text).unwrap_or_else(|| panic!("no {text} in {said}"));
    let order = ["no picture", "five frames a second", "no guidance"].map(at);
    assert!(order.is_sorted(), "{said}");
    assert!(!program.path("out.png").exists());
    let report = std::fs::read_to_string(program.path("out.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    let left_out = report["left_out"].as_array().expect("a list");
    assert_eq!(left_out[..3], ["picture", "viewers", "guidance"]);
    for kind in ["position", "velocity", "acceleration"] {
        assert_eq!(report["violations"][kind], 0, "{kind}");
    }
    let (cycles, late) = (&report["bus_stats"]["cycles"], &report["late_frames"]);
    println!("{late} of {cycles} cycles without their motion, left out: {left_out:?}");
    let (cycles, late) = (cycles.as_f64(), late.as_f64());
    assert!(late < cycles.map(|c| 0.05 * c), "{late:?} of {cycles:?}");
    let held = report["safety"].as_array().expect("a log");
    let stale = |e: &&Value| e["cause"].as_str().is_some_and(|c| c.contains("targets are"));
    assert_eq!(held.iter().filter(stale).count(), 0, "{held:?}");
}
