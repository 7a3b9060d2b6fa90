//! Live sound, heard by the whole program in real time: it comes, stays away,
//! and comes back. The robot dances, idles, and dances again; no command is
//! missing and none jumps.

use crate::program::Program;
use crate::recording::Recording;
use crate::torque_off::{alone, signal};
use serde_json::Value;
use servodance_audio::song::{Song, SongSpec};
use servodance_runtime::robot::Robot;
use std::io::Write;
use std::path::Path;
use std::process::Output;
use std::time::{Duration, Instant};

const CHUNK: Duration = Duration::from_millis(10);
const PLAYED_S: f64 = 10.0;
const AWAY_S: f64 = 6.0;

/// A song at a rate that sound cards have.
fn song() -> Song {
    let mut spec = SongSpec::random(20.0, 5).expect("a song");
    spec.sample_rate_hz = 48_000;
    spec.render().expect("sound")
}

/// 16-bit samples, each `channels` times.
fn pcm(samples: &[f32], channels: usize) -> Vec<u8> {
    let integer = |s: &f32| (s.clamp(-1.0, 1.0) * 32_000.0) as i16;
    let bytes = |s: &f32| integer(s).to_le_bytes().repeat(channels);
    samples.iter().flat_map(bytes).collect()
}

/// Writes from `from_s` for `seconds` in chunks of 10 ms, on schedule, or
/// until nobody listens: the end of the program tells why.
fn play(out: &mut impl Write, song: &Song, channels: usize, from_s: f64, seconds: f64) {
    let start = Instant::now();
    let frames = (f64::from(song.sample_rate_hz) * CHUNK.as_secs_f64()) as usize;
    let first = (from_s / CHUNK.as_secs_f64()) as usize;
    for i in 0..(seconds / CHUNK.as_secs_f64()) as u32 {
        let due = start + CHUNK * i;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        let at = (first + i as usize) * frames % (song.samples.len() - frames);
        let chunk = pcm(&song.samples[at..at + frames], channels);
        if out.write_all(&chunk).is_err() {
            return;
        }
    }
}

fn report(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).expect("a report");
    serde_json::from_str(&text).expect("JSON")
}

/// What must hold of a run in which sound stayed away once.
fn check_run(program: &Program, output: &Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    for line in ["no sound arrives", "sound is back after"] {
        assert!(said.matches(line).count() >= 1, "not said: {line} in {said}");
    }
    let report = report(&program.path("live.json"));
    let capture = &report["capture"];
    assert_eq!(capture["overruns"], 0, "{capture}");
    assert!(capture["silence_s"].as_f64() > Some(AWAY_S - 1.0), "{capture}");
    assert!(report["latency_ms"]["command"]["p50_ms"].as_f64() > Some(0.0));
    let beats = report["beats"]["times_s"].as_array().expect("beats");
    assert!(beats.len() > 10, "{} beats", beats.len());
    for kind in ["position", "velocity", "acceleration"] {
        assert_eq!(report["violations"][kind], 0, "{kind}");
    }

    let recording = Recording::read(&program.path("live.mcap"));
    let mut shares = recording.timed_numbers("/idle").into_iter().map(|(_, s)| s);
    for (share, what) in [(0.0, "dances"), (1.0, "idles"), (0.0, "dances again")] {
        assert!(shares.any(|s| s == share), "it never {what}");
    }
    commands_are_continuous(&recording);
}

fn commands_are_continuous(recording: &Recording) {
    let robot = Robot::load("op3").expect("the built-in robot");
    let commands = recording.positions("/joint_commands");
    assert!(commands.len() > 1500, "{} cycles", commands.len());
    for pair in commands.windows(2) {
        let [(before_s, before), (after_s, after)] = pair else {
            unreachable!("windows of two");
        };
        let passed_s = after_s - before_s;
        assert!((passed_s - robot.period_s()).abs() < 1e-6, "{before_s}: {passed_s}");
        for (servo, (a, b)) in robot.servos.iter().zip(before.iter().zip(after)) {
            let most_rad = servo.limits.velocity_rad_s * passed_s * 1.001;
            assert!((b - a).abs() <= most_rad, "{} at {after_s} s: {a} to {b}", servo.name);
        }
    }
}

#[test]
fn sound_on_standard_input_may_stay_away_for_a_while() {
    let _alone = alone();
    let program = Program::new();
    let robot = program.unhurried_robot("op3");
    let arguments = [
        "dance",
        "-",
        "--robot",
        &robot,
        "--speed",
        "realtime",
        "--report",
        "live.json",
        "--record",
        "live.mcap",
        "--no-picture",
    ];
    let mut child = program
        .command(&arguments)
        .stdin(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("the program starts");
    let song = song();
    let mut pipe = child.stdin.take().expect("its input");
    play(&mut pipe, &song, 1, 0.0, PLAYED_S);
    std::thread::sleep(Duration::from_secs_f64(AWAY_S));
    play(&mut pipe, &song, 1, PLAYED_S, PLAYED_S);
    drop(pipe); // the music is over
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    check_run(&program, &output);
}

/// Silent from the beginning: no dance has begun, and everything that stops one is heard.
#[test]
fn sound_that_has_not_begun_can_be_stopped() {
    let _alone = alone();
    for (by, code, says) in [
        ("-TERM", 130, "stopped; torque is off"),
        ("-INT", 130, "stopped; torque is off"),
        ("-USR1", 1, "emergency stop (the signal SIGUSR1)"),
    ] {
        let program = Program::new();
        let mut child = program
            .command(&["dance", "-", "--robot", "neck", "--speed", "realtime", "--no-picture"])
            .stdin(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .expect("the program starts");
        let pipe = child.stdin.take();
        std::thread::sleep(Duration::from_secs(4)); // it has loaded, and waits
        signal(&child, by);
        let until = Instant::now() + Duration::from_secs(10);
        while child.try_wait().expect("its state").is_none() {
            assert!(Instant::now() < until, "it does not hear {by}");
            std::thread::sleep(Duration::from_millis(20));
        }
        drop(pipe);
        let output = child.wait_with_output().expect("it ended");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(says), "{said}");
    }
}

#[cfg(not(feature = "mic"))]
#[test]
fn without_microphones_built_in_it_says_how_to_get_them() {
    let program = Program::new();
    for arguments in [&["devices"][..], &["dance", "--mic"], &["dance", "--mic", "hw:0"]] {
        program.refused(arguments, &["not built in", "--features mic"]);
    }
}

/// A microphone that is a FIFO: ALSA reads it as a sound card.
#[cfg(feature = "mic")]
mod microphone {
    use super::*;
    use std::fs::{File, OpenOptions};
    use std::process::Command;

    const CONFIGURATION: &str = include_str!("soak/asound.conf");

    /// The FIFO, held open at both ends so that a pause is no end of file.
    fn microphone(program: &Program) -> File {
        let fifo = program.path("fifo");
        let made = Command::new("mkfifo").arg(&fifo).status();
        assert!(made.expect("mkfifo runs").success());
        let text = CONFIGURATION.replace("FIFO\"", &format!("{}\"", fifo.display()));
        std::fs::write(program.path("asound.conf"), text).expect("a file");
        let mut options = OpenOptions::new();
        options.read(true).write(true).open(&fifo).expect("the FIFO")
    }

    fn command(program: &Program, arguments: &[&str]) -> Command {
        let mut command = program.command(arguments);
        command.env("ALSA_CONFIG_PATH", program.path("asound.conf"));
        command
    }

    #[test]
    fn devices_lists_the_virtual_microphone() {
        let program = Program::new();
        let _fifo = microphone(&program);
        let output = command(&program, &["devices"]).output().expect("it runs");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{output:?}");
        let line = text.lines().find(|line| line.contains("virtual microphone"));
        assert!(line.is_some_and(|line| line.contains(" mic ")), "{text}");
    }

    #[test]
    fn an_unknown_microphone_is_refused_with_those_there_are() {
        let program = Program::new();
        let _fifo = microphone(&program);
        let output = command(&program, &["dance", "--mic", "kazoo"]).output();
        let output = output.expect("it runs");
        let error = String::from_utf8_lossy(&output.stderr);
        let error = error.lines().last().unwrap_or_default();
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(error.contains("\"kazoo\"") && error.contains("mic"), "{error}");
    }

    #[test]
    fn a_microphone_may_stall_and_come_back() {
        let _alone = alone();
        let program = Program::new();
        let mut fifo = microphone(&program);
        let robot = program.unhurried_robot("op3");
        let arguments = [
            "dance",
            "--mic",
            "mic",
            "--robot",
            &robot,
            "--report",
            "live.json",
            "--record",
            "live.mcap",
            "--no-picture",
        ];
        let child = command(&program, &arguments)
            .stderr(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .spawn()
            .expect("the program starts");
        let song = song();
        // More than a pipe holds: when it is written, somebody is listening.
        fifo.write_all(&[0; 1 << 17]).expect("silence");
        play(&mut fifo, &song, 2, 0.0, PLAYED_S);
        std::thread::sleep(Duration::from_secs_f64(AWAY_S));
        play(&mut fifo, &song, 2, PLAYED_S, PLAYED_S);
        signal(&child, "-INT");
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(130), "{output:?}");
        check_run(&program, &output);
        let opened = &report(&program.path("live.json"))["capture"]["opened"];
        assert!(opened.as_u64() > Some(1), "opened {opened} times");
    }
}
