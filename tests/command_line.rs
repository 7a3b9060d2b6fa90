//! The command line itself: readers that go away, completions, manual pages,
//! the doctor.

use crate::program::Program;
use serde_json::Value;
use std::process::Stdio;

/// Runs it with nobody at the other end of either output.
fn unheard(program: &Program, arguments: &[&str]) -> Option<i32> {
    let mut child = program
        .command(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop((child.stdout.take(), child.stderr.take()));
    child.wait().expect("it ends").code()
}

#[test]
fn readers_may_go_away() {
    let program = Program::new();
    // More than a pipe holds, so that somebody would have to read.
    assert_eq!(unheard(&program, &["completions", "bash"]), Some(0));
    assert_eq!(unheard(&program, &["dance", "--robot", "neck"]), Some(0));
    assert_eq!(program.files(), [program.path("dance.png")]);
    assert_eq!(unheard(&program, &["dance", "no.ogg"]), Some(1));
}

#[test]
fn every_command_has_a_manual_page_and_is_completed() {
    let program = Program::new();
    program.succeed(&["man", "--out", "pages"]);
    let script = program.succeed(&["completions", "bash"]).stdout;
    let script = String::from_utf8_lossy(&script);
    for name in ["dance", "robot-new", "bench-retarget", "doctor", "set-id"] {
        let page = program.path(&format!("pages/servodance-{name}.1"));
        let text = std::fs::read_to_string(&page).unwrap_or_default();
        assert!(text.contains(".SH"), "{}", page.display());
        let last = name.rsplit('-').next().unwrap_or(name);
        assert!(script.contains(last), "{name} is not completed");
    }
}

#[test]
fn every_command_teaches_by_example() {
    use clap::CommandFactory;
    let mut program = servodance::cli::Cli::command();
    let help = program.render_long_help().to_string();
    assert!(help.contains("Examples:"), "{help}");
    let commands = program.get_subcommands_mut();
    for command in commands.filter(|command| command.get_name() != "help") {
        let help = command.render_long_help().to_string();
        assert!(help.contains("Examples:"), "{help}");
    }
}

#[test]
fn an_export_of_nothing_is_wrong_usage() {
    let program = Program::new();
    let output = program.run(&["export", "out.mcap"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.contains("--gif") && error.contains("--bvh"), "{error}");
}

#[test]
fn a_value_that_is_refused_is_wrong_usage_in_one_line() {
    let program = Program::new();
    for (arguments, words) in [
        (&["bench", "world", "--songs", "0"][..], ["--songs", "1 to 10000"]),
        (&["song", "--out", "song.mp3"], ["song.mp3", "call it song.wav"]),
        (&["dance", "-", "--pcm-rate", "1"], ["--pcm-rate", "8000 to 384000"]),
        (&["getup", "--stand", "nan"], ["--stand", "0 to 3600"]),
        (&["soak", "--piece", "x"], ["--piece", "5 to 3600"]),
    ] {
        program.misused(arguments, &words);
    }
}

#[test]
fn the_doctor_measures_and_says_what_to_do() {
    let program = Program::new();
    let output = program.run(&["doctor", "--robot", "neck", "--json"]);
    let findings: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let findings = findings.as_array().expect("a list");
    let count = |area: &str| findings.iter().filter(|f| f["area"] == area).count();
    for area in ["priority", "timer", "budget", "sound", "serial", "bus"] {
        assert!(count(area) > 0, "{area}: {findings:?}");
    }
    for finding in findings {
        let healthy = finding["verdict"] == "good";
        assert_eq!(healthy, finding["remedy"].is_null(), "{finding}");
    }
    let bad = findings.iter().any(|f| f["verdict"] == "bad");
    assert_eq!(output.status.code(), Some(i32::from(bad)));
    program.refused(&["doctor", "--robot", "nobody"], &["nobody", "op3"]);
}
